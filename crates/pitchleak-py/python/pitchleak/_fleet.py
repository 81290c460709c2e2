"""Fleet: many traces of many cylinders, judged wherever there are cores."""

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from . import _arguments, _html, _inputs, _pitchleak
from ._page import Paged
from ._parallel import on_all_cores
from ._picture import axes_for, legend_beside
from ._pitchleak import Rig, RigError, Stop, TraceError
from ._progress import Progress, shown
from ._records import record
from ._report import LABELS
from ._results import Leak, PerLeak, ReachTime, Status, Trend
from ._tabular import Tabular, optional

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow
    from matplotlib.axes import Axes

Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
Rigs: TypeAlias = Rig | _inputs.Path | Mapping[str, Rig | _inputs.Path]


@dataclass(frozen=True, slots=True)
class FleetLeak:
    """One leak of one cylinder in one trace."""

    mean_lpm: float | None
    """Mean size of its flow, L/min; of a leak that comes and goes, while it was last there."""
    std_lpm: float | None
    """Standard deviation of its error, L/min; None of one that comes and goes, and where the estimator gives none."""
    ci95: tuple[float | None, ...] | None
    """The interval that holds the flow with 95 % probability, L/min."""
    comes_and_goes: bool
    """Whether it is a leak to act on that is away at the trace's end."""
    threshold_lpm: float
    """The alarm's threshold, L/min."""
    identifiable: bool
    """Whether the trace pins it down."""
    trend: Trend | None
    """How fast it changes within the trace; None where the data don't tell."""


@dataclass(frozen=True, slots=True)
class FleetExplanation:
    """An explanation of a trace that is left."""

    id: str
    """What it is made of, ids of :func:`explanations` and leaks, joined by ``+``."""
    probability: float
    """Posterior probability."""


@dataclass(frozen=True, slots=True)
class FleetRow:
    """What is known of a cylinder from one trace, or why nothing is."""

    cylinder: str
    """Which cylinder."""
    path: str
    """The trace as it was named; ``data`` for columns in memory."""
    begins: str | None
    """When the trace begins, ISO 8601: by its time stamps, else by its name; None where neither says."""
    rig: str | None
    """Path of the rig file, or ``wu2011``; None where it can't be used."""
    status: Status | None
    """The verdict in a word; None where the trace could not be judged."""
    faults: tuple[Leak, ...]
    """Leaks to act on."""
    reasons: tuple[str, ...]
    """Ids of the reasons of a verdict in doubt, first things first."""
    explanations: tuple[FleetExplanation, ...]
    """What explains the trace, best first, down to 1 %."""
    odds: dict[str, float]
    """``[decision] odds`` that it was judged with."""
    leaks: PerLeak[FleetLeak] | None
    """Flows and their trends."""
    alarms: int
    """How often an alarm was raised."""
    samples: int
    """Good rows."""
    skipped: int
    """Bad rows."""
    gaps: int
    """Pauses."""
    duration_s: float | None
    """From the first to the last good row, s."""
    sample_rate_hz: float | None
    """Samples per second where they come regularly."""
    warnings: tuple[str, ...]
    """What to know of the data."""
    error: str | None
    """Why the trace could not be judged."""


@dataclass(frozen=True, slots=True)
class LongTrend:
    """A straight line through the flows of one leak over many traces."""

    traces: int
    """Traces that it rests on."""
    from_: str
    """Middle of the first trace, ISO 8601."""
    to: str
    """Middle of the last trace."""
    mean_lpm: float
    """The line's flow at the last trace, L/min."""
    std_lpm: float
    """Standard deviation of its error, L/min."""
    scatter_lpm: float
    """How much the flows scatter about the line beyond their own standard deviations, L/min."""
    slope_lpm_per_h: float
    """L/min per hour, positive where it grows."""
    std: float
    """Standard deviation of its error, L/min per hour."""
    reaches_threshold_in_s: ReachTime | None
    """Time from the last trace until the line is at the alarm's threshold; None where it is there already, or does not
    grow beyond doubt."""


@dataclass(frozen=True, slots=True)
class Beside:
    """How much more one leak of a cylinder is than those of its siblings (docs/fleet.md)."""

    siblings: int
    """How many siblings it is compared with."""
    more_lpm: float
    """How much more it leaks than they do in the mean, L/min; negative where it leaks less."""
    std_lpm: float
    """Standard deviation of that, L/min; 1.96 of them are the half of the 95 % interval."""
    p_value: float
    """How probable so large a difference is where there is none, times the number of comparisons."""
    differs: bool
    """Whether it leaks more than its siblings by more than chance explains."""


@dataclass(frozen=True, slots=True)
class CylinderLeak:
    """One leak of a cylinder, over its traces."""

    stands: bool
    """Whether it is a leak to act on that no later trace excluded."""
    since: str | None
    """Begin of the first trace that showed it, with none since that excluded it, ISO 8601."""
    other_until: str | None
    """Begin of the last trace before that excluded it."""
    flow: FleetLeak | None
    """Its flow: of a leak that stands in the last trace that shows it, of another in the last that pins it down."""
    trend: LongTrend | None
    """How it changes from trace to trace, and when it is at its threshold."""
    beside: Beside | None
    """How it differs from that of the cylinder's siblings; None without any, or without a second trace."""


@dataclass(frozen=True, slots=True)
class FleetCylinder:
    """What the traces of one cylinder say together (docs/fleet.md)."""

    cylinder: str
    """Its name."""
    status: Status | None
    """How it is now: a leak stands until a trace excludes it; None where no trace could be judged."""
    faults: tuple[Leak, ...]
    """Leaks to act on."""
    reasons: tuple[str, ...]
    """Ids of the reasons of a status in doubt, first things first."""
    since: str | None
    """Begin of the first trace of the unbroken run that the status lasts, ISO 8601; None without dates."""
    other_until: str | None
    """Begin of the last trace before that said otherwise; None where it was so from the first on."""
    latest: int | None
    """Place in :attr:`Fleet.rows` of the latest trace that could be judged."""
    traces: int
    """Number of its traces."""
    counts: dict[str, int]
    """Its traces by status, and ``error``."""
    leaks: PerLeak[CylinderLeak]
    """Each leak."""
    rows: tuple[int, ...]
    """Places of its traces in :attr:`Fleet.rows`, by their begin; those without come first."""


@dataclass(frozen=True, slots=True)
class LearntShare:
    """How often an explanation is true in a fleet."""

    id: str
    """Its name in ``[decision] odds``; one without ``_a`` or ``_b`` is both."""
    share: float
    """In how many cylinders of one, the table's share included."""
    table: float
    """By the table of :func:`explanations`."""
    cylinders: float
    """In how many cylinders it was met, as far as the verdicts tell."""


@dataclass(frozen=True, slots=True)
class FleetOdds:
    """How often explanations are true in a fleet; as text the lines of a rig file that say so (docs/fleet.md)."""

    cylinders: int
    """Cylinders that were learnt from."""
    shares: tuple[LearntShare, ...]
    """What was met; the others keep the table's proportions in what is left."""
    lines: str
    """Lines for the rig file; empty where nothing was met."""

    def __str__(self) -> str:
        return self.lines.rstrip()


class Fleet(Paged, Tabular):
    """What was found of many cylinders. As a table: a row per cylinder and trace, with the columns of ``pitchleak fleet
    --out`` (docs/fleet.md). Fleets of different days are put together by ``+``."""

    __slots__ = ("__dict__", "_rows")

    def __init__(self, rows: Iterable[_pitchleak.FleetRow]) -> None:
        self._rows = tuple(rows)

    @cached_property
    def rows(self) -> tuple[FleetRow, ...]:
        """A row per cylinder and trace."""
        return tuple(record(FleetRow, raw) for raw in self._report["rows"])

    @cached_property
    def _report(self) -> dict[str, Any]:
        return self.to_dict()

    @property
    def counts(self) -> dict[str, int]:
        """Traces by status, and ``error``."""
        return dict(self._report["counts"])

    @cached_property
    def cylinders(self) -> dict[str, FleetCylinder]:
        """What the traces of each cylinder say together, by its name, the worst first."""
        return {e["cylinder"]: record(FleetCylinder, e) for e in self._report["by_cylinder"]}

    @property
    def cylinder_counts(self) -> dict[str, int]:
        """Cylinders by status, and ``error``."""
        return dict(self._report["cylinder_counts"])

    @cached_property
    def trends(self) -> dict[str, PerLeak[LongTrend | None]]:
        """How leaks change over the traces of a cylinder, by cylinder; None for a leak that fewer than three dated
        traces pin down without doubt."""

        def long(raw: dict[str, Any] | None) -> LongTrend | None:
            return None if raw is None else record(LongTrend, raw)

        trends = self._report["trends"]
        return {e["cylinder"]: PerLeak(*(long(e["leaks"][leak]) for leak in LABELS)) for e in trends}

    @cached_property
    def odds(self) -> FleetOdds:
        """How often each explanation is true in this fleet, learnt from its traces."""
        odds, lines = _pitchleak.fleet_odds(self._rows)
        return record(FleetOdds, json.loads(odds) | {"lines": lines or ""})

    @property
    def table(self) -> Mapping[str, Any]:
        """The columns: lists of texts, counts and flags in which None is none, numpy arrays of numbers (NaN) and times
        in UTC (NaT)."""
        return {name: _column(kind, values) for name, kind, values in _pitchleak.fleet_table(self._rows)}

    def to_arrow(self) -> "pyarrow.Table":
        """The table as a :class:`pyarrow.Table`; its schema is the same whatever is missing, and that of the file."""
        arrow = optional("pyarrow", "arrow")
        kinds = {
            "texts": arrow.string(),
            "times": arrow.timestamp("ms", "UTC"),
            "numbers": arrow.float64(),
            "counts": arrow.int64(),
            "flags": arrow.bool_(),
        }
        columns = _pitchleak.fleet_table(self._rows)
        arrays = [arrow.array(_column(kind, values), kinds[kind], from_pandas=True) for _, kind, values in columns]
        table: pyarrow.Table = arrow.table(arrays, names=[name for name, _, _ in columns])
        return table

    def to_pandas(self) -> "pandas.DataFrame":
        """The table as a :class:`pandas.DataFrame`."""
        frame: pandas.DataFrame = optional("pandas", "pandas").DataFrame(dict(self.table))
        return frame.assign(begins=frame["begins"].dt.tz_localize("UTC"))

    def to_polars(self) -> "polars.DataFrame":
        """The table as a :class:`polars.DataFrame`; its schema is the same whatever is missing."""
        library = optional("polars", "polars")
        kinds = {
            "texts": library.String,
            "times": library.Datetime("ms"),
            "numbers": library.Float64,
            "counts": library.Int64,
            "flags": library.Boolean,
        }
        columns = _pitchleak.fleet_table(self._rows)
        series = [library.Series(name, _column(kind, values), kinds[kind]) for name, kind, values in columns]
        frame: polars.DataFrame = library.DataFrame(series).with_columns(
            library.selectors.float().fill_nan(None), library.col("begins").dt.replace_time_zone("UTC")
        )
        return frame

    def to_dict(self) -> dict[str, Any]:
        """Every field, as ``pitchleak fleet --json`` prints it."""
        raw: dict[str, Any] = json.loads(self.to_json())
        return raw

    def to_json(self) -> str:
        """As ``pitchleak fleet --json`` prints it."""
        return _pitchleak.fleet_json(self._rows)

    def save(self, path: _inputs.Path) -> None:
        """Writes the table: ``.parquet``, ``.csv`` or ``.csv.gz``; the file is replaced as a whole."""
        _pitchleak.fleet_save(self._rows, os.fspath(path))

    def to_html(self) -> str:
        return _pitchleak.fleet_page(self._rows)

    def _read(self) -> Sequence[str]:
        paths = ((row.path, row.rig) for row in self.rows)
        return [name for both in paths for name in both if name is not None]

    def __add__(self, other: "Fleet") -> "Fleet":
        return Fleet(self._rows + other._rows) if isinstance(other, Fleet) else NotImplemented

    def __len__(self) -> int:
        return len(self._rows)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Fleet) and self.to_json() == other.to_json()

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Fleet, (self._rows,)

    def __str__(self) -> str:
        return _pitchleak.fleet_text(self._rows).rstrip()

    def __repr__(self) -> str:
        return f"<Fleet: {str(self).partition(chr(10))[0]}>"

    def _repr_html_(self) -> str:
        shown = [one for one in self.cylinders.values() if one.status != "sound"]
        rows = []
        for one in shown[:50]:
            flows = [leak.flow for _, leak in one.leaks.items()]
            numbers = ["–" if flow is None else _html.number(flow.mean_lpm, flow.std_lpm) for flow in flows]
            word = "ERROR" if one.status is None else one.status.replace("_", " ").upper()
            why = ", ".join(one.faults or one.reasons) or self.rows[one.rows[-1]].error or ""
            rows.append((one.cylinder, (one.since or "–")[:10], word, *numbers, why))
        headers = ("cylinder", "since", "verdict", *(f"{label}, L/min" for label in LABELS.values()), "why")
        more = f"and {len(shown) - 50} more in doubt or leaking" if len(shown) > 50 else ""
        return _html.page(repr(self)[1:-1], *([_html.table(headers, rows)] if rows else []), footer=more)

    def plot(self, cylinder: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """Draws the leaks of one cylinder over its traces, with 95 % intervals and the lines of :attr:`trends` (needs
        matplotlib); where none is named, the worst. Traces without a date stand in their order, those
        in doubt are hollow. Returns the axes.
        """
        cylinder = self._worst() if cylinder is None else cylinder
        rows = [row for row in self.rows if row.cylinder == cylinder and row.leaks is not None]
        if not rows:
            raise ValueError(f"no trace of `{cylinder}` could be judged")
        axes = axes_for(ax)
        dated = all(row.begins is not None for row in rows)
        when: Any = np.array([_middle(row) for row in rows]) if dated else np.arange(len(rows))
        for leak, label in LABELS.items():
            flows = [getattr(row.leaks, leak) for row in rows]
            mean = np.array([flow.mean_lpm for flow in flows], np.float64)
            half = 1.96 * np.array([flow.std_lpm for flow in flows], np.float64)
            bars = axes.errorbar(when, mean, np.nan_to_num(half), fmt="o", label=label, markersize=4, linewidth=1)
            color = bars.lines[0].get_color()
            doubt = [row.status == "doubtful" for row in rows]
            if any(doubt):
                axes.plot(when[doubt], mean[doubt], "o", color=color, markerfacecolor="white", markersize=4, zorder=3)
            trend = getattr(self.trends[cylinder], leak) if dated and cylinder in self.trends else None
            if trend is not None:
                ends = [np.datetime64(moment.rstrip("Z")) for moment in (trend.from_, trend.to)]
                hours = (ends[1] - ends[0]) / np.timedelta64(1, "h")
                line = [trend.mean_lpm - trend.slope_lpm_per_h * hours, trend.mean_lpm]
                axes.plot(ends, line, color=color, linewidth=1)
        axes.set_ylabel("leak flow, L/min")
        axes.set_title(cylinder, fontsize="medium")
        legend_beside(axes, "leak")
        if dated:
            axes.tick_params("x", rotation=30)
        else:
            axes.set_xlabel("trace")
            axes.xaxis.set_major_locator(optional("matplotlib.ticker", "plot").MaxNLocator(integer=True))
        return axes

    def _worst(self) -> str:
        if not self.rows:
            raise ValueError("no trace")
        return next(iter(self.cylinders))


def _column(kind: str, values: Any) -> Any:
    return values.view("datetime64[ms]") if kind == "times" else values


def _middle(row: FleetRow) -> np.datetime64:
    begins = np.datetime64((row.begins or "").rstrip("Z"), "ms")
    return begins + np.timedelta64(round(500.0 * (row.duration_s or 0.0)), "ms")


@dataclass(frozen=True, slots=True)
class _Job:
    """One trace, as it goes to whoever judges it."""

    data: Any
    cylinder: str
    begins: str | None
    rig: Rig | str | None
    columns: _inputs.Columns | None


def _judge(job: _Job, stop: Stop | None = None) -> _pitchleak.FleetRow:
    """Judges one trace; runs in any thread, process or machine that has the file."""
    try:
        rig = _inputs.rig_for(None, job.rig, job.columns)
        source = _inputs.source(job.data, rig)
    except TypeError as error:
        raise TypeError(f"cylinder `{job.cylinder}`: {error}") from None
    except (OSError, RigError, TraceError) as error:
        path = str(job.data) if _inputs.is_path(job.data) else "data"
        return _pitchleak.FleetRow.failed(job.cylinder, job.begins, path, str(error))
    return _pitchleak.fleet_row(source, job.cylinder, job.begins, rig, stop)


def fleet(
    traces: Any,
    rigs: Rigs | None = None,
    *,
    columns: _inputs.Columns | None = None,
    table: _inputs.Path | None = None,
    map: Map | None = None,
    progress: Progress = True,
) -> Fleet:
    """Judges the traces of many cylinders, each as :func:`replay` judges it alone.

    ``traces`` are paths or patterns (``"farm/**/*.parquet"``), one or a list, or data by the names of their cylinders,
    as :func:`replay` takes it. ``rigs`` is a :class:`Rig` or a rig file for all, a table of rig files (``.csv``,
    docs/fleet.md), or rigs by the names of the cylinders; left out, it is ``rig.toml`` beside each file, else the
    built-in one. ``columns`` names foreign columns as for :func:`replay`. A trace that can't be used becomes a row with
    its ``error``, and a :class:`TraceWarning` says so. Links and copies of a file count once, with a warning each.

    ``table`` is the folder of a table that grows (Parquet, by day): only files that are new or changed since the calls
    before are read, and the fleet is that of all nights.

    ``map`` is any map, and says where the work is done: the builtin ``map``, that of a process pool, ``joblib``'s in a
    lambda, a Dask client's; futures are waited for. Left out, it is all cores of this machine. ``progress`` is True
    (a bar where tqdm is there and somebody watches), False, or a function of the traces done and of all.

    >>> import pitchleak as pl
    >>> leaks = {"T1/B1": "0 L/min", "T1/B2": "0.5 L/min"}
    >>> blades = {name: pl.simulate(13, leak_internal=leak, duration=20).columns for name, leak in leaks.items()}
    >>> found = pl.fleet(blades, map=map)
    >>> found.table["cylinder"], found.table["status"]
    (['T1/B1', 'T1/B2'], ['sound', 'leak'])
    """
    if map is not None and not callable(map):
        raise TypeError(f"map: {_arguments.kind(map)} is none; give a function such as the builtin map")
    jobs = _jobs(traces, rigs, columns)
    nights = None if table is None else _pitchleak.FleetNights(_arguments.path("table", table))
    jobs, seen = (jobs, []) if nights is None else _news(jobs, nights)
    if map is None:
        rows = on_all_cores(_judge, jobs, progress, "trace")
    else:
        rows = _gathered(map(_judge, jobs), len(jobs), progress)
    done = Fleet(rows if nights is None else nights.add(seen, rows))
    failed = [row for row in rows if row.error is not None]
    if failed:
        _inputs.warn(
            [f"{len(failed)} of {len(rows)} traces could not be judged, the first for this: {failed[0].error}"]
        )
    return done


def _news(jobs: list[_Job], nights: _pitchleak.FleetNights) -> tuple[list[_Job], list[str]]:
    """The jobs whose trace no night has judged as it is now, and what each was seen as."""
    news, seen = [], []
    for job in jobs:
        if not _inputs.is_path(job.data):
            raise TypeError(f"table: takes traces that are files, `{job.cylinder}` is data in memory")
        try:
            rig = _inputs.rig_for(None, job.rig, job.columns)
        except (OSError, RigError, TraceError):
            rig = None
        new = nights.new_as(os.fspath(job.data), rig)
        if new is not None:
            news.append(job)
            seen.append(new)
    return news, seen


def _gathered(results: Iterable[Any], count: int, progress: Progress) -> list[_pitchleak.FleetRow]:
    """Rows, from futures too."""
    rows: list[_pitchleak.FleetRow] = []
    with shown(progress, "trace") as at:
        for item in results:
            rows.append(item if isinstance(item, _pitchleak.FleetRow) else item.result())
            at(len(rows), count)
    return rows


def _jobs(traces: Any, rigs: Rigs | None, columns: _inputs.Columns | None) -> list[_Job]:
    if rigs is not None and not isinstance(rigs, (Rig, str, os.PathLike, Mapping)):
        raise TypeError(f"rigs: {_arguments.kind(rigs)} is none; give a Rig, a file, or rigs by the names of cylinders")
    if isinstance(traces, Mapping):
        named = ((str(cylinder), data) for cylinder, data in traces.items())
        return [_named_job(cylinder, data, _rig_of(cylinder, rigs), columns) for cylinder, data in named]
    patterns = _patterns(traces)
    file = os.fspath(rigs) if isinstance(rigs, (str, os.PathLike)) else None
    found, doubles = _pitchleak.fleet_traces(patterns, file)
    _inputs.warn(doubles)
    one = rigs if isinstance(rigs, Rig) else None
    jobs = [_Job(path, cylinder, begins, one or beside, columns) for path, cylinder, begins, beside in found]
    if not isinstance(rigs, Mapping):
        return jobs
    return [replace(job, rig=_rig_of(job.cylinder, rigs)) for job in jobs]


def _patterns(traces: Any) -> list[str]:
    allowed = "give paths or patterns, or data by the names of its cylinders, such as {'T1/B1': frame}"
    if _inputs.is_path(traces):
        return [os.fspath(traces)]
    # A table iterates over the names of its columns.
    if not isinstance(traces, Iterable) or hasattr(traces, "columns"):
        raise TypeError(f"traces: {_arguments.kind(traces)} is none; {allowed}")
    patterns = list(traces)
    for pattern in patterns:
        if not _inputs.is_path(pattern):
            raise TypeError(f"traces: {_arguments.kind(pattern)} in a list is none; {allowed}")
    return [os.fspath(pattern) for pattern in patterns]


def _named_job(cylinder: str, data: Any, rig: Rig | str | None, columns: _inputs.Columns | None) -> _Job:
    if rig is None and _inputs.is_path(data):
        ((path, _, begins, beside),), _ = _pitchleak.fleet_traces([os.fspath(data)], None)
        return _Job(path, cylinder, begins, beside, columns)
    return _Job(data, cylinder, None, rig, columns)


def _rig_of(cylinder: str, rigs: Rigs | None) -> Rig | str | None:
    if isinstance(rigs, Mapping):
        if cylinder not in rigs:
            raise KeyError(f"no rig for cylinder `{cylinder}`")
        rigs = rigs[cylinder]
    return rigs if rigs is None or isinstance(rigs, Rig) else os.fspath(rigs)
