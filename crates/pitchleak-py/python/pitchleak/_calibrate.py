"""A valve's calibration."""

import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from . import _arguments, _inputs, _pitchleak
from ._inputs import Columns
from ._pitchleak import Rig


@dataclass(frozen=True, slots=True)
class Calibration:
    """What traces of a rig say of its valve."""

    date: str
    """When it was made."""
    leaks: str
    """What was known of the leaks then: ``zero`` or ``unknown``."""
    seconds: float
    """Time in the traces, s."""
    spool_range: tuple[float, float]
    """Least and greatest position of the spool, shares of its stroke."""
    scatter: float
    """What the readings scatter, in the declared noise's standard deviations."""
    raw: dict[str, Any] = field(repr=False)
    """Every field of the file."""
    _toml: str = field(repr=False)
    _text: str = field(repr=False)

    def save(self, path: _inputs.Path) -> None:
        """Writes the file that ``[valve] calibration`` names."""
        with open(os.fspath(path), "w", encoding="utf-8") as file:
            file.write(self._toml)

    def __str__(self) -> str:
        return self._text


def calibrate(
    traces: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    leaks: str,
    evidence: Any = None,
    columns: Columns | None = None,
) -> Calibration:
    """Learns the valve of a cylinder without flow meters from one trace or several of it.

    ``leaks`` says what leaked meanwhile: after ``"zero"`` leaks are absolute, after ``"unknown"`` external ones are
    changes since. ``evidence`` is a hold test that finds none, for ``"zero"``, which without it is an assumption.
    A file that is given twice is read once, with a :class:`TraceWarning`.

    Raises ``ValueError`` where the rig has no ``[valve]``, or the traces say nothing of it.
    """
    leaks = _arguments.word("leaks", leaks, "zero or unknown")
    many: Sequence[Any] = traces if isinstance(traces, (list, tuple)) else [traces]
    if not many:
        raise ValueError("traces: give one at least")
    found = _inputs.rig_for(many[0], rig, columns)
    hold = None if evidence is None else _inputs.source(evidence, found)
    text, shown, warnings = _pitchleak.calibrate([_inputs.source(one, found) for one in many], found, leaks, hold)
    _inputs.warn(warnings)
    raw = tomllib.loads(text)
    low, high = raw["spool_range"]
    return Calibration(raw["date"], raw["leaks"], raw["seconds"], (low, high), raw["scatter"], raw, text, shown)
