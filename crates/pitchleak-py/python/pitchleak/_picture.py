"""Axes to draw on, and legends that hide nothing."""

from typing import TYPE_CHECKING

from ._tabular import optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure_for(figure: "Figure | None", height: float) -> "Figure":
    """The figure, or a new one of this height, inches."""
    if figure is not None:
        return figure
    made: Figure = optional("matplotlib.pyplot", "plot").figure(figsize=(8, height), layout="constrained")
    return made


def axes_for(ax: "Axes | None", height: float = 4.0) -> "Axes":
    """The axes, or new ones in a figure of this height, inches."""
    return figure_for(None, height).subplots() if ax is None else ax


def legend_beside(axes: "Axes", title: str | None = None) -> None:
    """A legend to the right of the axes."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, title=title)
