#!/usr/bin/env python3
"""Do all doors say the same? `check`, `replay` and `watch` of the same drawn traces: the share of equal statuses.

    cargo build --release -p pitchleak-cli && pip install . && python benches/doors.py [--traces 120] [--seed 1]

A trace is 20 to 300 s of one of the four winds at 20, 50 or 100 Hz, sound or with one leak of 0.2 or 0.5 L/min, half of
them with a sensor or wire that errs.
"""

import argparse
import collections
import json
import os
import pathlib
import random
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor

import pitchleak as pl

PROGRAM = pathlib.Path(__file__).parent.parent / "target/release/pitchleak"
DOORS = ("replay", "check", "watch")
LEAKS = ("internal", "external-a", "external-b")
ERRORS = (
    "qa gain 5 %", "qb offset 1 %", "qa offset 0.3 %", "pb offset 4 bar", "qa held 100 ms", "qb drift 0.3 L/min/h",
    "pa late 50 ms", "swap qa qb", "swap pa pb", "qa reversed", "x stuck @ 5 s..15 s", "qa times 10",
)  # fmt: skip


def draw(chance):
    """The arguments of `simulate` for one trace, and its rig file."""
    length_s = chance.choice((20, 30, 60, 120, 300))
    arguments = ["--wind", chance.choice(("5", "13", "21", "30")), "--noise", "rig"]
    arguments += ["--duration", f"{length_s} s", "--sample-rate", chance.choice(("20", "50", "100"))]
    leak = chance.choice((None, *LEAKS))
    if leak:
        arguments += [f"--leak-{leak}", f"{chance.choice((0.2, 0.5))} L/min"]
    if chance.random() < 0.5:
        arguments += ["--fault", chance.choice(ERRORS)]
    rig = pl.Rig.paper().replace(accuracy=chance.choice(("0.1 %", "0.3 %", "1 %")))
    return [*arguments, "--seed", str(chance.randrange(1 << 31))], rig.to_toml()


def status(door, trace):
    """What a door says of a trace, or why it says nothing."""
    if door == "watch":
        with trace.open() as rows:
            done = subprocess.run(
                [PROGRAM, "watch", "-q", "--rig", trace.with_name("rig.toml")],
                stdin=rows,
                capture_output=True,
                text=True,
            )
        said = [json.loads(line) for line in done.stdout.splitlines()]
        statuses = [one["status"] for one in said if one["type"] == "estimate"]
        return statuses[-1] if statuses else done.stderr.strip()
    done = subprocess.run([PROGRAM, door, "--json", "-q", trace], capture_output=True, text=True)
    return json.loads(done.stdout)["verdict"]["status"] if done.stdout else done.stderr.strip()


def judge(drawn):
    """Each door's status of one trace."""
    arguments, rig = drawn
    with tempfile.TemporaryDirectory() as folder:
        trace = pathlib.Path(folder) / "trace.csv"
        trace.with_name("rig.toml").write_text(rig)
        simulate = [PROGRAM, "simulate", *arguments, "--rig", trace.with_name("rig.toml"), "--out", trace]
        subprocess.run(simulate, check=True, capture_output=True)
        return arguments, [status(door, trace) for door in DOORS]


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--traces", type=int, default=120)
    parser.add_argument("--seed", default="1")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    drawn = [draw(chance) for _ in range(options.traces)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        judged = list(pool.map(judge, drawn))
    for arguments, said in judged:
        if len(set(said)) > 1:
            print(" ".join(f"{door}: {word}" for door, word in zip(DOORS, said, strict=True)), *arguments)
    equal = sum(len(set(said)) == 1 for _, said in judged)
    print(f"{equal} of {len(judged)} the same:", dict(collections.Counter(said[0] for _, said in judged)))


if __name__ == "__main__":
    main()
