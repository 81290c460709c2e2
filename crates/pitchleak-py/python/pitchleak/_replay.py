"""Replay: a trace in, its leaks out."""

import json
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np

from . import _arguments, _html, _inputs, _pitchleak
from ._gaps import broken, people_time
from ._groups import split
from ._page import Paged, same
from ._parallel import on_all_cores
from ._picture import axes_for, legend_beside
from ._pitchleak import Rig, Stop
from ._progress import Progress
from ._report import LABELS, Report, draw_flows, parse
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_Columns: TypeAlias = list[tuple[str, Any]]


@dataclass(frozen=True, slots=True)
class _Again:
    """The same replay once more, with its estimates over time. Pickled, it takes columns in memory along."""

    source: _inputs.Source
    rig: Rig
    estimator: str | None
    strict: bool

    def __call__(self) -> tuple[str, _Columns]:
        return _pitchleak.over_time(self.source, self.rig, self.estimator, self.strict)

    def page(self) -> tuple[str, str]:
        return _pitchleak.replay_page(self.source, self.rig, self.estimator, self.strict)

    def files(self) -> list[str]:
        return _inputs.files(self.rig, self.source)


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Report, Paged, Tabular):
    """What a replay found. As a table: the estimates after each sample, with the columns of
    ``pitchleak replay --out``: coefficients in m³/(s·Pa), flows in L/min, alarms as booleans.

    The table is made when it is first asked for, by running the replay again over the same data, so that
    a replay itself needs no memory of its own. The data must not have changed in between.
    """

    _again: "_Again" = field(init=False, repr=False)

    @cached_property
    def table(self) -> Mapping[str, Any]:
        """The estimates after each sample, numpy arrays by column."""
        text, columns = self._again()
        if text != self._json:
            raise RuntimeError("the data changed since the replay: replay it again")
        return {name: values > 0.0 if name.endswith("_alarm") else values for name, values in columns}

    _json: str = field(init=False, repr=False, default="")

    def to_html(self) -> str:
        return same(self._again.page(), self._json)

    def _read(self) -> Sequence[str]:
        return self._again.files()

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws the leak flows over time with their 95 % intervals and alarms (needs matplotlib). Lines break where the
        trace pauses.

        The flows are the coefficients at the mean pressures of the trace, so that their course shows what
        is learnt and not how the pressures move. Returns the axes.
        """
        axes = axes_for(ax)
        table = self.table
        second, unit = people_time(table["t_s"])
        prefixes = {"internal": "internal", "external_a": "external_leak_a", "external_b": "external_leak_b"}
        for leak, flow in self.leakage.items():
            name = f"{prefixes[leak]}_leak_coefficient" if leak == "internal" else f"{prefixes[leak]}_coefficient"
            last = table[name][-1]
            scale = (flow.mean_lpm or 0.0) / last if last else 0.0
            t, mean, std = broken(table["t_s"] / second, table[name], table[f"{name}_std"])
            mean, half = mean * scale, 1.96 * std * abs(scale)
            (line,) = axes.plot(t, mean, label=LABELS[leak], linewidth=1.5)
            axes.fill_between(t, mean - half, mean + half, color=line.get_color(), alpha=0.2, linewidth=0)
            for alarm in self.alarms:
                if alarm.fault == leak:
                    style = "-" if alarm.state == "raised" else ":"
                    axes.axvline(alarm.time_s / second, color=line.get_color(), linestyle=style, linewidth=1)
        flows = [flow.mean_lpm or 0.0 for _, flow in self.leakage.items()]
        if len(table["t_s"]) > 1:
            span = max(max(flows) - min(flows), 0.1)
            axes.set_ylim(min(0.0, *flows) - 0.5 * span, max(0.0, *flows) + 0.5 * span)
        axes.set_xlabel(f"time, {unit}")
        axes.set_ylabel("leak flow, L/min")
        legend_beside(axes, "leak (line:\nalarm raised)" if self.alarms else "leak")
        return axes


class Replays(Mapping[Hashable, Replay], Tabular):
    """Replays of many cylinders, by their keys. As a table: a row per cylinder."""

    __slots__ = ("_replays",)

    def __init__(self, replays: Mapping[Hashable, Replay]) -> None:
        self._replays = dict(replays)

    def __getitem__(self, key: Hashable) -> Replay:
        return self._replays[key]

    def __iter__(self) -> Iterator[Hashable]:
        return iter(self._replays)

    def __len__(self) -> int:
        return len(self._replays)

    @property
    def table(self) -> Mapping[str, Any]:
        """A row per cylinder: verdict, mean leak flows and their standard deviations in L/min."""
        replays = self._replays.values()
        columns: dict[str, Any] = {
            "key": [str(key) for key in self._replays],
            "status": [replay.verdict.status for replay in replays],
            "reasons": [", ".join(reason.id for reason in replay.verdict.reasons) for replay in replays],
            "faults": [", ".join(replay.verdict.faults) for replay in replays],
            "samples": [replay.trace.samples for replay in replays],
            "skipped": [replay.trace.skipped for replay in replays],
        }
        for leak in LABELS:
            flows = [getattr(replay.leakage, leak) for replay in replays]
            columns[f"{leak}_lpm"] = np.array([flow.mean_lpm for flow in flows], np.float64)
            columns[f"{leak}_std_lpm"] = np.array([flow.std_lpm for flow in flows], np.float64)
        return columns

    def to_dict(self) -> dict[str, Any]:
        """The report of each cylinder, by its key as text."""
        return {str(key): replay.to_dict() for key, replay in self._replays.items()}

    def to_json(self) -> str:
        """The same as JSON."""
        return json.dumps(self.to_dict(), ensure_ascii=False)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws the leak flows of every cylinder with their 95 % intervals (needs matplotlib). Returns the axes."""
        return draw_flows({str(key): replay.leakage for key, replay in self._replays.items()}, ax)

    def __repr__(self) -> str:
        def named(*statuses: str) -> str:
            keys = [str(key) for key, replay in self._replays.items() if replay.verdict.status in statuses]
            return ", ".join(keys) or "none"

        doubt = named("doubtful", "not_sure")
        unsure = "" if doubt == "none" else f", in doubt {doubt}"
        return f"<Replays of {len(self)} cylinders, leaks in {named('leak')}{unsure}>"

    def _repr_html_(self) -> str:
        rows = []
        for key, replay in self._replays.items():
            flows = [_html.number(flow.mean_lpm, flow.std_lpm) for _, flow in replay.leakage.items()]
            rows.append((str(key), replay.verdict.word, ", ".join(replay.verdict.faults) or "–", *flows))
        headers = ("cylinder", "verdict", "leaks", *(f"{label}, L/min" for label in LABELS.values()))
        return _html.page(repr(self)[1:-1], _html.table(headers, rows))


@overload
def replay(
    data: list[Any] | tuple[Any, ...],
    rig: Rig | _inputs.Path | None = None,
    *,
    columns: _inputs.Columns | None = None,
    estimator: str | None = None,
    strict: bool = False,
    group: None = None,
    progress: Progress = True,
) -> Replays: ...
@overload
def replay(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    columns: _inputs.Columns | None = None,
    estimator: str | None = None,
    strict: bool = False,
    group: str,
    progress: Progress = True,
) -> Replays: ...
@overload
def replay(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    columns: _inputs.Columns | None = None,
    estimator: str | None = None,
    strict: bool = False,
    group: None = None,
    progress: Progress = True,
) -> Replay: ...
def replay(
    data: Any,
    rig: Rig | _inputs.Path | None = None,
    *,
    columns: _inputs.Columns | None = None,
    estimator: str | None = None,
    strict: bool = False,
    group: str | None = None,
    progress: Progress = True,
) -> Replay | Replays:
    """Estimates the leaks of a recorded trace.

    ``data`` is a pandas, polars or pyarrow table, anything with the Arrow PyCapsule interface, a dict of
    arrays, or the path of a trace file. Columns are named ``<signal>_<unit>`` as in trace files; float64
    ones are not copied. NaN is a missing reading. ``rig`` is a :class:`Rig` or the path of a rig file;
    left out, it is ``rig.toml`` beside a file, else the built-in one (``out.rig`` says which).
    ``columns`` names foreign columns by signal (``{"pa": "Head pressure [bar]"}``, or dicts with ``name``, ``unit``,
    ``scale``, ``offset``), over those of the rig. ``estimator`` is ``rls`` (both chamber equations,
    docs/estimators.md) or ``paper`` (the law of Wu et al. 2011, eq. 8 to 13). Bad rows are skipped and
    counted (:class:`TraceWarning`), or, where ``strict``, raise :class:`TraceError` with ``column`` and ``row``.
    Columns in memory whose rows are in no order of time raise it too.

    Many cylinders at once, on all cores: a list of such data, or the name of the column that tells them
    apart as ``group``; the result is then a :class:`Replays`. ``progress`` is True (a bar over the cylinders
    where tqdm is installed and somebody watches), False, or a function of the cylinders done and of all.

    >>> import pitchleak as pl
    >>> trace = pl.simulate(wind=13, leak_internal="0.5 L/min", duration=20)
    >>> out = pl.replay(trace.columns)
    >>> out.verdict.faults, round(out.leakage.internal.mean_lpm, 1)
    (('internal',), 0.5)
    >>> out.table["t_s"].shape
    (2000,)
    """
    if estimator is not None:
        estimator = _arguments.word("estimator", estimator, "rls or paper")
    strict = _arguments.flag("strict", strict)
    if group is not None:
        return _many(split(data, group), rig, columns, estimator, strict, progress)
    if isinstance(data, (list, tuple)):
        return _many(dict(enumerate(data)), rig, columns, estimator, strict, progress)
    out = _one(data, _inputs.rig_for(data, rig, columns), estimator, strict)
    _inputs.warn(out.trace.warnings)
    return out


def _one(data: Any, rig: Rig, estimator: str | None, strict: bool, stop: Stop | None = None) -> Replay:
    source = _inputs.source(data, rig)
    report, text = _pitchleak.replay(source, rig, estimator, strict, stop)
    out = parse(Replay, report, text)
    object.__setattr__(out, "_json", report)
    object.__setattr__(out, "_again", _Again(source, rig, estimator, strict))
    return out


def _many(
    traces: Mapping[Hashable, Any],
    rig: Rig | _inputs.Path | None,
    columns: _inputs.Columns | None,
    estimator: str | None,
    strict: bool,
    progress: Progress,
) -> Replays:
    rig = None if rig is None else _inputs.rig_for(None, rig)

    def work(item: tuple[Hashable, Any], stop: Stop) -> Replay:
        key, data = item
        try:
            return _one(data, _inputs.rig_for(data, rig, columns), estimator, strict, stop)
        except Exception as error:
            error.add_note(f"in cylinder {key!r}")
            raise

    replays = on_all_cores(work, list(traces.items()), progress, "cylinder")
    done = dict(zip(traces, replays, strict=True))
    for key, out in done.items():
        _inputs.warn(out.trace.warnings, str(key))
    return Replays(done)


__all__: Sequence[str] = ("Replay", "Replays", "replay")
