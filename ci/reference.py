"""Reference that is made from the code when the book is built: the help of each command, and the thresholds."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "target/release/pitchleak"
THRESHOLDS = ROOT / "src/diagnose/thresholds.rs"
CONSTANT = re.compile(r"((?:^/// .*\n)+)^pub\(crate\) const (\w+): [^=]+ = ([^;]+);", re.MULTILINE)
KIND = re.compile(r"\b(Derived|Sourced|Chosen)\b")


def commands() -> str:
    """A section for each command: what it says of itself."""

    def told(*command: str) -> str:
        return subprocess.run([PROGRAM, *command, "--help"], check=True, capture_output=True, text=True).stdout

    listed = told().split("Commands:\n")[1].split("\n\n")[0]
    names = [name for name in re.findall(r"^  (\w+)", listed, re.MULTILINE) if name != "help"]
    return "\n".join(f"## {name}\n\n```text\n{told(name)}```\n" for name in names)


def thresholds() -> str:
    """A table for each part of the diagnosis: name, value, kind, and the words of the code."""
    parts = re.split(r"^// (.+)\.\n", THRESHOLDS.read_text(), flags=re.MULTILINE)[1:]
    tables = []
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        rows = ["| name | value | | what |", "|---|---|---|---|"]
        for words, name, value in CONSTANT.findall(body):
            text = re.sub(r"\[?(`[A-Z_0-9]+`)\]?", r"\1", words.replace("\n/// ", " ")[4:].strip()).replace("|", "\\|")
            kind = KIND.search(text)
            rows.append(f"| `{name}` | {value} | {kind[1].lower() if kind else ''} | {text} |")
        tables.append(f"## {title}\n\n" + "\n".join(rows) + "\n")
    return "\n".join(tables)
