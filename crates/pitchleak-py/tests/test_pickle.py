"""Results and rigs go through pickle and copy as they are, for pools and caches."""

import copy
import json
import pickle

import matplotlib.pyplot as pyplot
import numpy as np
import polars
import pytest

import pitchleak as pl


def ways():
    return [
        copy.copy,
        copy.deepcopy,
        lambda thing: pickle.loads(pickle.dumps(thing)),
        lambda t: pickle.loads(pickle.dumps(t, 2)),
    ]


@pytest.fixture(scope="module")
def short():
    return pl.simulate(13, leak_internal="0.5 L/min", duration=10).columns


@pytest.mark.parametrize("again", ways())
def test_a_replay(again, short):
    stamped = dict(short)
    stamped["timestamp"] = np.datetime64("2026-05-01") + (1e3 * stamped.pop("t_s")).round().astype("timedelta64[ms]")
    for data in (
        short,
        stamped,
        polars.DataFrame(short),
        polars.concat([polars.DataFrame(short)[:500], polars.DataFrame(short)[500:]]),
    ):
        out = pl.replay(data)
        same = again(out)
        assert same == out and type(same) is pl.Replay
        assert str(same) == str(out)
        for name, column in out.table.items():
            np.testing.assert_array_equal(same.table[name], column)


@pytest.mark.parametrize("again", ways())
def test_replays(again, short):
    out = pl.replay([short, short], progress=False)
    same = again(out)
    assert dict(same) == dict(out)
    np.testing.assert_array_equal(same[0].table["t_s"], out[0].table["t_s"])


@pytest.fixture(scope="module")
def results(short):
    """One of each kind."""
    trace = pl.simulate(13, duration=10, effects={"viscous_friction": 3000.0}, noise="0.1 %")
    estimator = pl.Estimator()
    estimator.extend(short)
    return {
        "replay": pl.replay(short),
        "replays": pl.replay([short, short], progress=False),
        "check": pl.check(short),
        "diagnosis": pl.diagnose(trace.columns, progress=False),
        "simulation": trace,
        "report": estimator.state(),
        "fleet": pl.fleet({"a": short}, progress=False),
        "estimator": estimator,
    }


@pytest.mark.parametrize("again", ways())
def test_every_other_result(again, results):
    same = {name: again(result) for name, result in results.items()}
    assert same["report"] == same["estimator"].state() == results["report"]
    for name in ("check", "diagnosis", "simulation", "replays"):
        assert same[name].to_dict() == results[name].to_dict()
    assert same["check"].leaks == results["check"].leaks
    assert same["fleet"] == results["fleet"]
    assert same["diagnosis"].rig == results["diagnosis"].rig
    left, right = (one["diagnosis"].residuals_after["force_n"].t_s for one in (same, results))
    np.testing.assert_array_equal(left, right)
    left, right = (one["simulation"].columns["x_mm"] for one in (same, results))
    np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("again", ways())
def test_rig_and_linkage(again):
    for thing in (pl.Rig.paper(), pl.Linkage(crank_radius_m=0.4)):
        assert again(thing) == thing


def test_a_trace_error_keeps_its_place():
    with pytest.raises(pl.TraceError) as raised:
        pl.replay({"t_s": [0.0], "x_mm": [1e9], "pa_bar": [1.0], "pb_bar": [1.0]}, strict=True)
    same = pickle.loads(pickle.dumps(raised.value))
    assert str(same) == str(raised.value)
    assert (same.column, same.row) == (raised.value.column, raised.value.row) == ("x_mm", 0)


def test_every_result_has_json_a_picture_and_a_page(results):
    for name, result in results.items():
        if name != "estimator":
            assert json.loads(result.to_json()) == result.to_dict()
            assert result.plot() is not None
            assert "<table>" in result._repr_html_()
            assert "m3s" not in result._repr_html_()
    pyplot.close("all")
