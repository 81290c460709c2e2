"""What replay and estimator find: the fields of ``pitchleak replay --json``."""

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Literal, TypeVar

from . import _html
from ._picture import axes_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes

T = TypeVar("T")
U = TypeVar("U")

Leak = Literal["internal", "external_a", "external_b"]
Status = Literal["leak", "sound", "doubtful", "not_sure"]

#: 1 m³/(s·Pa) in L/min/bar.
LPM_PER_BAR = 6e9


@dataclass(frozen=True, slots=True)
class PerLeak(Generic[T]):
    """One thing for each way that oil can leak."""

    internal: T
    """Past the piston seal, chamber A to chamber B."""
    external_a: T
    """Out of chamber A."""
    external_b: T
    """Out of chamber B."""

    def __getitem__(self, leak: Leak) -> T:
        """What is known of this leak: ``found.leakage["internal"]`` is ``found.leakage.internal``."""
        if leak not in ("internal", "external_a", "external_b"):
            raise KeyError(f"{leak!r} is no leak: internal, external_a or external_b")
        value: T = getattr(self, leak)
        return value

    def items(self) -> Iterator[tuple[Leak, T]]:
        """Names and values."""
        yield "internal", self.internal
        yield "external_a", self.external_a
        yield "external_b", self.external_b


@dataclass(frozen=True, slots=True)
class Trace:
    """What was read."""

    path: str
    """As given; ``data`` for columns in memory."""
    samples: int
    """Good rows."""
    skipped: int
    """Bad rows."""
    duration_s: float
    """From the first to the last good row, s."""
    sample_rate_hz: float | None
    """Samples per second where they come regularly."""
    begins: str | None = None
    """What the clock of the time stamps shows where the trace's seconds begin, ISO 8601; None without such stamps."""
    gaps: int = 0
    """Pauses much longer than the usual step."""
    warnings: tuple[str, ...] = ()
    """What to know of the data before believing the results."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One parameter at the end of the trace."""

    value: float | None
    """Best value, in ``unit``."""
    std: float | None
    """Standard deviation of its error; None where the estimator gives none."""
    ci95: tuple[float | None, ...] | None
    """The interval that holds the true value with 95 % probability; None for an open end."""
    unit: str
    """SI."""
    identifiable: bool
    """Whether this trace pins the parameter down."""
    reason: str | None = None
    """Why it does not."""


@dataclass(frozen=True, slots=True)
class Estimates:
    """The parameters of eq. (1)."""

    internal_leak_coefficient: Estimate
    """C_ip, m³/(s·Pa)."""
    external_leak_a_coefficient: Estimate
    """C_epA, m³/(s·Pa)."""
    external_leak_b_coefficient: Estimate
    """C_epB, m³/(s·Pa)."""
    bulk_modulus: Estimate
    """β, Pa."""

    @property
    def leaks(self) -> PerLeak[Estimate]:
        """The coefficients by leak."""
        return PerLeak(
            self.internal_leak_coefficient, self.external_leak_a_coefficient, self.external_leak_b_coefficient
        )


@dataclass(frozen=True, slots=True)
class Leakage:
    """Mean flow of one leak."""

    mean_lpm: float | None
    """Mean size, whichever way the pressure drives it, L/min."""
    std_lpm: float | None
    """Standard deviation of its error, L/min; None where the estimator gives none."""
    net_mean_lpm: float | None = None
    """Mean with its sign, positive out of the chamber that leaks, L/min."""
    since: str | None = None
    """The flow is what leaks more than on this day, when the valve was calibrated; None where it is absolute."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """An alarm raised or cleared."""

    time_s: float
    """Time in the trace, s."""
    fault: Leak
    """Which leak."""
    state: Literal["raised", "cleared"]
    """What happened."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why a verdict is in doubt or not sure."""

    id: str
    """What kind: ``model_does_not_fit``, ``channel_stuck``, ``wiring``, … (docs/verdict.md lists them)."""
    text: str
    """What was seen."""
    suggestion: str | None
    """What to check, or to record."""
    sensors: tuple[str, ...] = ()
    """Signals that it speaks against, as in the column headers: ``("qa", "qb")``."""


@dataclass(frozen=True, slots=True)
class Explained:
    """An explanation of a trace, and how probable it is."""

    id: str
    """Ids of what it is made of, joined by ``+``; :func:`explanations` lists them."""
    probability: float
    """Posterior probability."""
    text: str
    """In words, leaks first."""
    leakage: PerLeak[float]
    """Mean leaks under it, L/min."""
    sensors: tuple[str, ...] = ()
    """Signals whose sensors err where it is true."""
    remedy: str | None = None
    """What to do about it."""
    columns: tuple[str, ...] = ()
    """Lines for ``[columns]`` or the rig file that mend it."""
    cannot_be_told_from: tuple[str, ...] = ()
    """Ids that no trace of these readings tells it from."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What an operator acts on."""

    status: Status
    """``leak`` and ``sound`` are statements that the data support. ``doubtful``: something contradicts the model or the
    sensors; ``not_sure``: the trace says too little."""
    faults: tuple[Leak, ...]
    """The leaks whose alarm stands at the end of the trace, and those that come and go."""
    text: str
    """In a few sentences."""
    reasons: tuple[Reason, ...] = ()
    """Why the status is ``doubtful`` or ``not_sure``, first things first; empty where it is sure."""
    probability: PerLeak[float] | None = None
    """That each leak is above its alarm's threshold now; None where there is too little to weigh."""
    explanations: tuple[Explained, ...] = ()
    """What explains the trace, best first, down to 1 %."""

    @property
    def sure(self) -> bool:
        """Whether the verdict commits itself."""
        return self.status in ("leak", "sound")

    @property
    def word(self) -> str:
        """The word that heads the text: LEAK, SOUND, DOUBTFUL, NOT SURE."""
        return self.status.replace("_", " ").upper()

    def __str__(self) -> str:
        return f"{self.word}  {self.text}"

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws how probable each explanation is, the best on top (needs matplotlib). Returns the axes."""
        best = self.explanations[:8]
        axes = axes_for(ax, 0.8 + 0.4 * max(len(best), 1))
        axes.barh([textwrap.fill(one.text, 60) for one in best], [100 * one.probability for one in best])
        axes.invert_yaxis()
        axes.set_xlim(0, 100)
        axes.set_xlabel("probability, %")
        return axes

    def _repr_html_(self) -> str:
        reasons = _html.table(("why", "check"), [(reason.text, reason.suggestion or "") for reason in self.reasons])
        weighed = _html.table(
            ("probability", "explanation"),
            [(f"{one.probability:.0%}", one.text) for one in self.explanations],
        )
        parts = [*([reasons] if self.reasons else []), *([weighed] if self.explanations else [])]
        return _html.page(str(self), *parts)


@dataclass(frozen=True, slots=True)
class ReachTime:
    """A time to come."""

    value: float
    """Best value, s."""
    ci95: tuple[float, ...]
    """The interval that holds it with 95 % probability, s."""


@dataclass(frozen=True, slots=True)
class Slope:
    """Part of a trend."""

    slope_lpm_per_h: float
    """L/min per hour, positive where it grows."""
    std: float
    """Standard deviation of its error, L/min per hour."""


@dataclass(frozen=True, slots=True)
class OilShare:
    """A trend in two parts."""

    with_viscosity: Slope
    """What a leak of this size through a narrow gap gains as the oil thins."""
    beyond_viscosity: Slope
    """What is left: the seal's, or the connector's."""


@dataclass(frozen=True, slots=True)
class Trend:
    """How fast a leak changes."""

    slope_lpm_per_h: float
    """L/min per hour, positive where it grows."""
    std: float
    """Standard deviation of its error, L/min per hour."""
    reaches_threshold_in_s: ReachTime | None
    """Time from the trace's end until the leak is at its alarm's threshold if it goes on like this; None where it is
    there already, or does not grow beyond doubt."""
    oil: OilShare | None = None
    """The part that follows the oil's viscosity, and the rest; None without readings of the oil's temperature."""


@dataclass(frozen=True, slots=True)
class Episode:
    """A time in which a leak's alarm stood."""

    fault: Leak
    """Which leak."""
    from_s: float
    """When its alarm was raised, s."""
    to_s: float | None
    """When it was cleared, s; None where it stands at the end."""
    mean_lpm: float
    """Mean of the estimates meanwhile, L/min."""
    peak_lpm: float
    """Largest of them, L/min."""


@dataclass(frozen=True, slots=True)
class Spell:
    """Episodes of one leak that follow one another closely (pauses below a twenty-fourth of the trace), told as one."""

    fault: Leak
    """Which leak."""
    from_s: float
    """When the first alarm was raised, s."""
    to_s: float | None
    """When the last one was cleared, s; None where it stands at the end."""
    times: int
    """How many episodes."""
    stood_s: float
    """How long an alarm stood, all of them together, s."""
    mean_lpm: float
    """Mean of the estimates while one stood, L/min."""
    peak_lpm: float
    """Largest of them, L/min."""


@dataclass(frozen=True, slots=True)
class FoundLeak:
    """One leak in a hold test, or by a valve's flows, as a mean over the usable time."""

    probability: float
    """Probability that there is such a leak at all."""
    ci95_lpm: tuple[float, ...]
    """The interval that holds its flow with 95 % where there is one, L/min."""
    smallest_lpm: float
    """The smallest flow that this trace would find, L/min."""
    pressure_bar: float
    """Mean pressure that drives it, bar."""


@dataclass(frozen=True, slots=True)
class Hold:
    """How much of a trace was a hold test: rows whose ``shut`` is 1."""

    usable_s: float
    """Usable time of all holds together, s."""
    ended_by: str
    """What ended the longest: ``trace``, ``pressure`` (5 bar), ``motion`` (2 mm), ``opened`` or ``enough``."""
    holds: int
    """How many there are."""
    leaks: PerLeak[FoundLeak] | None = None
    """Each leak; None where nothing was usable."""


@dataclass(frozen=True, slots=True)
class Since:
    """Which calibration of the valve leaks are told against."""

    date: str
    """Its day."""
    leaks: str
    """``zero``: leaks are absolute; ``unknown``: external ones are what leaks more than then."""
    has_evidence: bool
    """Whether a hold test showed that nothing leaked; else that was assumed."""


@dataclass(frozen=True, slots=True)
class Valve:
    """Where there are no flow meters: what the valve's flows are worth."""

    usable_s: float
    """Time since the leaks changed, s."""
    spool_range: tuple[float, ...]
    """Least and greatest position of the spool, shares of its stroke."""
    clearance_lpm: tuple[float, ...]
    """What the clearances A-T and B-T may leak by the data sheet, 1 σ, L/min."""
    scatter: float
    """What the readings scatter, in the declared noise's standard deviations."""
    void_s: float | None = None
    """So long a chamber was below the atmosphere, s: left out; None where none was."""
    unread: str | None = None
    """The chamber pressure that is not measured, ``pa`` or ``pb``: of the leak at its chamber nothing is told."""
    calibrated: Since | None = None
    """The calibration; None where all rests on the data sheet."""
    leaks: PerLeak[FoundLeak] | None = None
    """Each leak; None where the trace does not tell of leaks."""


@dataclass(frozen=True, slots=True)
class Score:
    """One leak against its reference flow in steady state, eq. (15) and (16)."""

    leakage_mean_error_percent: float | None
    """Mean of |Q̂ − Q_ref| / |Q_ref|, %."""
    leakage_peak_error_percent: float | None
    """Peak of the same, %."""
    coefficient_mean_error_percent: float | None
    """Mean error of the coefficient, %."""
    coefficient_peak_error_percent: float | None
    """Peak of the same, %."""
    convergence_time_s: float | None
    """Time until the leakage error stays within 5 %, s; None if it never does."""
