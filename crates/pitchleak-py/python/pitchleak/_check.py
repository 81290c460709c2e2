"""Check: what a trace is worth before anybody believes its leaks."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from . import _arguments, _html, _inputs, _pitchleak
from ._page import Paged, same
from ._picture import axes_for
from ._pitchleak import Rig
from ._raw import Raw
from ._records import record
from ._report import LABELS
from ._results import Hold, PerLeak, Trace, Valve
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True)
class Reading:
    """What one signal did, in SI."""

    signal: str
    """Name as in the column headers."""
    unit: str
    """SI unit."""
    least: float
    """Lowest reading."""
    most: float
    """Highest reading."""
    present_percent: float
    """Share of the rows that have it, %."""


@dataclass(frozen=True, slots=True)
class Reach:
    """How well the trace pins one parameter down."""

    identifiable: bool
    """Whether it does."""
    resolution: float | None
    """Half width of the 95 % interval: L/min for a leak, Pa for the bulk modulus."""
    reason: str | None = None
    """Why it does not."""


@dataclass(frozen=True, slots=True)
class ChannelFault:
    """A fault that a channel shows by itself."""

    channel: str
    """Name of the signal, as in the column headers."""
    id: str
    """``channel_dead``, ``channel_stuck``, ``channel_clipped``, ``channel_held`` or ``channel_coarse``."""
    from_s: float
    """When it begins, s."""
    to_s: float
    """When it ends, s."""
    text: str
    """What was seen."""
    suggestion: str
    """What to check."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """A mistake of wiring, sign or unit that explains what the columns as declared do not."""

    suggestion: str
    """The mistake and its evidence, in one sentence."""
    residual_before: float | None
    """Size of the residual, in standard deviations of the declared noise, as the columns are declared; None where the
    scatter of the readings alone speaks."""
    residual_after: float | None
    """The same with the mistake mended."""
    columns: tuple[str, ...] = ()
    """Lines for ``[columns]`` of the rig file that mend it; none where the recording has to be mended, or the rig."""
    cylinder: tuple[str, ...] = ()
    """Lines for its ``[cylinder]`` that do."""
    alternatives: tuple[str, ...] = ()
    """Mistakes that explain the trace as well."""


@dataclass(frozen=True, eq=False, repr=False)
class Check(Raw, Paged, Tabular):
    """Data quality, excitation, what the trace can and cannot identify. As a table: the signals."""

    trace: Trace
    """What was read."""
    rig: str
    """Path of the rig file, or ``wu2011``."""
    readings: tuple[Reading, ...]
    """What each signal did."""
    leaks: PerLeak[Reach]
    """What the trace tells about each leak."""
    bulk_modulus: Reach
    """What it tells about the bulk modulus."""
    normalised_innovation: tuple[float, ...] | None = None
    """About 1 each where model and declared noise explain the trace, far above where they do not."""
    hold: Hold | None = None
    """Of a hold test: how much of it is usable, and the smallest leaks that it finds."""
    valve: Valve | None = None
    """Where the valve's flows stood for meters: what they are worth."""
    channels: tuple[ChannelFault, ...] = ()
    """Channels that are dead, stuck, clipped, held or coarse."""
    wiring: Wiring | None = None
    """The mistake of wiring that explains the trace, if there is one."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of ``pitchleak check --json``."""
    _text: str = field(init=False, default="")
    _json: str = field(init=False, default="")
    _again: tuple[_inputs.Source, Rig, bool] = field(init=False)

    def to_html(self) -> str:
        return same(_pitchleak.check_page(*self._again), self._json)

    def _read(self) -> Sequence[str]:
        source, rig, _ = self._again
        return _inputs.files(rig, source)

    @property
    def table(self) -> Mapping[str, Any]:
        """A row per signal."""
        names = ("signal", "unit", "least", "most", "present_percent")
        return {name: [getattr(reading, name) for reading in self.readings] for name in names}

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws how small a leak the trace shows, hatched where it doesn't pin the leak down (needs matplotlib).

        Returns the axes.
        """
        axes = axes_for(ax, 2.5)
        for leak, reach in self.leaks.items():
            if reach.resolution is None:
                axes.barh(LABELS[leak], 0.0)
            else:
                axes.barh(LABELS[leak], reach.resolution, hatch=None if reach.identifiable else "//")
        axes.invert_yaxis()
        axes.set_xlabel("half of the 95 % interval, L/min")
        return axes

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        found = [LABELS[leak] for leak, reach in self.leaks.items() if reach.identifiable]
        return f"<Check of {self.trace.path}: identifiable leaks: {', '.join(found) or 'none'}>"

    def _repr_html_(self) -> str:
        headers = ("signal", "from", "to", "rows")
        signals = [
            (f"{r.signal}, {r.unit}", f"{r.least:.4g}", f"{r.most:.4g}", f"{r.present_percent:.0f} %")
            for r in self.readings
        ]
        reach = [
            (LABELS[leak], f"± {r.resolution:.4f} L/min" if r.resolution is not None else "–", r.reason or "yes")
            for leak, r in self.leaks.items()
        ]
        shown = _html.table(("leak", "this trace shows it to (95 %)", "identifiable"), reach)
        return _html.page(repr(self)[1:-1], _html.table(headers, signals), shown)


def check(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    columns: _inputs.Columns | None = None,
    strict: bool = False,
) -> Check:
    """Checks a trace: data quality, excitation, what it can and cannot identify.

    Takes what :func:`replay` takes, and raises what it raises.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(wind=13, duration=20)
    >>> pl.check(trace.columns).leaks.external_a.identifiable
    True
    """
    strict = _arguments.flag("strict", strict)
    rig = _inputs.rig_for(data, rig, columns)
    source = _inputs.source(data, rig)
    report, text = _pitchleak.check(source, rig, strict)
    raw = json.loads(report)
    result = record(Check, raw)
    filled = {"raw": raw, "_text": text, "_json": report, "_again": (source, rig, strict)}
    for name, value in filled.items():
        object.__setattr__(result, name, value)
    _inputs.warn(result.trace.warnings)
    return result
