"""Data of the repository and the program built from it."""

import os
import subprocess
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from hypothesis import settings

matplotlib.use("Agg")
settings.register_profile("ci", derandomize=True)

ROOT = Path(__file__).parents[3]
TRACES = sorted((ROOT / "data" / "traces").glob("*.csv.gz"))


@pytest.fixture(scope="session")
def program():
    """Runs the program `pitchleak`."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    binary = target / "release" / "pitchleak"
    if not binary.exists():
        subprocess.run(["cargo", "build", "--release", "-p", "pitchleak-cli"], cwd=ROOT, check=True)

    def run(*arguments):
        done = subprocess.run([binary, *map(str, arguments)], cwd=ROOT, check=True, capture_output=True, text=True)
        return done.stdout

    return run


def read_columns(path):
    """A trace file as a dict of float64 arrays, each number read exactly."""
    import gzip

    with gzip.open(path, "rt") as file:
        header = file.readline().strip().split(",")
        rows = [[float(cell) if cell else np.nan for cell in line.strip().split(",")] for line in file]
    return {name: np.array(column) for name, column in zip(header, zip(*rows, strict=True), strict=True)}


@pytest.fixture(scope="session")
def columns():
    """A trace with two leaks."""
    return read_columns(ROOT / "data" / "traces" / "both.csv.gz")


@pytest.fixture(scope="session")
def rig():
    """The rig of the traces in `data`."""
    import pitchleak as pl

    return pl.Rig.load(ROOT / "data" / "traces" / "rig.toml")
