#!/usr/bin/env python3
"""Counts the crates of others behind what is shipped, for Linux on x86-64, and holds them against the table in
SECURITY.md: a new one does not come in unseen.

    python3 ci/crates.py
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# As in the table: the package and what it is built with.
SHIPPED = {
    "core": ["pitchleak-core"],
    "engine": ["pitchleak"],
    "engine with Parquet": ["pitchleak", "--features", "parquet"],
    "program": ["pitchleak-cli"],
    "Python package": ["pitchleak-py"],
    "gateway": ["pitchleak-gateway"],
}


def crates(arguments: list[str]) -> set[str]:
    """Names and versions, build scripts' own left out."""
    tree = ["cargo", "tree", "--locked", "--target", "x86_64-unknown-linux-gnu", "--edges", "normal"]
    listed = subprocess.run(
        [*tree, "--prefix", "none", "--package", *arguments], cwd=ROOT, capture_output=True, text=True, check=True
    )
    named = (" ".join(line.split()[:2]) for line in listed.stdout.splitlines())
    return {name for name in named if not name.startswith("pitchleak")}


def main() -> int:
    stated = dict(re.findall(r"^\| ([\w ]+?) \| (\d+) \|$", (ROOT / "SECURITY.md").read_text(), re.MULTILINE))
    counted = {name: str(len(crates(arguments))) for name, arguments in SHIPPED.items()}
    for name, count in counted.items():
        print(f"{name:20} {count:>4}" + ("" if stated.get(name) == count else f"; SECURITY.md says {stated.get(name)}"))
    return int(stated != counted)


sys.exit(main())
