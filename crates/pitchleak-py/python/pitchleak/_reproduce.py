"""Reproduce: the paper's experiment again."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from . import _arguments, _html, _inputs, _pitchleak
from ._page import Paged
from ._picture import axes_for, legend_beside
from ._progress import Progress, shown
from ._raw import Raw
from ._records import record
from ._tabular import Tabular

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FIGURES = (
    "leakage_mean_error_percent",
    "leakage_peak_error_percent",
    "coefficient_mean_error_percent",
    "coefficient_peak_error_percent",
    "convergence_time_s",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One wind, case, leak and estimator: medians over all seeds."""

    wind_mps: int
    """Mean wind, m/s."""
    case: int
    """1: large internal and small external leak; 2: the other way round."""
    leak: Literal["internal", "external_a"]
    """Which leak."""
    estimator: str
    """``paper`` or ``rls``."""
    identifiable: bool
    """Whether the windows tell this leak apart; only then there are figures."""
    leakage_mean_error_percent: float | None = None
    """Mean leakage error in steady state, %."""
    leakage_peak_error_percent: float | None = None
    """Peak leakage error in steady state, %."""
    coefficient_mean_error_percent: float | None = None
    """Mean coefficient error in steady state, %."""
    coefficient_peak_error_percent: float | None = None
    """Peak coefficient error in steady state, %."""
    convergence_time_s: float | None = None
    """Time until the coefficient stays within 5 %, s; None where it does not."""


@dataclass(frozen=True, eq=False, repr=False)
class Reproduction(Paged, Raw, Tabular):
    """The paper's table, its law and ours on the same readings. As a table: the rows."""

    seeds: int
    """Seeds per row."""
    rows: tuple[Row, ...]
    """White noise of 3 σ = 1 % of full scale on every sensor."""
    rows_with_bias: tuple[Row, ...]
    """The same with a constant bias of up to 1 % of full scale on every sensor."""
    raw: dict[str, Any] = field(init=False, default_factory=dict)
    """Every field of ``pitchleak reproduce --json``."""
    _text: str = field(init=False, default="")
    _page: str = field(init=False, default="")

    @property
    def table(self) -> Mapping[str, Any]:
        """A row per wind, case, leak and estimator."""
        names = ("wind_mps", "case", "leak", "estimator", "identifiable", *_FIGURES)
        return {name: [getattr(row, name) for row in self.rows] for name in names}

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draws the mean coefficient error of every row (needs matplotlib). Returns the axes."""
        axes = axes_for(ax)
        for estimator in dict.fromkeys(row.estimator for row in self.rows):
            rows = [row for row in self.rows if row.estimator == estimator and row.identifiable]
            names = [f"{row.wind_mps} m/s\ncase {row.case}\n{row.leak.replace('_', ' ')}" for row in rows]
            errors = [row.coefficient_mean_error_percent or 0.0 for row in rows]
            axes.plot(names, errors, "o", label=estimator)
        axes.set_yscale("log")
        axes.set_ylabel("coefficient error, %")
        axes.tick_params("x", labelsize=6)
        legend_beside(axes)
        return axes

    def to_html(self) -> str:
        return self._page

    def __str__(self) -> str:
        return self._text.rstrip()

    def __repr__(self) -> str:
        return f"<Reproduction: {len(self.rows)} rows, {self.seeds} seeds each>"

    def _repr_html_(self) -> str:
        headers = ("wind, m/s", "case", "leak", "estimator", *(name.replace("_", " ") for name in _FIGURES))
        rows = [
            (str(r.wind_mps), str(r.case), r.leak, r.estimator, *(_html.number(getattr(r, f)) for f in _FIGURES))
            for r in self.rows
        ]
        return _html.page(repr(self)[1:-1], _html.table(headers, rows))


def reproduce(seeds: int = 56, *, out: _inputs.Path | None = None, progress: Progress = True) -> Reproduction:
    """Reruns the paper's experiment: four winds, two leak settings, its law and ours (docs/reproduction.md).

    ``out`` is a directory for the figures (SVG) and the table. With the default number of seeds it takes
    up to a minute on two cores. ``progress`` is True (a bar where tqdm is installed and somebody watches), False, or a
    function of the pieces done and of all, stage by stage.

    >>> import pitchleak as pl
    >>> table = pl.reproduce(seeds=1)
    >>> len(table.rows)
    32
    """
    seeds = _arguments.count("seeds", seeds, 1)
    with shown(progress, "") as at:
        report, text, page = _pitchleak.reproduce(seeds, None if out is None else _arguments.path("out", out), at)
    raw = json.loads(report)
    result = record(Reproduction, raw)
    object.__setattr__(result, "raw", raw)
    object.__setattr__(result, "_text", text)
    object.__setattr__(result, "_page", page)
    return result
