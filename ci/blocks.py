"""Runs every command and block of the documentation, each page in a folder of its own.

    python ci/blocks.py [PAGE…]       # needs target/release/pitchleak, the examples, and the Python package

Pages are README.md and those of docs/SUMMARY.md. What is done with a fenced block follows from its info string:

    sh            is run; a command that fails fails the page
    python        is run, all blocks of a page in one interpreter
    toml NAME     becomes the file NAME
    text output   each line stands in what the command before it printed; … stands for anything

`<!-- not run: REASON -->` before a block leaves it out, `<!-- first: CODE -->` runs CODE ahead of it. `cargo` and `pip`
are stand-ins here: what they run is built already, what they test or build is a step of `.ci/run`, so that its name
only has to exist. A command in an indented block is a mistake: nobody would run it.
"""

import concurrent.futures
import gzip
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(
    r"(?:<!-- not run: (?P<skip>[^>]+?) -->\n+)?(?:<!-- first:\s*(?P<first>.*?)\s*-->\n+)?"
    r"^```(?P<info>\S[^\n]*)\n(?P<body>.*?)^```$",
    re.DOTALL | re.MULTILINE,
)
COMMAND = re.compile(r"^ {4}(?:pitchleak|cargo|python3?|pip|mdbook) .*", re.MULTILINE)
CHAPTER = re.compile(r"\]\(([^)]+\.md)\)")

CARGO = f"""#!/usr/bin/env bash
set -euo pipefail
cd_root() {{ cd {ROOT}; }}
exists() {{ (cd_root; compgen -G "$1" >/dev/null || compgen -G "$2" >/dev/null) || {{ echo "no $1" >&2; exit 1; }}; }}
if [[ "$*" == "run --release -p pitchleak-cli -- "* ]]; then exec pitchleak "${{@:6}}"; fi
if [[ "$*" == "run --release --example "* ]]; then exec {ROOT}/target/release/examples/"$4" "${{@:6}}"; fi
while [ $# -gt 0 ]; do case $1 in
    --) break ;;
    --test) exists "tests/$2*" "crates/*/tests/$2*"; shift ;;
    --bench) exists "benches/$2*" "benches/$2/main.rs"; shift ;;
    --path) exists "$2/Cargo.toml" -; shift ;;
    -p) exists "crates/$2/Cargo.toml" -; shift ;;
esac; shift; done
"""


@dataclass
class Block:
    page: Path
    line: int
    language: str
    detail: str
    body: str
    first: str
    skip: str | None


def pages() -> list[Path]:
    summary = (ROOT / "docs/SUMMARY.md").read_text()
    found = [(ROOT / "docs" / link).resolve() for link in CHAPTER.findall(summary)]
    return [page for page in found if page.name != "CHANGELOG.md"]


def blocks(page: Path) -> list[Block]:
    text = page.read_text()
    found = []
    for match in BLOCK.finditer(text):
        language, _, detail = match["info"].partition(" ")
        line = text.count("\n", 0, match.start("info")) + 1
        found.append(Block(page, line, language, detail, match["body"], match["first"] or "", match["skip"]))
    return found


def workplace(folder: Path) -> dict[str, str]:
    """What the pages speak of as there: the clone's folders, a trace and its rig, two days, a farm."""
    for name in ("crates", "data", "docs", "examples", "packaging"):
        (folder / name).symlink_to(ROOT / name)
    traces = ROOT / "data/traces"
    shutil.copy(traces / "rig.toml", folder)
    shutil.copy(traces / "external_a.csv.gz", folder / "trace.csv.gz")
    (folder / "monday").mkdir()
    for name, trace in (("monday/1.csv", "healthy"), ("monday/2.csv", "internal"), ("tuesday.csv", "external_a")):
        (folder / name).write_bytes(gzip.decompress((traces / f"{trace}.csv.gz").read_bytes()))
    for blade, trace in (("B1", "healthy"), ("B2", "internal"), ("B3", "external_a")):
        (folder / f"farm/T7/{blade}").mkdir(parents=True)
        shutil.copy(traces / "rig.toml", folder / f"farm/T7/{blade}")
        rows = gzip.decompress((traces / f"{trace}.csv.gz").read_bytes()).splitlines(keepends=True)
        for number, date in enumerate(("05-01", "05-15", "06-01")):
            # Each day a little shorter: of copies only one would count.
            day = gzip.compress(b"".join(rows[: len(rows) - 100 * number]))
            (folder / f"farm/T7/{blade}/2026-{date}.csv.gz").write_bytes(day)
    tools = folder / ".tools"
    tools.mkdir()
    for name, script in (("cargo", CARGO), ("pip", "#!/bin/sh\n")):
        (tools / name).write_text(script)
        (tools / name).chmod(0o755)
    path = [str(tools), str(ROOT / "target/release"), os.path.dirname(sys.executable), os.environ["PATH"]]
    return os.environ | {"PATH": os.pathsep.join(path), "MPLBACKEND": "Agg"}


def run(command: list[str], folder: Path, env: dict[str, str]) -> tuple[bool, str]:
    done = subprocess.run(command, cwd=folder, env=env, text=True, stdout=-1, stderr=subprocess.STDOUT, stdin=-3)
    return done.returncode == 0, done.stdout


def lacking(expected: str, printed: str) -> list[str]:
    """Lines that were not printed; runs of spaces count as one."""
    squeezed = [" ".join(line.split()) for line in printed.splitlines()]
    wanted = [" ".join(line.split()) for line in expected.splitlines() if line.strip()]
    patterns = {line: re.compile(".*".join(map(re.escape, line.split("…")))) for line in wanted}
    return [line for line in wanted if not any(patterns[line].fullmatch(one) for one in squeezed)]


def faults(page: Path) -> tuple[int, list[str]]:
    """How many blocks were run, and what is wrong."""
    name = page.relative_to(ROOT)
    found = [f"{name}: a command in an indented block: {line.strip()}" for line in COMMAND.findall(page.read_text())]
    ran, printed, script = 0, "", []
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        env = workplace(folder)
        for block in blocks(page):
            where = f"{name}:{block.line}"
            if block.skip:
                continue
            if block.language == "sh":
                script_text = f"set -euo pipefail\n{block.first}\n{block.body}"
                fine, printed = run(["bash", "-c", script_text], folder, env | {"HOME": made})
                found += [] if fine else [f"{where} fails:\n{printed}"]
                ran += 1
            elif block.language == "python":
                script.append(f"{block.first}\n{block.body}\n")
                ran += 1
            elif block.language == "toml":
                if not block.detail:
                    found.append(f"{where}: say which file it is")
                else:
                    (folder / block.detail).write_text(block.body)
            elif block.detail == "output":
                found += [f"{where}: not printed: {line}" for line in lacking(block.body, printed)]
        if script:
            (folder / "blocks.py").write_text("\n".join(script))
            fine, printed = run([sys.executable, "blocks.py"], folder, env)
            found += [] if fine else [f"{name}, its Python blocks in a row:\n{printed}"]
    return ran, found


def main() -> int:
    chosen = [Path(page).resolve() for page in sys.argv[1:]] or pages()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        results = list(pool.map(faults, chosen))
    for _, wrong in results:
        print("".join(f"{one}\n" for one in wrong), end="")
    wrong = sum(len(wrong) for _, wrong in results)
    print(f"{sum(ran for ran, _ in results)} blocks of {len(chosen)} pages run, {wrong} faults")
    return min(wrong, 1)


sys.exit(main())
