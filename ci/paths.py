"""Every path of this repository that a Markdown file names must exist; CHANGELOG.md may speak of what was.

A path is text in backquotes whose first folder stands at the top of the repository, or the target of a link.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).parent.parent
TOPS = {path.name for path in ROOT.iterdir()}
QUOTED = re.compile(r"`([\w.-]+(?:/[\w.*-]+)+/?)`")
LINKED = re.compile(r"\]\((?!\w+:|#)([^)#\s]+)")


def missing(document):
    text = document.read_text()
    for path in QUOTED.findall(text):
        if path.split("/")[0] in TOPS and not any(ROOT.glob(path)):
            yield path
    for path in LINKED.findall(text):
        if not (document.parent / path).exists():
            yield path


documents = [path for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")) if path.name != "CHANGELOG.md"]
lost = [f"{document.relative_to(ROOT)} names {path}" for document in documents for path in missing(document)]
sys.exit("\n".join(lost) or 0)
