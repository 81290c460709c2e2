"""Every path of this repository that a Markdown file names must exist; CHANGELOG.md may speak of what was.

A path is text in backquotes whose first folder stands at the top of the repository, or which ends in .rs (the end of a
path is enough then), or the target of a link. It counts from the top, or from the file's own folder.
"""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).parent.parent
TOPS = {path.name for path in ROOT.iterdir()}
FILES = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
QUOTED = re.compile(r"`([\w.-]+(?:/[\w.*-]+)*/?)`")
LINKED = re.compile(r"\]\((?!\w+:|#)([^)#\s]+)")


def exists(path, folder):
    if "/" in path and path.split("/")[0] in TOPS:
        return any(ROOT.glob(path)) or any(folder.glob(path))
    return not path.endswith(".rs") or any(f"/{file}".endswith(f"/{path}") for file in FILES)


def missing(document):
    text = document.read_text()
    yield from (path for path in QUOTED.findall(text) if not exists(path, document.parent))
    yield from (path for path in LINKED.findall(text) if not (document.parent / path).exists())


documents = [ROOT / file for file in FILES if file.endswith(".md") and file != "CHANGELOG.md"]
lost = [f"{document.relative_to(ROOT)} names {path}" for document in documents for path in missing(document)]
sys.exit("\n".join(lost) or 0)
