"""The page of a result is the one that the program writes with --report."""

import copy

import numpy as np
import pytest

import pitchleak as pl
from pitchleak._gaps import broken


@pytest.fixture(scope="module")
def trace():
    return pl.simulate(13, leak_internal="0.5 L/min", noise="0.3 %", duration=12)


@pytest.fixture(scope="module")
def results(trace):
    columns = trace.columns
    return [
        (pl.replay(columns), "LEAK"),
        (pl.check(columns), "data"),
        (pl.diagnose(columns, progress=False), "data"),
        (pl.fleet({"T7/<b>": columns}, map=map), "T7/&lt;b&gt;"),
    ]


def test_pages_are_complete_and_written_as_they_are(results, tmp_path):
    for number, (result, word) in enumerate(results):
        page = result.to_html()
        assert page.startswith("<!DOCTYPE html>") and "default-src 'none'" in page and word in page
        path = tmp_path / f"{number}.html"
        result.report(path)
        assert path.read_text() == page == copy.deepcopy(result).to_html()


def test_a_page_is_html_and_never_over_the_data(trace, tmp_path):
    path = tmp_path / "trace.html"
    path.write_text("t_s,x_mm,pa_bar,pb_bar,qa_lpm,qb_lpm\n0,50,50,50,0,0\n0.01,50,50,50,0,0\n")
    out = pl.replay(path)
    with pytest.raises(ValueError, match=r"trace\.html"):
        out.report(path)
    with pytest.raises(ValueError, match=r"written as \.html"):
        out.report(tmp_path / "report.txt")
    path.write_text(path.read_text() + "0.02,60,50,50,0,0\n")
    with pytest.raises(RuntimeError, match="changed"):
        out.to_html()


def test_lines_break_where_a_trace_pauses_and_count_on_where_its_clock_is_set_back():
    t, y = broken([0.0, 1.0, 2.0, 60.0, 61.0, 0.0, 1.0], np.arange(7.0))
    np.testing.assert_array_equal(y, [0.0, 1.0, 2.0, np.nan, 3.0, 4.0, np.nan, 5.0, 6.0])
    np.testing.assert_array_equal(t, [0.0, 1.0, 2.0, np.nan, 60.0, 61.0, np.nan, 61.0, 62.0])
