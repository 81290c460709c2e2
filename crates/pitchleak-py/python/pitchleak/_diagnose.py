"""Diagnose: from the residual of the model to the effect that it lacks."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from . import _arguments, _html, _inputs, _pitchleak
from ._check import Wiring
from ._gaps import broken, people_time
from ._page import Paged
from ._picture import figure_for, legend_beside
from ._pitchleak import Rig
from ._progress import Progress, shown
from ._raw import Raw
from ._records import record
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: People's unit in SI and the name of each balance.
_BALANCES = {"chamber_a_m3s": (60e3, "A, L/min"), "chamber_b_m3s": (60e3, "B, L/min"), "force_n": (1.0, "force, N")}


@dataclass(frozen=True, slots=True)
class Rmse:
    """Held-out error of each balance; None where the traces lack it."""

    chamber_a_m3s: float | None
    """Continuity of chamber A, m³/s."""
    chamber_b_m3s: float | None
    """Continuity of chamber B, m³/s."""
    force_n: float | None
    """Force balance, N."""


@dataclass(frozen=True, slots=True)
class Quality:
    """How well a model fits."""

    rmse: Rmse
    """On samples that were not fitted."""
    whiteness_p: dict[str, float | None]
    """Probability per equation that the residual is white noise."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """A reason not to believe an effect's name or its value."""

    id: str
    """Which: ``rivals``, ``unlisted_law``, ``residual``, ``negative_leak``, …"""
    text: str
    """In a sentence."""


@dataclass(frozen=True, slots=True)
class Effect:
    """An effect that the declared model lacks."""

    id: str
    """Name as in the table of effects."""
    value: float
    """Its size, in ``unit``."""
    std: float
    """Standard deviation of it."""
    unit: str
    """SI; 1 for a share."""
    confident: bool = False
    """Whether the name can be believed."""
    doubt: str | None = None
    """The first of ``doubts`` in a sentence."""
    doubts: tuple[Doubt, ...] = ()
    """Why not, the reason that says most first."""
    probability: float | None = None
    """Probability of the name among all that could stand in its place."""
    rmse_reduction_percent: float | None = None
    """By how much the held-out error of the balance it mends most falls, %."""
    p_value: float | None = None
    """Chance of so large a score without the effect."""
    confusable_with: tuple[str, ...] = ()
    """Effects that these traces cannot tell from it."""
    separated_by: str | None = None
    """What would tell them apart."""
    cause: str = ""
    """When this is the cause."""
    remedy: str = ""
    """What to do about it."""
    shape: dict[str, float] = field(default_factory=dict)
    """Constants in which the effect is not linear, as fitted."""


@dataclass(frozen=True, slots=True)
class NextMeasurement:
    """The one measurement that would settle most."""

    measurement: str
    """What to do."""
    between: tuple[str, ...]
    """The two explanations that it parts."""
    probability: float
    """That it finds the first of them."""


@dataclass(frozen=True, slots=True)
class Interaction:
    """Two effects that act on each other."""

    effects: tuple[str, ...]
    """The two."""
    sigma: float
    """Score of the product of their terms, in standard deviations."""
    mended_percent: float
    """Share of the whitened sum of squares that it would mend, %."""


@dataclass(frozen=True, slots=True)
class Level:
    """A leak coefficient, m³/(s·Pa), with its standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True)
class LeakChange:
    """A leak that is another from a moment on: a part of the declared model, no effect."""

    fault: str
    """``internal``, ``external_a`` or ``external_b``."""
    trace: int
    """In which of the traces, from 0."""
    time_s: float
    """Since that began, s."""
    before: Level
    after: Level


@dataclass(frozen=True, slots=True)
class Calibration:
    """A sensor's error that the rig file declares possible, as these traces show it."""

    id: str
    """Name as in the table of effects."""
    value: float
    """Its size, in ``unit``."""
    std: float
    """Standard deviation of it."""
    unit: str
    """SI; 1 for a share."""


@dataclass(frozen=True, slots=True)
class HoldLeak:
    """Flow that leaves one chamber while the piston stands, and what motion predicts for it."""

    count: int
    """Holds of 1 s."""
    mean_pressure_pa: float
    """Mean pressure in them, Pa."""
    leak_m3s: float
    """Mean leak flow, m³/s."""
    std_m3s: float
    """Its standard deviation, m³/s."""
    predicted_before_m3s: float
    """The same flow from the declared model, fitted to what moves."""
    predicted_before_std_m3s: float
    """Its standard deviation, m³/s."""
    predicted_after_m3s: float
    """The same with the effects found."""
    predicted_after_std_m3s: float
    """Its standard deviation, m³/s."""


@dataclass(frozen=True, slots=True)
class Holds:
    """Leaks at rest against those found in motion; None for a chamber never held under pressure."""

    chamber_a: HoldLeak | None
    """Out of chamber A."""
    chamber_b: HoldLeak | None
    """Out of chamber B."""


@dataclass(frozen=True, slots=True)
class Samples:
    """How much of the traces was fitted: all, or pieces evenly over those that are too long."""

    read: int
    """Samples of the traces."""
    fitted: int
    """Those among them that were fitted."""


@dataclass(frozen=True, slots=True)
class LeakEstimate:
    """A constant of the declared model as fitted."""

    value: float | None
    """Best value, in ``unit``."""
    std: float | None
    """Standard deviation."""
    ci95: tuple[float | None, ...] | None
    """Holds the truth with 95 % probability."""
    unit: str
    """SI."""
    identifiable: bool
    """Whether these traces tell more than the rig file did."""
    physical: bool = True
    """Whether physics allows the value."""


@dataclass(frozen=True, slots=True)
class LeakEstimates:
    """The declared model's constants."""

    internal_leak_coefficient: LeakEstimate
    """C_ip, m³/(s·Pa)."""
    external_leak_a_coefficient: LeakEstimate
    """C_epA, m³/(s·Pa)."""
    external_leak_b_coefficient: LeakEstimate
    """C_epB, m³/(s·Pa)."""
    bulk_modulus: LeakEstimate
    """β, Pa."""


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """The same with the declared model alone and with the effects found."""

    before: LeakEstimates
    """Declared model."""
    after: LeakEstimates
    """With the effects."""


@dataclass(frozen=True, slots=True)
class Size:
    """A size with its unit."""

    value: float
    """In ``unit``."""
    unit: str
    """SI; 1 for a share."""


@dataclass(frozen=True, slots=True)
class Course:
    """What is left of one balance over time."""

    t_s: np.ndarray[Any, np.dtype[np.float64]]
    """Time, s."""
    residual: np.ndarray[Any, np.dtype[np.float64]]
    """What is left, in the balance's unit."""


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Raw, Paged, Tabular):
    """What a diagnosis found. As a table: the effects, strongest first."""

    before: Quality
    """Best fit of the declared model."""
    effects: tuple[Effect, ...]
    """Strongest first."""
    after: Quality
    """With the effects."""
    leaks: BeforeAfter
    """Leaks before and after."""
    not_detectable_below: dict[str, Size]
    """Smallest size of each further effect that these traces would have shown."""
    verdict: Literal["explained", "partly_explained", "no_missing_effect", "unexplained", "insufficient_excitation"]
    """The answer."""
    notes: tuple[str, ...] = ()
    """What speaks for it."""
    wiring: Wiring | None = None
    """The mistake of wiring, sign or unit that explains the traces; then no effect is worth looking for."""
    next_measurement: NextMeasurement | None = None
    """What to measure next; None where no effect has a rival."""
    interactions: tuple[Interaction, ...] = ()
    """Effects that act on each other."""
    leak_changes: tuple[LeakChange, ...] = ()
    """Where leaks change, if that explains the traces better than leaks that stay."""
    calibration: tuple[Calibration, ...] = ()
    """Offsets and gains that the rig file declares possible, as found with the effects."""
    holds: Holds | None = None
    """Leaks while the piston stands, against those found in motion; None without such holds."""
    samples: Samples | None = None
    """How much was fitted."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of ``pitchleak diagnose --json``."""
    rig: Rig = field(init=False)
    """The rig with the effects in it: what ``--save-rig`` writes."""
    residuals_before: dict[str, Course] = field(init=False, default_factory=dict)
    """The residual of the declared model: ``chamber_a_m3s``, ``chamber_b_m3s``, ``force_n``."""
    residuals_after: dict[str, Course] = field(init=False, default_factory=dict)
    """What is left with the effects."""
    _text: str = field(init=False, default="")
    _page: str = field(init=False, default="")
    _files: tuple[str, ...] = field(init=False, default=())

    def to_html(self) -> str:
        return self._page

    def _read(self) -> Sequence[str]:
        return self._files

    @property
    def table(self) -> Mapping[str, Any]:
        """A row per effect."""
        names = ("id", "value", "std", "unit", "confident", "rmse_reduction_percent", "p_value")
        columns: dict[str, Any] = {name: [getattr(e, name) for e in self.effects] for name in names}
        return columns | {"confusable_with": [", ".join(effect.confusable_with) for effect in self.effects]}

    def plot(self, figure: "Figure | None" = None) -> "Figure":
        """Draws the residual of each equation over time, before and after, one trace after the other.

        Needs matplotlib.
        """
        present = [name for name, course in self.residuals_before.items() if np.isfinite(course.residual).any()]
        figure = figure_for(figure, 2.2 * max(len(present), 1))
        axes: Any = figure.subplots(len(present), 1, sharex=True, squeeze=False)[:, 0] if present else []
        for ax, name in zip(axes, present, strict=True):
            factor, label = _BALANCES[name]
            for course, when in ((self.residuals_before[name], "before"), (self.residuals_after[name], "after")):
                t, residual = broken(course.t_s, factor * course.residual)
                second, unit = people_time(t)
                ax.plot(t / second, residual, linewidth=0.8, label=when)
            ax.set_ylabel(label)
        if present:
            legend_beside(axes[0], self.verdict.replace("_", " "))
            axes[-1].set_xlabel(f"time, {unit}")
        return figure

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        found = ", ".join(f"{e.id} {e.value:.4g} {e.unit}".rstrip() for e in self.effects)
        return f"<Diagnosis: {self.verdict}{': ' + found if found else ''}>"

    def _repr_html_(self) -> str:
        effects = [
            (e.id, f"{_html.number(e.value, e.std)} {e.unit}", ", ".join(e.confusable_with) or "–", e.cause)
            for e in self.effects
        ]
        errors = []
        for name, (factor, label) in _BALANCES.items():
            rmse = [getattr(quality.rmse, name) for quality in (self.before, self.after)]
            errors.append((label, *(_html.number(None if one is None else factor * one) for one in rmse)))
        return _html.page(
            self.verdict.replace("_", " "),
            _html.table(("effect", "size, 95 %", "not told from", "cause"), effects),
            _html.table(("held-out rms error", "before", "after"), errors),
            footer=" ".join(self.notes),
        )


def diagnose(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    test: Any = (),
    columns: _inputs.Columns | None = None,
    strict: bool = False,
    progress: Progress = True,
) -> Diagnosis:
    """Finds the physical effect that the model lacks.

    ``data`` is a trace as :func:`replay` takes it, or a list of traces of one rig that are fitted
    together; ``test`` are the traces to judge on, else blocks that each fit leaves out. A file that is in both is a
    ``ValueError``; one that is given twice is read once, with a :class:`TraceWarning`. ``columns`` names foreign
    columns as for :func:`replay`. ``progress`` is True (a count of fits where tqdm is installed and somebody watches),
    False, or a function of the fits done and NaN: nobody knows how many there will be.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(wind=13, effects={"viscous_friction": 3000.0}, noise="0.1 %", duration=60)
    >>> found = pl.diagnose(trace.columns, pl.Rig.paper().replace(accuracy="0.1 %"))
    >>> found.effects[0].id
    'viscous_friction'
    """
    strict = _arguments.flag("strict", strict)
    train = list(data) if isinstance(data, (list, tuple)) else [data]
    judged_on = list(test) if isinstance(test, (list, tuple)) else [test]
    if not train:
        raise ValueError("data: no trace to fit")
    rig = _inputs.rig_for(train[0], rig, columns)
    fitted = [_inputs.source(trace, rig) for trace in train]
    judged = [_inputs.source(trace, rig) for trace in judged_on]
    with shown(progress, " fits") as at:
        found = _pitchleak.diagnose(fitted, judged, rig, strict, at)
    report, text, page, found_rig, before, after, warnings = found
    _inputs.warn(warnings)
    raw = json.loads(report)
    result = record(Diagnosis, raw)
    courses = [
        {name: Course(np.asarray(t_s), np.asarray(left)) for name, t_s, left in residuals}
        for residuals in (before, after)
    ]
    filled = {"raw": raw, "rig": found_rig, "residuals_before": courses[0], "residuals_after": courses[1]}
    files = tuple(_inputs.files(rig, *fitted, *judged))
    for name, value in {**filled, "_text": text, "_page": page, "_files": files}.items():
        object.__setattr__(result, name, value)
    return result
