"""Simulate: what the sensors of a rig with known leaks would have recorded."""

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from . import _arguments, _html, _inputs, _pitchleak
from ._gaps import broken
from ._picture import figure_for, legend_beside
from ._pitchleak import Rig
from ._progress import Progress, shown
from ._raw import Raw
from ._records import record
from ._results import PerLeak
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class LeakTruth:
    """One leak of a simulated trace."""

    coefficient_m3spa: float
    """Laminar coefficient, m³/(s·Pa)."""
    mean_flow_lpm: float
    """Mean size of its flow, L/min."""
    course: dict[str, Any] = field(default_factory=dict)
    """How much of it is there at a time: ``kind`` (steady, during, ramp, pulsed) with its times, s, and shares."""


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Raw, Tabular):
    """A simulated trace and what is true of it. As a table: the trace."""

    reference: str
    """What the rig followed."""
    rig: str
    """Name of the rig."""
    duration_s: float
    """Length, s."""
    sample_rate_hz: float
    """Samples per second."""
    samples: int
    """Number of rows."""
    seed: int
    """Seed of noise and offsets."""
    leaks: PerLeak[LeakTruth]
    """The true leaks."""
    effects: dict[str, float]
    """Effects beyond the model, SI, by id."""
    noise_std: dict[str, float]
    """Standard deviation of the sensors' noise, SI."""
    biases: dict[str, float]
    """Constant offsets of the sensors, SI."""
    sensor_faults: tuple[str, ...] = ()
    """Mistakes of the sensors, as given, in the order in which they happen."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of the truth file of ``pitchleak simulate``."""
    columns: Mapping[str, Any] = field(init=False, default_factory=dict)
    """The trace as numpy arrays by header, ready for :func:`replay`; empty where it went into a file."""

    @property
    def table(self) -> Mapping[str, Any]:
        """The same as ``columns``."""
        return self.columns

    def plot(self, figure: "Figure | None" = None) -> "Figure":
        """Draws position, pressures and flows over time (needs matplotlib)."""
        figure = figure_for(figure, 6.0)
        rows = (("x_mm",), ("pa_bar", "pb_bar"), ("qa_lpm", "qb_lpm"))
        axes = figure.subplots(len(rows), 1, sharex=True)
        for ax, names in zip(axes, rows, strict=True):
            for name in names:
                ax.plot(*broken(self.columns["t_s"], self.columns[name]), linewidth=0.9, label=name)
            legend_beside(ax)
        axes[-1].set_xlabel("time, s")
        return figure

    def __repr__(self) -> str:
        size = f"{self.samples} samples, {self.duration_s:.1f} s"
        flows = ", ".join(f"{leak} {truth.mean_flow_lpm:.3g}" for leak, truth in self.leaks.items())
        return f"<Simulation of rig {self.rig}, {self.reference} ({size}), leaks in L/min: {flows}>"

    def _repr_html_(self) -> str:
        rows = [(leak, f"{t.mean_flow_lpm:.4g}", f"{t.coefficient_m3spa:.4g}") for leak, t in self.leaks.items()]
        return _html.page(repr(self)[1:-1], _html.table(("leak", "L/min", "m³/(s·Pa)"), rows))


def simulate(
    wind: int | str | None = None,
    rig: Rig | _inputs.Path | None = None,
    *,
    position: float | str | None = None,
    load: float | str | None = None,
    leak_internal: float | str = 0.0,
    leak_external_a: float | str = 0.0,
    leak_external_b: float | str = 0.0,
    onset: float | str = 0.0,
    oil_temp: float | str | None = None,
    shut: str | None = None,
    valve: Sequence[str] = (),
    effects: Mapping[str, float] | None = None,
    noise: float | str = "none",
    bias: float | str = 0.0,
    faults: Sequence[str] = (),
    seed: int = 1,
    duration: float | str | None = None,
    start: float | str | None = None,
    sample_rate: float | str = 100.0,
    load_scale: float | None = None,
    position_scale: float | None = None,
    blade_inertia: float | None = None,
    out: _inputs.Path | None = None,
    progress: Progress = True,
) -> Simulation:
    """Simulates a rig with known leaks, sampled as its sensors would.

    A quantity is a number in SI or a text with its unit (``"0.5 L/min"``, ``"1 %"``). The rig follows
    ``wind`` (5, 13, 21 or 30 m/s, built in; OpenFAST output; CSV) or ``position`` and ``load`` (a constant
    or a CSV file). A leak is its mean flow, or its coefficient (``"0.02 L/min/bar"``), and opens at
    ``onset`` (s into the trace; 0: before it begins); it may grow (``"0.1 L/min -> 0.5 L/min @ 10 s..300 s"``),
    begin or end (``"0.5 L/min @ ..200 s"``), come and go (``"0.5 L/min every 60 s for 10 s"``). ``oil_temp``
    (K, ``"45 °C"``, ``"20 °C -> 60 °C @ 0 s..600 s"`` or a CSV file) makes the leaks, which have their size at
    40 °C, follow the oil's viscosity. ``shut`` (``"5 s..15 s"``) shuts both ports: a hold test. A rig with
    ``[valve]`` records its spool and supply instead of flows; ``valve`` are its flaws
    (``"clearance=0.05 L/min"``). ``effects`` are
    sizes by id in SI. ``noise`` is 3 σ of every sensor as a share of full scale, ``"none"`` or ``"rig"``; ``bias``
    the greatest constant offset. ``faults`` are mistakes of the sensors (``"qa dead"``, ``"pa offset 10 bar"``,
    ``"qa drift 1 %/h"``, ``"swap qa qb"``, ``"t in ms"``, …: see
    ``pitchleak simulate --help``). ``out`` writes the trace (.csv, .csv.gz) and the truth beside it (.json)
    instead of keeping it. ``progress`` is True (a bar where tqdm is installed and somebody watches), False, or a
    function of the share that is done and 1.

    Raises ``ValueError`` naming the argument.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(position="100 mm", load="2 kN", leak_internal="0.3 L/min", duration=2)
    >>> trace.samples, list(trace.columns)[:4]
    (200, ['t_s', 'x_mm', 'pa_bar', 'pb_bar'])
    """
    order = {
        "wind": None if wind is None else _wind(wind),
        "position": _given("position", position, "100 mm", or_file=True),
        "load": _given("load", load, "2 kN", or_file=True),
        "leak_internal": _leak("leak_internal", leak_internal),
        "leak_external_a": _leak("leak_external_a", leak_external_a),
        "leak_external_b": _leak("leak_external_b", leak_external_b),
        "onset": _arguments.quantity("onset", onset, "20 s"),
        "oil_temp": _given("oil_temp", oil_temp, "45 °C", or_file=True),
        "shut": None if shut is None else _arguments.word("shut", shut, "a text such as '5 s..15 s'"),
        "valve": _arguments.words("valve", valve, "clearance=0.05 L/min"),
        "effects": _sizes({} if effects is None else effects),
        "noise": _share("noise", noise),
        "bias": _share("bias", bias),
        "faults": _arguments.words("faults", faults, "qa dead"),
        "seed": _arguments.count("seed", seed, 0),
        "duration": _given("duration", duration, "60 s"),
        "start": _given("start", start, "10 s"),
        "sample_rate": _arguments.quantity("sample_rate", sample_rate, "100 Hz"),
        "load_scale": _factor("load_scale", load_scale),
        "position_scale": _factor("position_scale", position_scale),
        "blade_inertia": _factor("blade_inertia", blade_inertia),
    }
    path = None if out is None else _arguments.path("out", out)
    with shown(progress, "") as at:
        truth, warnings, columns = _pitchleak.simulate(order, _inputs.rig_for(None, rig), path, at)
    _inputs.warn(warnings)
    raw = json.loads(truth)
    result = record(Simulation, raw)
    object.__setattr__(result, "raw", raw)
    object.__setattr__(result, "columns", dict(columns))
    return result


def _wind(value: Any) -> str:
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    speed = _arguments.number("wind", value, "5, 13, 21 or 30 (m/s), or a path")
    return f"{speed:g}"


def _given(name: str, value: Any, example: str, or_file: bool = False) -> float | str | None:
    """A quantity that may be left out; where it may be a file, the engine tells a number without a unit."""
    if value is None or (or_file and isinstance(value, str)):
        return value
    return _arguments.quantity(name, value, example)


def _leak(name: str, value: Any) -> float | str:
    return _arguments.flow(name, value, "0.5 L/min")


def _share(name: str, value: Any) -> float | str:
    """The engine tells a share that is none."""
    if isinstance(value, str):
        return value
    return _arguments.number(name, value, "a share of full scale, such as '1 %'")


def _factor(name: str, value: Any) -> float | None:
    return None if value is None else _arguments.number(name, value)


def _sizes(effects: Any) -> dict[str, float]:
    given = _arguments.entries("effects", effects, "{'viscous_friction': 3000.0}")
    return {name: _arguments.number(f"effects: {name}", size, "its size in SI") for name, size in given.items()}
