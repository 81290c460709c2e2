"""Pictures: a legend hides no curve, and nothing is cut off."""

import matplotlib.pyplot as pyplot
import pytest

import pitchleak as pl


@pytest.fixture(scope="module")
def short():
    return pl.simulate(13, leak_internal="0.5 L/min", duration=10)


DRAWN = {
    "simulation": lambda short: short.plot(),
    "replay": lambda short: pl.replay(short.columns).plot().figure,
    "replays": lambda short: pl.replay([short.columns] * 2, progress=False).plot().figure,
    "check": lambda short: pl.check(short.columns).plot().figure,
    "diagnosis": lambda short: pl.diagnose(short.columns, progress=False).plot(),
    "fleet": lambda short: pl.fleet({"T1/B1": short.columns}, map=map, progress=False).plot().figure,
}


@pytest.mark.parametrize("draw", DRAWN.values(), ids=DRAWN)
def test_a_legend_stands_beside_its_axes(draw, short):
    figure = draw(short)
    figure.canvas.draw()
    for axes in figure.axes:
        inside = axes.get_window_extent()
        legend = axes.get_legend()
        assert legend is None or legend.get_window_extent().x0 >= inside.x1
        whole = axes.get_tightbbox()
        assert whole.x0 >= 0 and whole.x1 <= figure.bbox.x1 + 1 and whole.y0 >= 0 and whole.y1 <= figure.bbox.y1 + 1
    pyplot.close(figure)
