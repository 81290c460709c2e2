"""Work on all cores, which ends soon when nobody waits for it any more."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from ._pitchleak import Stop
from ._progress import Progress, shown

T = TypeVar("T")
R = TypeVar("R")


def on_all_cores(work: Callable[[T, Stop], R], items: Sequence[T], progress: Progress, unit: str) -> list[R]:
    """What ``work`` makes of each item, in their order. ``work`` has let go of the interpreter most of the time."""
    stop, done = Stop(), []
    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        futures = [pool.submit(work, item, stop) for item in items]
        with shown(progress, unit) as at:
            for future in futures:
                done.append(future.result())
                at(len(done), len(items))
    finally:
        # After an error or Ctrl-C nobody wants the rest.
        stop.set()
        pool.shutdown(cancel_futures=True)
    return done
