"""Results that make a page for a browser."""

import os
from collections.abc import Sequence

from . import _pitchleak
from ._inputs import Path


class Paged:
    """A result with a page: the one that the program writes with ``--report`` (docs/report.md)."""

    __slots__ = ()

    def to_html(self) -> str:
        """The page: complete in itself, for any browser, without a network."""
        raise NotImplementedError

    def report(self, path: Path) -> None:
        """Writes the page to ``path`` (``.html``), whole or not at all, and never over the data.

        Of a trace in memory or in a file the page is made by going through the same data again, which must not have
        changed in between.
        """
        _pitchleak.write_page(os.fspath(path), self.to_html(), self._read())

    def _read(self) -> Sequence[str]:
        """The files that the result rests on."""
        return ()


def same(page: tuple[str, str], report: str) -> str:
    """The page, where it is one of the same report."""
    if page[0] != report:
        raise RuntimeError("the data changed since: do it again")
    return page[1]
