"""Builds the documentation site of docs/ into target/book/html and checks it.

    python ci/book.py      # needs mdbook (ci/requirements.txt), target/release/pitchleak and examples/gallery there

The chapters are those of docs/SUMMARY.md; the gallery of effects gets a page for each entry of the table of effects,
commands, JSON and thresholds get theirs from the code (`reference.py`).
A file of the repository that a chapter links to comes along. Exit status 1 if a link, an anchor or a file is missing,
if a page would ask the network for anything, if a browser complains of one, or if axe-core finds a serious barrier.
"""

import html
import html.parser
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote, urlsplit

import reference

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
BOOK = ROOT / "target/book"
SOURCE = BOOK / "src"
LINK = re.compile(r"(\]\()(?!\w+:|#)([^)#\s]+)")
EQUATION = re.compile(r"^```math\n(.*?)\n```$", re.DOTALL | re.MULTILINE)
GALLERY = "- [Gallery of effects](gallery.md)\n"
AUDIT = """
addEventListener("load", () => axe.run(document, { preload: false, resultTypes: ["violations"] }).then((found) => {
  for (const { help, impact, nodes } of found.violations)
    if (impact === "serious" || impact === "critical") console.error(`${document.title}: ${help}: ${nodes[0].html}`);
}));
"""


def place(path: Path) -> Path:
    """Where a file of the repository stands in the book; mdBook makes a page of the chapters' list itself."""
    if path == DOCS / "SUMMARY.md":
        return SOURCE / "toc.html"
    if path.is_relative_to(DOCS):
        return SOURCE / path.relative_to(DOCS)
    return SOURCE / path.name if path.parent == ROOT and path.suffix == ".md" else SOURCE / path.relative_to(ROOT)


def chapters() -> list[Path]:
    summary = (DOCS / "SUMMARY.md").read_text()
    return [DOCS / "SUMMARY.md", *((DOCS / link).resolve() for _, link in LINK.findall(summary))]


def equation(block: re.Match[str]) -> str:
    """For KaTeX alone: the highlighter of code complains of a language that it doesn't know."""
    return f'<pre class="equation">{html.escape(block[1])}</pre>'


def assemble() -> None:
    """The book's sources: its settings, the chapters with their links turned, whatever those link to."""
    shutil.rmtree(BOOK, ignore_errors=True)
    shutil.copytree(DOCS / "book", BOOK)
    shutil.copytree(DOCS / "book/katex/fonts", SOURCE / "katex/fonts")
    for chapter in chapters():
        to = SOURCE / "SUMMARY.md" if chapter.name == "SUMMARY.md" else place(chapter)
        to.parent.mkdir(parents=True, exist_ok=True)

        def turned(link: re.Match[str], chapter: Path = chapter, here: Path = to.parent) -> str:
            target = (chapter.parent / link[2]).resolve()
            there = place(target)
            if target.is_file() and target.suffix != ".md":
                there.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(target, there)
            return link[1] + os.path.relpath(there, here)

        to.write_text(EQUATION.sub(equation, LINK.sub(turned, chapter.read_text())))


def gallery() -> None:
    """A page for each effect, below the gallery's own."""
    made = subprocess.run(
        [ROOT / "target/release/examples/gallery", SOURCE / "gallery"], check=True, capture_output=True, text=True
    )
    pages = [line.split("\t") for line in made.stdout.splitlines()]
    with (SOURCE / "gallery.md").open("a") as chapter:
        chapter.write("| effect | cause |\n|---|---|\n")
        chapter.writelines(f"| [{title}](gallery/{page}) | {cause} |\n" for page, title, cause in pages)
    summary = SOURCE / "SUMMARY.md"
    below = "".join(f"  - [{title}](gallery/{page})\n" for page, title, _ in pages)
    text = summary.read_text()
    if GALLERY not in text:
        sys.exit("docs/SUMMARY.md has no gallery")
    summary.write_text(text.replace(GALLERY, GALLERY + below))


def generated() -> None:
    """What is made from the code, below the chapters' own words."""
    made = {"commands": reference.commands, "json": reference.json_output, "thresholds": reference.thresholds}
    for name, make in made.items():
        with (SOURCE / f"{name}.md").open("a") as chapter:
            chapter.write(f"\n{make()}")


class Page(html.parser.HTMLParser):
    """Links, what is loaded, and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors.add(values.get("id") or "")
        if tag == "a" and values.get("href"):
            self.links.append(values["href"] or "")
        elif tag == "link" or values.get("src"):
            self.loaded.append(values.get("src") or values.get("href") or "")


def faults(pages: dict[Path, Page]) -> list[str]:
    found = []
    for path, page in pages.items():
        name = path.relative_to(BOOK / "html")
        found += [f"{name} loads {url} from the network" for url in page.loaded if urlsplit(url).netloc]
        for url in (*page.links, *page.loaded):
            to = urlsplit(url)
            if to.scheme or to.netloc:
                continue
            target = (path.parent / unquote(to.path)).resolve() if to.path else path
            if not target.exists():
                found.append(f"{name} links to {url}, which is not there")
            elif to.fragment and target in pages and unquote(to.fragment) not in pages[target].anchors:
                found.append(f"{name} links to {url}, where no such anchor is")
    return found


def audited(pages: dict[Path, Page]) -> list[Path]:
    """Copies, beside them, of the chapters and of one effect's page, which say what axe-core finds serious."""
    package = importlib.util.find_spec("axe_playwright_python")
    if not package or not package.submodule_search_locations:
        print("not looked through by axe-core: axe-playwright-python is not installed")
        return []
    axe = Path(package.submodule_search_locations[0], "axe.min.js").as_uri()
    script = f'<script src="{axe}"></script><script>{AUDIT}</script></body>'
    effects = [path for path in pages if path.parent.name == "gallery"]
    copies = []
    for path in pages.keys() - effects[1:]:
        copies.append(path.with_name(f"audited-{path.name}"))
        copies[-1].write_text(path.read_text().replace("</body>", script))
    return copies


def complaints(pages: dict[Path, Page]) -> list[str]:
    """What a browser without a network says of the pages: equations that it can't draw, files that lack, barriers."""
    if not shutil.which("chromium"):
        print("not opened in a browser: chromium is not installed")
        return []
    copies = audited(pages)
    with tempfile.TemporaryDirectory() as made:
        frames = Path(made) / "frames.html"
        frames.write_text("".join(f'<iframe src="{path.as_uri()}"></iframe>' for path in [*pages, *copies]))
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--dump-dom"]
        options += ["--virtual-time-budget=60000"]
        alone = ["--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={made}/profile", frames.as_uri()]
        seen = subprocess.run(["chromium", *options, *alone], capture_output=True, text=True, timeout=300)
    for path in copies:
        path.unlink()
    return [line for line in seen.stderr.splitlines() if "CONSOLE" in line]


assemble()
gallery()
generated()
subprocess.run(["mdbook", "build", BOOK], check=True)
built = {path: Page(path) for path in (BOOK / "html").rglob("*.html") if path.name not in ("toc.html", "404.html")}
print(f"{len(built)} pages in {BOOK.relative_to(ROOT)}/html")
sys.exit("\n".join(faults(built) + complaints(built)) or 0)
