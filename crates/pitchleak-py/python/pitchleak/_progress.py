"""How far a long call is, for those who ask and those who watch."""

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

from . import _arguments

Progress: TypeAlias = bool | Callable[[float, float], Any]
"""True: a bar where tqdm is installed and somebody watches. False: silence. A function is called with what is done and
the whole, which is NaN where nobody knows it."""


@contextmanager
def shown(progress: Progress, unit: str) -> Iterator[Callable[[float, float], Any]]:
    """Gives a function of what is done and the whole."""
    if callable(progress):
        yield progress
        return
    bar = _bar(unit) if _arguments.flag("progress", progress, "True, False or a function") else None
    if bar is None:
        yield lambda done, whole: None
        return
    with bar:

        def move(done: float, whole: float) -> None:
            total = whole if whole == whole else None
            if total != bar.total or done < bar.n:
                bar.reset(total)
            bar.update(done - bar.n)

        yield move


def _bar(unit: str) -> Any:
    """None where tqdm is not installed; hidden by tqdm where standard error is no terminal."""
    try:
        tqdm = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    return tqdm(unit=unit, disable=None, leave=False)
