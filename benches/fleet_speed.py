#!/usr/bin/env python3
"""Time of a fleet beside the time that its bytes take to be read, on every way to judge it.

    pip install '.[pandas,polars]' 'dask[distributed]' && cargo build --release -p pitchleak-cli
    python benches/fleet_speed.py [--traces 200] [--short 10000]

200 traces of 60 000 rows (1.2 GB; made here in a folder that goes again), then 10 000 traces of ten rows, for what a
trace costs beside its rows. Times of the program and of polars are processor times over the cores, so that what else
runs on the machine counts less; the ways of Python are walls.
"""

import argparse
import os
import pathlib
import resource
import subprocess
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor

os.environ["POLARS_MAX_THREADS"] = "1"
import numpy as np
import polars

import pitchleak as pl

PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "release" / "pitchleak"
CORES = len(os.sched_getaffinity(0))
ROWS = 60_000


def columns():
    """The paper's cylinder with an internal leak of 1.2e-11 m3/(s Pa), noise of 0.1 % and meters of the leaks."""
    t, noise = np.arange(ROWS) / 100, np.random.default_rng(1).normal
    area_a, area_b, stroke, modulus = 1.26e-3, 0.94e-3, 0.2, 0.8e9
    x, v = 0.1 + 0.05 * np.sin(0.5 * t), 0.025 * np.cos(0.5 * t)
    pa, pb = 5e6 + 1e6 * np.sin(0.3 * t), 4e6 + 1e6 * np.cos(0.3 * t)
    leak = 1.2e-11 * (pa - pb)
    qa = area_a * v + area_a * x / modulus * 0.3e6 * np.cos(0.3 * t) + leak
    qb = -area_b * v - area_b * (stroke - x) / modulus * 0.3e6 * np.sin(0.3 * t) - leak
    full_scales = {"x_mm": 200, "pa_bar": 160, "pb_bar": 160, "qa_lpm": 20, "qb_lpm": 20}
    readings = {"x_mm": 1e3 * x, "pa_bar": pa / 1e5, "pb_bar": pb / 1e5, "qa_lpm": 6e4 * qa, "qb_lpm": 6e4 * qb}
    readings = {name: exact + noise(0.0, 0.001 * full_scales[name], ROWS) for name, exact in readings.items()}
    meters = {"q_int_lpm": 6e4 * leak, "q_ext_a_lpm": 0.0 * t, "q_ext_b_lpm": 0.0 * t}
    return polars.DataFrame(
        {"t_s": t, "v_mps": v} | readings | meters | {"force_n": pa * area_a - pb * area_b + noise(0.0, 50.0, ROWS)}
    )


def processor_s(command):
    """Processor time, s, and wall time, s, of a program."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([PROGRAM, *command], stdout=subprocess.DEVNULL, check=True)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall


def own_processor_s(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def wall_s(work):
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def farm(folder, name, count, frame, write):
    first = folder / f"{name}-0"
    write(frame, first)
    for n in range(1, count):
        # Of copies only one would be judged.
        write(frame.with_columns(polars.col("t_s") + n), folder / f"{name}-{n}")
    return str(folder / f"{name}-*"), first.stat().st_size * count


def show(what, seconds, note=""):
    print(f"{what:<48}{seconds:8.2f} s{note}", flush=True)


def on_dask(csv):
    from dask.distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=CORES, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        # A pool's processes have the package from the one that forked them.
        client.run(__import__, "pitchleak")
        return wall_s(lambda: pl.fleet(csv, map=client.map, progress=False))


def on_a_pool(csv):
    with ProcessPoolExecutor(CORES) as pool:
        pool.submit(abs, 1).result()
        return wall_s(lambda: pl.fleet(csv, map=pool.map, progress=False))


def emptied(folder):
    for path in folder.iterdir():
        path.unlink()
    return folder


def long_traces(folder, count):
    frame = columns()
    csv, size = farm(folder, "csv", count, frame, lambda one, path: one.write_csv(path, float_precision=7))
    one = str(folder / "csv-0")
    print(f"{count} traces of {ROWS} rows, {size / 1e6:.0f} MB, {CORES} cores")
    read = min(own_processor_s(lambda: polars.read_csv(one)) for _ in range(31)) * count / CORES
    show("polars reads it, one thread, over the cores", read)
    replay = min(processor_s(["replay", one])[0] for _ in range(7)) * count / CORES
    show("replay of each, processor time over the cores", replay, f": {replay / read:.2f} times the reading")
    spent, wall = min(processor_s(["fleet", csv]) for _ in range(3))
    show("fleet, processor time over the cores", spent / CORES, f": {spent / CORES / read:.2f} times the reading")
    show("fleet, wall", wall)
    parquet, _ = farm(folder, "parquet", count, frame, lambda one, path: one.write_parquet(path, compression="snappy"))
    binary, _ = min(processor_s(["fleet", parquet]) for _ in range(3))
    show(
        "fleet of Parquet, processor time over the cores",
        binary / CORES,
        f": CSV takes {spent / binary:.2f} times as long",
    )
    show("pl.fleet", wall_s(lambda: pl.fleet(csv, progress=False)))
    pool, dask = on_a_pool(csv), on_dask(csv)
    show("pl.fleet on a process pool", pool)
    show("pl.fleet on Dask", dask, f": {dask / pool:.2f} times the pool")


def short_traces(folder, count):
    short, _ = farm(emptied(folder), "short", count, columns()[:10], lambda one, path: one.write_csv(path))
    spent, wall = processor_s(["fleet", short])
    per_trace = 1e3 / count
    print(
        f"{count} traces of ten rows, each: {per_trace * spent:.3f} ms of processor, {per_trace * wall:.3f} ms of wall"
    )
    print(f"with pl.fleet: {per_trace * wall_s(lambda: pl.fleet(short, progress=False)):.3f} ms of wall")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--traces", type=int, default=200)
    arguments.add_argument("--short", type=int, default=10_000)
    arguments = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        long_traces(pathlib.Path(folder), arguments.traces)
        short_traces(pathlib.Path(folder), arguments.short)


if __name__ == "__main__":
    main()
