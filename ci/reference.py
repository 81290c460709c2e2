"""Reference that is made from the code when the book is built: commands, their JSON, and the thresholds."""

import json
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


def shortened(value: object) -> object:
    """Long lists and tables by their first entry, numbers by four digits: enough to see what is where."""
    if isinstance(value, dict):
        entries = list(value.items())
        is_table = len(entries) > 12 and all(isinstance(one, dict) for one in value.values())
        shown = {key: shortened(one) for key, one in (entries[:1] if is_table else entries)}
        return shown | ({"…": "…"} if is_table else {})
    if isinstance(value, list):
        shown = [shortened(one) for one in value[:2]]
        return shown if len(value) < 3 else [*shown[:1], "…"]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def laid_out(value: object, indent: str = "") -> str:
    """A line for whatever fits into one."""
    line = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(line) <= 110 or not isinstance(value, (dict, list)):
        return line
    within = indent + "  "
    if isinstance(value, list):
        return "[\n" + ",\n".join(within + laid_out(one, within) for one in value) + f"\n{indent}]"
    entries = (f"{within}{json.dumps(key)}: {laid_out(one, within)}" for key, one in value.items())
    return "{\n" + ",\n".join(entries) + f"\n{indent}}}"


def json_output() -> str:
    """What `--json` of each command prints for one trace, shortened."""
    sections = []
    for command in ("replay", "check", "diagnose", "fleet"):
        run = [PROGRAM, command, "data/traces/both.csv.gz", "--json"]
        printed = subprocess.run(run, cwd=ROOT, check=True, capture_output=True, text=True).stdout
        sections.append(f"## {command}\n\n```json\n{laid_out(shortened(json.loads(printed)))}\n```\n")
    return "\n".join(sections)
