#!/usr/bin/env python3
"""Time and memory of `pitchleak replay` beside the time that polars needs only to read the same file.

    pip install polars && cargo build --release -p pitchleak-cli && python3 benches/replay_speed.py

One thread each. The trace is made here: 360 000 rows at 100 Hz, 11 columns, 36 MB; for the memory the same
ten times as long.
"""

import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time

os.environ["POLARS_MAX_THREADS"] = "1"
import polars  # after the variable, which it reads when it is imported

PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "release" / "pitchleak"
HEADER = "t_s,x_m,v_mps,pa_pa,pb_pa,qa_m3s,qb_m3s,force_n,q_int_m3s,q_ext_a_m3s,q_ext_b_m3s\n"
ROUNDS = 15
# What README claims, with room for a machine that is not quiet.
MOST_TIMES = 1.2
MOST_MIB = 8


def row(i):
    """One sample of the paper's cylinder with an internal leak of 1.2e-11 m3/(s Pa)."""
    t = i / 100
    x, v = 0.1 + 0.05 * math.sin(0.5 * t), 0.025 * math.cos(0.5 * t)
    pa, pb = 5e6 + 1e6 * math.sin(0.3 * t), 4e6 + 1e6 * math.cos(0.3 * t)
    leak = 1.2e-11 * (pa - pb)
    qa, qb = 1.26e-3 * v + leak, -0.94e-3 * v - leak
    force = pa * 1.26e-3 - pb * 0.94e-3
    return f"{t:.3f},{x:.7f},{v:.6f},{pa:.2f},{pb:.2f},{qa:.4e},{qb:.4e},{force:.4f},{leak:.5e},0,0\n"


def write(path, rows):
    with open(path, "w") as file:
        file.write(HEADER)
        file.writelines(map(row, range(rows)))


def replay(path):
    subprocess.run([PROGRAM, "replay", path, "--json"], stdout=subprocess.DEVNULL, check=True)


def seconds(work, path):
    start = time.perf_counter()
    work(path)
    return time.perf_counter() - start


def peak_mib(path):
    """High-water mark of the program, as the kernel shows it while it runs (Linux)."""
    process = subprocess.Popen([PROGRAM, "replay", path, "--json"], stdout=subprocess.DEVNULL)
    peak = 0
    while process.poll() is None:
        with open(f"/proc/{process.pid}/status") as status:
            marks = [int(line.split()[1]) for line in status if line.startswith("VmHWM")]
        peak = max([peak, *marks])
        time.sleep(0.002)
    return peak / 1024


def main():
    with tempfile.TemporaryDirectory() as folder:
        trace, long_trace = os.path.join(folder, "trace.csv"), os.path.join(folder, "long.csv")
        write(trace, 360_000)
        print(f"trace of {os.path.getsize(trace) / 1e6:.1f} MB, best of {ROUNDS}")
        pairs = [(seconds(polars.read_csv, trace), seconds(replay, trace)) for _ in range(ROUNDS)]
        read, replayed = (min(times) for times in zip(*pairs, strict=True))
        print(f"polars reads it in {read:.3f} s; replay takes {replayed:.3f} s: {replayed / read:.2f} times that")
        write(long_trace, 3_600_000)
        short, long = peak_mib(trace), peak_mib(long_trace)
        print(f"peak memory {short:.1f} MiB, on a trace ten times as long {long:.1f} MiB")
        return 0 if replayed <= MOST_TIMES * read and long <= MOST_MIB else 1


if __name__ == "__main__":
    sys.exit(main())
