#!/usr/bin/env python3
"""A farm's month: is every leak above its threshold in the list, on which day, and what else is?

    pip install '.[arrow]' && python benches/farm_month.py [--turbines 40] [--days 30] [--seed 1]

Each night a minute of 50 Hz of every blade in a wind of its own joins a table that grows (`pl.fleet(…, table=…)`).
Sensors have noise and zeros as their rig file says; the zeros are drawn anew each day. One blade of twenty has a leak
that grows, one of twenty a sensor that errs from some day on. A leak can be told from the day on which it is above its
alarm's threshold: what is told before counts as early, and a leak that is none as false.
"""

import argparse
import itertools
import pathlib
import random
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import pitchleak as pl

KINDS = ("internal", "external_a", "external_b")
ERRORS = (
    "qa gain 5 %", "qb offset 1 %", "pb offset 4 bar", "qa held 100 ms", "qb drift 0.3 L/min/h",
    "pa late 50 ms", "swap qa qb", "qa clipped 5 L/min", "x stuck 20 s..40 s",
)  # fmt: skip
RIG = pl.Rig.paper().replace(
    flow={"full_scale": "20 L/min", "bias": "0.1 %"},
    pressure={"full_scale": "160 bar", "bias": "0.1 %"},
    accuracy="0.3 %",
)

# The built-in winds are a minute longer.
LAST_START_S = 225

# A leak grows to this size and stays: much more, and the supply no longer holds the blade.
LARGEST_LPM = 1.0


@dataclass(frozen=True)
class Blade:
    """What is true of one cylinder."""

    name: str
    leak: str | None = None
    begins_day: int = 0
    lpm_per_day: float = 0.0
    error: str | None = None

    def lpm(self, day):
        """The leak's flow on a day, L/min."""
        return min(max(0.0, self.lpm_per_day * (day - self.begins_day)), LARGEST_LPM)

    def due(self, days):
        """The first day on which it is above its threshold; None where there is none."""
        if self.leak is None:
            return None
        threshold = RIG.alarm_thresholds_lpm[KINDS.index(self.leak)]
        return next((day for day in range(days) if self.lpm(day) > threshold), None)


def farm(turbines, days, draw):
    names = [f"T{turbine:02}/B{blade}" for turbine, blade in itertools.product(range(1, turbines + 1), (1, 2, 3))]
    share = max(1, len(names) // 20)
    odd = draw.sample(range(len(names)), 2 * share)
    blades = [Blade(name) for name in names]
    for at in odd[:share]:
        begins = draw.randrange(days // 2)
        blades[at] = Blade(names[at], draw.choice(KINDS), begins, draw.uniform(0.02, 0.06))
    for at in odd[share:]:
        blades[at] = Blade(names[at], begins_day=draw.randrange(days), error=draw.choice(ERRORS))
    return blades


def record(folder, blade, day, seed):
    """One minute of a blade as a file."""
    draw = random.Random(f"{seed} {blade.name} {day}")
    place = folder / blade.name
    place.mkdir(parents=True, exist_ok=True)
    (place / "rig.toml").write_text(RIG.to_toml())
    leak = {} if blade.leak is None else {f"leak_{blade.leak}": f"{blade.lpm(day)} L/min"}
    faults = [blade.error] if blade.error and day >= blade.begins_day else []
    pl.simulate(
        draw.choice((5, 13, 21)), RIG, start=draw.uniform(10, LAST_START_S), duration=60, sample_rate=50, noise="rig",
        bias="0.17 %", faults=faults, seed=draw.randrange(2**31), out=place / f"2026-06-{day + 1:02}.csv.gz",
        progress=False, **leak,
    )  # fmt: skip


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, default in (("turbines", 40), ("days", 30), ("seed", 1)):
        arguments.add_argument(f"--{name}", type=int, default=default)
    arguments = arguments.parse_args()
    days, blades = arguments.days, farm(arguments.turbines, arguments.days, random.Random(arguments.seed))
    told = {}
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor() as pool:
        folder = pathlib.Path(folder)
        for day in range(days):
            list(pool.map(record, *zip(*((folder, blade, day, arguments.seed) for blade in blades), strict=True)))
            start = time.perf_counter()
            found = pl.fleet(f"{folder}/**/*.csv.gz", table=folder / "nights", progress=False)
            wall = time.perf_counter() - start
            for cylinder, state in found.cylinders.items():
                for leak in state.faults if state.status == "leak" else ():
                    told.setdefault((cylinder.removeprefix(f"{folder}/"), leak), day)
            counts = ", ".join(f"{count} {status}" for status, count in found.cylinder_counts.items() if count)
            print(
                f"day {day + 1}: {len(found.rows)} traces in the table, {wall:.1f} s; {counts}",
                flush=True,
            )
    judge(blades, days, told)


def judge(blades, days, told):
    """Each leak's day beside the day from which it could be told; then what is in the list and is no leak."""
    for blade in blades:
        due = blade.due(days)
        if blade.leak is None or due is None:
            continue
        day = told.get((blade.name, blade.leak))
        when = "MISSED" if day is None else f"told on day {day + 1}, {day - due:+} days"
        size = "" if day is None else f" at {blade.lpm(day):.3f} L/min"
        print(f"{blade.name} {blade.leak}: due on day {due + 1}, {when}{size}")
    leaks = {(blade.name, blade.leak) for blade in blades if blade.leak}
    errors = {blade.name: blade.error for blade in blades if blade.error}
    false = {entry: day for entry, day in told.items() if entry not in leaks}
    for (name, leak), day in false.items():
        print(f"FALSE {name} {leak} on day {day + 1}; its sensors: {errors.get(name, 'as declared')}")
    due = [blade for blade in blades if blade.due(days) is not None]
    found = sum((blade.name, blade.leak) in told for blade in due)
    print(f"{found} of {len(due)} leaks above their thresholds told; {len(false)} false entries in {days} days")


if __name__ == "__main__":
    main()
