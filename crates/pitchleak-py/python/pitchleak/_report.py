"""The report on a trace, as ``pitchleak replay --json`` prints it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from . import _html
from ._picture import axes_for, legend_beside
from ._raw import Raw
from ._records import record
from ._results import (
    LPM_PER_BAR,
    Alarm,
    Episode,
    Estimates,
    Hold,
    Leakage,
    PerLeak,
    Score,
    Spell,
    Trace,
    Trend,
    Valve,
    Verdict,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

R = TypeVar("R", bound="Report")

LABELS = {"internal": "internal", "external_a": "external A", "external_b": "external B"}


@dataclass(frozen=True, eq=False, repr=False)
class Report(Raw):
    """What is known of the leaks of one cylinder at the end of its trace."""

    trace: Trace
    """What was read."""
    rig: str
    """Path of the rig file, or ``wu2011``, the built-in one."""
    estimator: str
    """``rls`` or ``paper``."""
    estimates: Estimates
    """Parameters of eq. (1) with intervals."""
    leakage: PerLeak[Leakage]
    """Mean leak flows, L/min."""
    verdict: Verdict
    """What to make of it."""
    trend: PerLeak[Trend | None]
    """How fast each leak changes; None where the data don't tell."""
    episodes: tuple[Episode, ...] = ()
    """Every leak that the trace showed, also those that ended before its end."""
    spells: tuple[Spell, ...] = ()
    """The same in short: episodes of a leak that follow one another closely are one."""
    alarms: tuple[Alarm, ...] = ()
    """In the order of time."""
    score: PerLeak[Score] | None = None
    """Against reference leak flows, where the trace has them; None for a leak without one."""
    flow_meter_offsets: dict[str, Leakage] | None = None
    """Offsets of the meters ``a`` and ``b``, where the rig file says that they may be off, L/min."""
    normalised_innovation: tuple[float, ...] | None = None
    """About 1 each where model and declared noise explain the trace, far above where they do not."""
    hold: Hold | None = None
    """Of a hold test: how much of it was usable; leakages are means over that."""
    valve: Valve | None = None
    """Where the valve's flows stood for meters: what they are worth."""
    changed_at_s: float | None = None
    """When a leak last changed suddenly, s; flows are means since then."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of the JSON."""
    _text: str = field(init=False, default="")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws the leak flows with their 95 % intervals (needs matplotlib). Returns the axes."""
        return draw_flows({self.trace.path: self.leakage}, ax)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Report) and self.raw == other.raw

    __hash__ = None  # type: ignore[assignment]

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        trace = self.trace
        size = f"{trace.samples} samples, {trace.duration_s:.1f} s"
        return f"<{type(self).__name__} {trace.path} ({size}): {self.verdict}>"

    def _repr_html_(self) -> str:
        coefficients = dict(self.estimates.leaks.items())
        rows = []
        for leak, flow in self.leakage.items():
            entry = coefficients[leak]
            scaled = [None if v is None else v * LPM_PER_BAR for v in (entry.value, entry.std)]
            judged = "yes" if entry.identifiable else f"no: {entry.reason or 'too little excitation'}"
            known = (_html.number(flow.mean_lpm, flow.std_lpm), _html.number(*scaled))
            rows.append((LABELS[leak], *(known if entry.identifiable else ("–", "–")), judged))
        headers = ("leak", "L/min, 95 %", "L/min/bar, 95 %", "identifiable")
        trace = self.trace
        footer = (
            f"{trace.path}: {trace.samples} samples over {trace.duration_s:.1f} s, {trace.skipped} rows skipped; "
            f"rig {self.rig}; estimator {self.estimator}"
        )
        table = _html.table(headers, rows)
        reasons = [(reason.text, reason.suggestion or "") for reason in self.verdict.reasons]
        why = [_html.table(("why", "check"), reasons)] if reasons else []
        return _html.page(str(self.verdict), *why, table, footer=footer)


def parse(cls: type[R], text_json: str, text: str) -> R:
    """A report from the engine's JSON and its text for people."""
    raw = json.loads(text_json)
    report = record(cls, raw)
    object.__setattr__(report, "raw", raw)
    object.__setattr__(report, "_text", text)
    return report


def draw_flows(leakages: Mapping[str, PerLeak[Leakage]], ax: "Axes | None") -> "Axes":
    """Draws leak flows of cylinders by their names."""
    axes = axes_for(ax)
    for shift, (leak, label) in zip((-0.15, 0.0, 0.15), LABELS.items(), strict=True):
        flows = [getattr(leakage, leak) for leakage in leakages.values()]
        mean = np.array([flow.mean_lpm for flow in flows], np.float64)
        half = np.nan_to_num(1.96 * np.array([flow.std_lpm for flow in flows], np.float64))
        axes.errorbar(np.arange(len(flows)) + shift, mean, half, fmt="o", markersize=4, linewidth=1, label=label)
    axes.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
    axes.set_xticks(range(len(leakages)), list(leakages), rotation=30 if len(leakages) > 4 else 0)
    axes.set_xlim(-0.6, max(len(leakages), 1) - 0.4)
    axes.set_ylabel("leak flow, L/min")
    legend_beside(axes, "leak, 95 %")
    return axes
