"""Prove: a known leak put into a trace of one's own."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeAlias

from . import _arguments, _html, _inputs, _pitchleak
from ._page import Paged
from ._picture import axes_for, legend_beside
from ._pitchleak import Rig
from ._raw import Raw
from ._records import record
from ._report import LABELS
from ._results import Leak, Leakage, PerLeak, Status, Trace, Verdict
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: One mean flow or several: numbers in SI, or texts with their unit.
_Sizes: TypeAlias = float | str | Sequence[float | str]


@dataclass(frozen=True, slots=True)
class PutIn:
    """One leak that was put in, alone."""

    leak: Leak
    """Which."""
    put_in_lpm: float
    """Its mean size, L/min."""
    found: bool
    """Whether the verdict names it."""
    status: Status
    """The verdict's status with it."""
    found_lpm: float
    """What is found beyond what the trace had, L/min."""
    std_lpm: float | None
    """Standard deviation of what is found, L/min."""
    bound_std_lpm: float | None
    """The least that any method could have with these meters, L/min."""
    alarm_after_s: float | None
    """From its onset to its alarm, s."""
    bound_after_s: float | None
    """The earliest that any method could be as sure, s."""
    wrongly_named: tuple[Leak, ...] = ()
    """Leaks named that are neither in the trace nor put in."""


@dataclass(frozen=True, slots=True)
class LeastLeak:
    """The least leak that is found."""

    lpm: float | None
    """L/min; None where none is."""
    bound_lpm: float | None
    """The least that any method could be sure of on average over noise, L/min; this trace's own may be kinder."""
    reason: str | None = None
    """Why none can be put in."""


@dataclass(frozen=True, eq=False, repr=False)
class Proof(Raw, Paged, Tabular):
    """What a trace proves of the verdicts on it. As a table: a row per leak that was put in."""

    trace: Trace
    """What was read."""
    rig: str
    """Path of the rig file, or ``wu2011``."""
    verdict: Verdict
    """Of the trace as it was recorded."""
    leakage: PerLeak[Leakage]
    """Its leaks as it was recorded."""
    onset_s: float
    """From here on the leaks are put in, s."""
    cases: tuple[PutIn, ...]
    """Each leak that was put in."""
    found_from: PerLeak[LeastLeak]
    """How small a leak of each kind is found."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of ``pitchleak prove --json``."""
    _text: str = field(init=False, default="")
    _html: str = field(init=False, default="")
    _files: Sequence[str] = field(init=False, default=())

    @property
    def proven(self) -> bool:
        """Whether each leak that was put in was found, and no other."""
        return bool(self.cases) and all(case.found and not case.wrongly_named for case in self.cases)

    def to_html(self) -> str:
        return self._html

    def _read(self) -> Sequence[str]:
        return self._files

    @property
    def table(self) -> Mapping[str, Any]:
        """A row per leak that was put in."""
        names = ("leak", "put_in_lpm", "found", "status", "found_lpm", "std_lpm", "alarm_after_s", "bound_after_s")
        return {name: [getattr(case, name) for case in self.cases] for name in names}

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws what is found of each leak against what was put in, with 95 % intervals (needs matplotlib). Returns the
        axes."""
        axes = axes_for(ax)
        most = max((case.put_in_lpm for case in self.cases), default=1.0)
        axes.plot([0.0, most], [0.0, most], color="0.7", linewidth=0.8, zorder=0)
        for shift, (leak, label) in zip((-0.01, 0.0, 0.01), LABELS.items(), strict=True):
            cases = [case for case in self.cases if case.leak == leak]
            if not cases:
                continue
            half = [1.96 * (case.std_lpm or 0.0) for case in cases]
            flows = [case.found_lpm for case in cases]
            axes.errorbar(
                [case.put_in_lpm + shift * most for case in cases], flows, half, fmt="o", markersize=4, label=label
            )
        axes.set_xlabel("put in, L/min")
        axes.set_ylabel("found, L/min")
        legend_beside(axes, "leak, 95 %")
        return axes

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        found = sum(case.found for case in self.cases)
        return f"<Proof on {self.trace.path}: {found} of {len(self.cases)} leaks that were put in are found>"

    def _repr_html_(self) -> str:
        rows = []
        for case in self.cases:
            after = "–" if case.alarm_after_s is None else f"{case.alarm_after_s:.1f} s"
            flow = _html.number(case.found_lpm, case.std_lpm)
            rows.append((LABELS[case.leak], f"{case.put_in_lpm:.3g}", "yes" if case.found else "no", flow, after))
        headers = ("leak", "put in, L/min", "found", "found, L/min, 95 %", "alarm after")
        return _html.page(repr(self)[1:-1], _html.table(headers, rows))


def prove(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    leak_internal: _Sizes = (),
    leak_external_a: _Sizes = (),
    leak_external_b: _Sizes = (),
    columns: _inputs.Columns | None = None,
    strict: bool = False,
) -> Proof:
    """Puts known leaks into a trace, one at a time: is each found, at its size, how soon, and from which size on?

    A leak is its mean flow, a text with its unit (``"0.3 L/min"``) or m³/s, or several of them; where none is given,
    each kind is put in at twice and five times its alarm's threshold. Takes what :func:`replay` takes as ``data``, and
    raises what it raises; ``ValueError`` where the trace has no flow meters.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(wind=13, duration=30, noise="0.3 %")
    >>> pl.prove(trace.columns, leak_internal="0.5 L/min").proven
    True
    """
    given = {"leak_internal": leak_internal, "leak_external_a": leak_external_a, "leak_external_b": leak_external_b}
    sizes = [_flows(name, flows) for name, flows in given.items()]
    strict = _arguments.flag("strict", strict)
    rig = _inputs.rig_for(data, rig, columns)
    source = _inputs.source(data, rig)
    text_json, text, html = _pitchleak.prove(source, rig, strict, sizes)
    raw = json.loads(text_json)
    proof = record(Proof, raw)
    filled = {"raw": raw, "_text": text, "_html": html, "_files": _inputs.files(rig, source)}
    for name, value in filled.items():
        object.__setattr__(proof, name, value)
    _inputs.warn(proof.trace.warnings)
    return proof


def _flows(name: str, given: Any) -> list[float | str]:
    many = given if isinstance(given, (list, tuple)) else [given]
    return [_arguments.flow(name, one, "0.3 L/min") for one in many]
