"""Lines that break where a trace pauses."""

from typing import Any

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]

#: A step so many times the usual one is a pause, as for the engine (src/trace/clock.rs).
_PAUSE = 5.0


def broken(t_s: Any, *columns: Any) -> tuple[_Floats, ...]:
    """Times and columns with a NaN wherever the trace pauses; where time goes back, it counts on."""
    t = np.asarray(t_s, np.float64)
    steps = np.diff(t)
    back = steps < 0.0
    t = t + np.concatenate([[0.0], np.cumsum(np.where(back, t[:-1] - t[1:], 0.0))]) if back.any() else t
    rising = steps[steps > 0.0]
    usual = np.median(rising) if rising.size else np.inf
    at = np.flatnonzero(back | (steps > _PAUSE * usual)) + 1
    return tuple(np.insert(np.asarray(column, np.float64), at, np.nan) for column in (t, *columns))


def people_time(t_s: _Floats) -> tuple[float, str]:
    """The unit that people would take for these times: how many seconds it has, and its name."""
    span = float(np.nanmax(t_s) - np.nanmin(t_s)) if t_s.size else 0.0
    units = ((3 * 86400.0, 86400.0, "days"), (3 * 3600.0, 3600.0, "h"), (600.0, 60.0, "min"))
    return next(((unit, name) for least, unit, name in units if span > least), (1.0, "s"))
