"""How many mutants the tests catch: a sample, all written into one copy of the sources, so that one build is enough.

    cargo install --locked cargo-mutants
    python3 ci/mutants/run.py 200 crates/pitchleak-core/src -- -p pitchleak-core
    python3 ci/mutants/run.py 30 crates/pitchleak-trace/src -- -p pitchleak-trace

SAMPLE FOLDER -- arguments of `cargo test`. cargo-mutants lists what could be changed, in a sample by seed 9; a copy in
target/mutants chooses one by the variable MUTANT. A mutant that doesn't compile doesn't count; one that hangs is
caught. Ends with the survivors and their share. Not part of .ci/run.
"""

import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).parent.parent.parent
WORK = ROOT / "target" / "mutants"
COPY = WORK / "copy"
# A mutant of these kinds can be chosen at run time; deleted fields and match arms, 1.5 % of all, cannot.
GENRES = {"BinaryOperator", "FnValue", "MatchArmGuard", "UnaryOperator"}
CHOOSE = """
#[doc(hidden)]
#[allow(missing_docs)]
pub fn mutant(id: u32) -> bool {
    extern crate std;
    static CHOSEN: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    *CHOSEN.get_or_init(|| std::env::var("MUTANT").ok().and_then(|id| id.parse().ok()).unwrap_or(0)) == id
}
"""


def sample(count, folder):
    named = re.match(r"crates/([\w-]+)/", folder)
    package = named[1] if named else "pitchleak"
    command = ["cargo", "mutants", "--list", "--json", "--package", package]
    listed = json.loads(subprocess.run(command, cwd=ROOT, capture_output=True, check=True).stdout)
    fitting = [entry for entry in listed if entry["file"].startswith(folder) and entry["genre"] in GENRES]
    chosen = random.Random(9).sample(fitting, min(count, len(fitting)))
    return [{**entry, "id": number} for number, entry in enumerate(chosen, 1)]


def copy_sources():
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, tracked.split("\0")):
        if (ROOT / name).exists():
            (COPY / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, COPY / name)


def write(mutants):
    """Makes the copy anew with these mutants in it; those that found no place are left out."""
    copy_sources()
    (WORK / "list.json").write_text(json.dumps(mutants))
    tool = ["cargo", "run", "--locked", "--quiet", "--manifest-path", ROOT / "ci/mutants/Cargo.toml", "--"]
    placeless = subprocess.run([*tool, COPY, WORK / "list.json"], capture_output=True, text=True, check=True).stdout
    for library in (
        "crates/pitchleak-core/src/lib.rs",
        "crates/pitchleak-trace/src/lib.rs",
        "crates/pitchleak-view/src/lib.rs",
        "src/lib.rs",
    ):
        with (COPY / library).open("a") as file:
            file.write(CHOOSE)
    return [entry for entry in mutants if str(entry["id"]) not in placeless.split()]


def blamed(message):
    """The mutants in whose code a compiler's error lies; where there is none, the last that is written above it."""
    for span in message["spans"]:
        if span["is_primary"]:
            lines = (COPY / span["file_name"]).read_text().splitlines()[: span["line_start"]]
            line = lines.pop()
            before = re.findall(r"mutant\((\d+)\)", line[: span["column_start"]])
            found = before[-1:] or re.findall(r"mutant\((\d+)\)", line)
            yield from map(int, found or re.findall(r"mutant\((\d+)\)", "\n".join(lines))[-1:])


def build(arguments):
    """Test programs with the folder to run them in, and the mutants that don't compile."""
    # Tests want release; whole-crate units take long to build.
    settings = {"CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16", "RUSTFLAGS": "--cap-lints allow"}
    settings["CARGO_TARGET_DIR"] = os.environ.get("CARGO_TARGET_DIR", str(WORK / "build"))
    command = ["cargo", "test", "--locked", "--release", "--no-run", "--message-format=json", *arguments]
    built = subprocess.run(command, cwd=COPY, env={**os.environ, **settings}, stdout=subprocess.PIPE, text=True)
    messages = [json.loads(line) for line in built.stdout.splitlines()]
    errors = [m["message"] for m in messages if m["reason"] == "compiler-message" and m["message"]["level"] == "error"]
    broken = {number for error in errors for number in blamed(error)}
    if built.returncode and not broken:
        sys.exit("\n".join(error["rendered"] for error in errors) or "cargo test --no-run failed")
    programs = [(m["executable"], pathlib.Path(m["manifest_path"]).parent) for m in messages if m.get("executable")]
    return programs, broken


def passes(program, folder, number, limit_s):
    environment = {**os.environ, "MUTANT": str(number), "CARGO_MANIFEST_DIR": str(folder)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        return subprocess.run([program], cwd=folder, env=environment, timeout=limit_s, **quiet).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def timed(program, folder):
    start = time.monotonic()
    if not passes(program, folder, 0, None):
        sys.exit(f"{program} fails without a mutant")
    return time.monotonic() - start


def main(count, folder, _, *arguments):
    shutil.rmtree(COPY, ignore_errors=True)
    mutants, broken = sample(int(count), folder), {0}
    sampled = len(mutants)
    while broken:
        mutants = write([entry for entry in mutants if entry["id"] not in broken])
        programs, broken = build(arguments)
    quickest_first = sorted((timed(*program), program) for program in programs)
    survivors = []
    for entry in mutants:
        if all(passes(*program, entry["id"], 60 + 5 * needed_s) for needed_s, program in quickest_first):
            survivors.append(entry)
            print("survives:", entry["name"], flush=True)
    caught = len(mutants) - len(survivors)
    print(f"{caught} of {len(mutants)} caught, {caught / len(mutants):.0%}; {sampled - len(mutants)} don't compile")


if __name__ == "__main__":
    if len(sys.argv) < 4 or sys.argv[3] != "--":
        sys.exit(__doc__)
    main(*sys.argv[1:])
