#!/usr/bin/env python3
"""How long an analyst waits: for the import, for a fleet's table, for traces of each format, for a simulated hour,
for a diagnosis. Beside each, where there is one, the time that pandas takes for the like.

    pip install '.[pandas,arrow]' && cargo build --release -p pitchleak-cli
    python benches/waits.py [--rounds 5]

Processor times, the best of the rounds, so that what else runs on the machine counts less. Pandas only reads a
file that `replay` reads and judges. Ends with 1 where a goal is missed.
"""

import argparse
import gzip
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import time

import pandas as pd

import pitchleak as pl

PROGRAM = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", "target")) / "release" / "pitchleak"
TRACES = 20_000


def child_s(command):
    """Processor time of a program, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(list(map(str, command)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def own_s(work):
    """Processor time of a call, of all its threads, s."""
    start = time.process_time()
    work()
    return time.process_time() - start


def python_s(*lines):
    return child_s([sys.executable, "-c", "; ".join(lines)])


class Table:
    """What was measured, beside its goal and pandas."""

    def __init__(self, rounds):
        self.rounds, self.missed = rounds, False
        print("| what | s | goal | pandas, s |\n|---|---|---|---|")

    def best(self, measure, times=1):
        return min(measure() for _ in range(self.rounds * times))

    def row(self, what, found_s, most_s=None, goal="", pandas_s=None):
        self.missed |= most_s is not None and found_s > most_s
        verdict = "" if most_s is None else f"{goal}: {'kept' if found_s <= most_s else 'missed'}"
        beside = "" if pandas_s is None else f"{pandas_s:.4g}"
        print(f"| {what} | {found_s:.4g} | {verdict} | {beside} |", flush=True)


def imports(table):
    """The interpreter's own start is taken off."""
    empty = table.best(lambda: python_s("pass"), 4)
    numpy, ours, used, pandas = (
        table.best(lambda lines=lines: python_s(*lines), 4) - empty
        for lines in (
            ("import numpy",),
            ("import pitchleak",),
            ("import pitchleak", "pitchleak.replay"),
            ("import pandas",),
        )
    )
    table.row("`import numpy`", numpy)
    table.row("`import pitchleak`", ours, 1.2 * numpy, f"1.2 × numpy ({ours / numpy:.2f})", pandas)
    table.row(f"… and a first name, which imports numpy ({used / numpy:.2f} × numpy)", used)


def hour(table, folder):
    """Simulates an hour and gives its files by format."""
    csv = folder / "hour.csv"
    command = [PROGRAM, "simulate", "--wind", "13", "--leak-internal", "0.3 L/min", "--noise", "1 %"]
    command += ["--duration", "3600 s", "--out", csv]
    table.row("`simulate` of an hour, 360 000 rows", table.best(lambda: child_s(command)), 4.0, "4 s")
    with open(csv, "rb") as plain, gzip.open(folder / "hour.csv.gz", "wb", 6) as packed:
        shutil.copyfileobj(plain, packed)
    frame = pd.read_csv(csv)
    for codec in ("snappy", "zstd"):
        frame.to_parquet(folder / f"hour.{codec}.parquet", compression=codec)
    return frame, csv


def formats(table, folder, csv):
    def replay(file):
        return table.best(lambda: child_s([PROGRAM, "replay", file, "--json"]))

    def read(reader, file):
        return table.best(lambda: own_s(lambda: reader(file)))

    plain = replay(csv)
    table.row(f"`replay` of it, CSV ({csv.stat().st_size / 1e6:.0f} MB)", plain, pandas_s=read(pd.read_csv, csv))
    packed = folder / "hour.csv.gz"
    table.row("… CSV, gzip", replay(packed), pandas_s=read(pd.read_csv, packed))
    for codec in ("snappy", "zstd"):
        file = folder / f"hour.{codec}.parquet"
        found = replay(file)
        table.row(f"… Parquet, {codec}", found, plain, f"1 × CSV ({found / plain:.2f})", read(pd.read_parquet, file))


def calls(table, frame):
    """What Python does with a frame in memory."""
    rig = pl.Rig.paper()
    table.row("`pl.replay` of the frame", table.best(lambda: own_s(lambda: pl.replay(frame, rig))))
    short = pl.simulate(13, effects={"viscous_friction": 3000.0}, noise="0.1 %", duration=60).columns
    accurate = rig.replace(accuracy="0.1 %")
    table.row(
        "`pl.diagnose` of a minute", table.best(lambda: own_s(lambda: pl.diagnose(short, accurate, progress=False)))
    )


def fleet(table, frame):
    """Many short traces: what the table costs, not the judging."""
    short = {name: frame[name].to_numpy()[:10].copy() for name in frame.columns}
    traces = {f"T{number // 3}/B{number % 3 + 1}": short for number in range(TRACES)}
    start = time.process_time()
    found = pl.fleet(traces, pl.Rig.paper(), map=map, progress=False)
    table.row(f"`pl.fleet` of {TRACES} traces of ten rows", time.process_time() - start)
    rows = found.to_pandas()
    plain = rows.to_dict("records")

    def best(work):
        # A fleet keeps its rows once they are made: each round has one of its own.
        return table.best(lambda: own_s(lambda: work(pl.Fleet(found._rows))))

    def pandas_best(work):
        return table.best(lambda: own_s(work))

    counted = pandas_best(lambda: rows["status"].value_counts().to_dict())
    table.row("… `counts`", best(lambda fleet: fleet.counts), 0.01, "10 ms", counted)
    made = pandas_best(lambda: pd.DataFrame(plain))
    table.row("… `to_pandas()`", best(lambda fleet: fleet.to_pandas()), pandas_s=made)
    table.row("… `rows`", best(lambda fleet: fleet.rows), pandas_s=pandas_best(lambda: list(rows.itertuples())))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--rounds", type=int, default=5)
    table = Table(parser.parse_args().rounds)
    imports(table)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        frame, csv = hour(table, folder)
        formats(table, folder, csv)
    calls(table, frame)
    fleet(table, frame)
    return 1 if table.missed else 0


if __name__ == "__main__":
    sys.exit(main())
