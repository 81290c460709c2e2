"""A rig from keyword arguments is the rig of the file that says the same; a mistake names its argument."""

import pickle
import subprocess
import sys
import warnings

import numpy as np
import pandas as pd
import polars
import pyarrow as pa
import pytest

import pitchleak as pl

CYLINDER = {"area_a": "12.6 cm^2", "area_b": "9.4 cm^2", "stroke": "0.2 m", "moving_mass": "20 kg"}
FILE = """
[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "0.2 m"
moving_mass = "20 kg"
dead_volume_a = "10 cm^3"
[fluid]
bulk_modulus = "0.8 GPa"
bulk_modulus_std = "0.2 GPa"
[sensors]
flow_a = { full_scale = "20 L/min", accuracy = "1 %", bias = "0.1 %" }
flow_b = { full_scale = "30 L/min", accuracy = "1 %" }
pressure = { full_scale = "16 MPa", accuracy = "0.5 %" }
[estimator]
kind = "paper"
[alarms]
internal = "0.3 L/min"
[columns]
pa = { name = "Head pressure", unit = "bar", scale = -1.0 }
x = "Position [mm]"
[effects]
position_gain = 0.02
"""


FLOW = {"full_scale": "25 L/min"}


def by_arguments():
    return pl.Rig(
        **CYLINDER,
        dead_volume_a="10 cm^3",
        bulk_modulus="0.8 GPa",
        bulk_modulus_std="0.2 GPa",
        flow_a={"full_scale": "20 L/min", "accuracy": "1 %", "bias": "0.1 %"},
        flow_b={"full_scale": "30 L/min", "accuracy": "1 %"},
        pressure={"full_scale": "16 MPa", "accuracy": "0.5 %"},
        estimator="paper",
        alarms={"internal": "0.3 L/min"},
        columns={"pa": {"name": "Head pressure", "unit": "bar", "scale": -1.0}, "x": "Position [mm]"},
        effects={"position_gain": 0.02},
    )


def test_arguments_say_what_a_file_says():
    assert by_arguments() == pl.Rig.parse(FILE)
    assert by_arguments().name == "rig" and pl.Rig(**CYLINDER, bulk_modulus=8e8, name="mine").name == "mine"
    assert pickle.loads(pickle.dumps(by_arguments())) == by_arguments()
    si = pl.Rig(area_a=0.00126, area_b=np.float64(0.00094), stroke=0.2, moving_mass=20, bulk_modulus=np.float32(8e8))
    assert si == pl.Rig(**CYLINDER | {"area_a": "0.00126 m^2", "area_b": "0.00094 m^2"}, bulk_modulus="0.8 GPa")


def test_accuracy_is_that_of_every_sensor():
    text = pl.Rig.paper().to_toml().replace("accuracy = 0.01", "accuracy = 0.001")
    assert pl.Rig.paper().replace(accuracy="0.1 %", name="rig") == pl.Rig.parse(text)
    mixed = pl.Rig.paper().replace(accuracy="0.1 %", position={"accuracy": "2 %"})
    assert mixed.to_toml().count("accuracy = 0.001") == 4 and mixed.to_toml().count("accuracy = 0.02") == 1


def test_replaced_is_all_but_what_is_named():
    rig = by_arguments()
    other = rig.replace(area_a="12.7 cm^2", flow=FLOW, estimator="rls", name="rig")
    lines = zip(rig.to_toml().splitlines(), other.to_toml().splitlines(), strict=True)
    changed = [(before, after) for before, after in lines if before != after]
    assert [after.partition(" ")[0] for _, after in changed] == ["area_a", "flow_a", "flow_b", "kind"]
    assert other == rig.replace(area_a=other.area_a_m2, estimator={"kind": "rls"}, flow=FLOW, name="rig")
    assert abs(other.area_a_m2 - 12.7e-4) < 1e-12 and "bias = 0.001" in changed[1][1]
    assert rig.replace(effects=None, name="rig").effects == {} and rig.replace(name="rig") == rig


def test_a_changed_rig_has_another_name():
    paper = pl.Rig.paper()
    assert paper.replace(stroke="0.3 m").name == "wu2011, changed"
    assert paper.replace(columns={"pa": "Head [bar]"}).name == paper.replace().name == "wu2011"


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"area_a": "12.6 bar"}, pl.RigError, "^`area_a`: .*cm"),
        ({"area_a": 12.6}, pl.RigError, "^`area_a` is 12.6 m\\^2; it must be"),
        ({"area_a": float("nan")}, pl.RigError, "^`area_a` is NaN"),
        ({"area_a": None}, pl.RigError, "^missing key `area_a`"),
        ({"area_a": True}, pl.RigError, "^`area_a` must be a quantity"),
        ({"area_a": [1.0]}, TypeError, "^`area_a`: list is no quantity.*SI"),
        ({"aera_a": "12.6 cm^2"}, TypeError, "^unknown argument `aera_a`; there are area_a, .*columns"),
        ({"pressure": {"full_scale": "16 m"}}, pl.RigError, "^`pressure.full_scale`: "),
        ({"pressure": {"range": "16 bar"}}, pl.RigError, "^unknown key `pressure.range`; allowed here: full_scale"),
        ({"pressure": "16 MPa"}, pl.RigError, "^`pressure`"),
        ({"accuracy": "much"}, pl.RigError, "accuracy`: "),
        ({"estimator": "best"}, pl.RigError, "^`estimator.kind` is best; it must be rls or paper"),
        ({"columns": {"pq": "x [bar]"}}, pl.RigError, "^unknown key `columns.pq`"),
        ({"columns": {"pa": "Head pressure"}}, pl.RigError, "^`columns.pa` is Head pressure; .*bar"),
        ({"name": 7}, TypeError, "`name` must be a text"),
    ],
)
def test_a_mistake_names_its_argument(arguments, error, words):
    for make in (lambda: pl.Rig(**{**CYLINDER, "bulk_modulus": 8e8, **arguments}), lambda: paper_with(arguments)):
        with pytest.raises(error, match=words) as raised:
            make()
        assert "\n" not in str(raised.value)


def paper_with(arguments):
    return pl.Rig.paper().replace(**arguments)


@pytest.fixture(scope="module")
def trace():
    return pl.simulate(13, leak_external_a="0.5 L/min", duration=20, noise="0.3 %").columns


FOREIGN = {"pa": {"name": "Head", "unit": "bar", "scale": -1.0}, "x": "Travel [mm]"}


@pytest.fixture(scope="module")
def foreign(trace):
    rest = {name: values for name, values in trace.items() if name not in ("pa_bar", "x_mm")}
    return rest | {"Head": -trace["pa_bar"], "Travel [mm]": trace["x_mm"]}


def without_trace(result):
    return {key: value for key, value in result.to_dict().items() if key != "trace"}


def test_every_call_takes_columns(trace, foreign, tmp_path):
    expected = pl.replay(trace)
    frame = pd.DataFrame(foreign)
    frame.to_csv(tmp_path / "foreign.csv", index=False)
    for data in (foreign, frame, polars.DataFrame(foreign), tmp_path / "foreign.csv"):
        assert without_trace(pl.replay(data, columns=FOREIGN)) == without_trace(expected)
    assert without_trace(pl.check(foreign, columns=FOREIGN)) == without_trace(pl.check(trace))
    assert pl.diagnose(foreign, columns=FOREIGN).to_dict() == pl.diagnose(trace).to_dict()
    many = pl.replay({**foreign, "blade": np.repeat(["a", "b"], len(frame) // 2)}, columns=FOREIGN, group="blade")
    assert list(many) == ["a", "b"]
    assert pl.fleet({"a": foreign}, columns=FOREIGN, map=map) == pl.fleet({"a": trace}, map=map)
    estimator = pl.Estimator(columns=FOREIGN)
    estimator.extend(foreign)
    assert estimator.state().estimates == expected.estimates
    with pytest.raises(pl.RigError, match=r"unknown key `columns\.head`"):
        pl.replay(foreign, columns={"head": "Head [bar]"})


def test_columns_stand_over_those_of_the_rig(trace, foreign):
    rig = pl.Rig.paper().replace(columns={"pa": "Nowhere [bar]", "x": "Travel [mm]"})
    expected = pl.replay(trace)
    assert without_trace(pl.replay(foreign, rig, columns={"pa": FOREIGN["pa"]})) == without_trace(expected)


def test_a_notebook_shows_a_rig():
    html = by_arguments()._repr_html_()
    assert "<table>" in html and "12.6 and 9.4 cm²" in html and "Rig rig" in html


@pytest.mark.parametrize("make", [lambda columns: columns, pd.DataFrame, polars.DataFrame, pa.table])
def test_rows_in_no_order_of_time_are_refused(trace, make):
    order = np.random.default_rng(1).permutation(len(trace["t_s"]))
    for rows in (order, slice(None, None, -1), np.argsort(trace["x_mm"])):
        mixed = make({name: np.ascontiguousarray(values[rows]) for name, values in trace.items()})
        for use in (pl.replay, pl.check, pl.diagnose, pl.Estimator().extend):
            with pytest.raises(pl.TraceError, match=r"no order of time: column `t_s` goes back .*`group`") as raised:
                use(mixed)
            assert raised.value.column == "t_s" and raised.value.row >= 1 and "\n" not in str(raised.value)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stamps = np.datetime64("2026-05-01", "ms") + np.round(1e3 * trace["t_s"]).astype("timedelta64[ms]")
        rest = {name: values for name, values in trace.items() if name != "t_s"}
        with pytest.raises(pl.TraceError, match="`timestamp` goes back"):
            pl.replay(make({name: values[order] for name, values in {"timestamp": stamps, **rest}.items()}))


def test_a_clock_that_was_set_back_is_in_order(trace):
    twice = {name: np.concatenate([values, values]) for name, values in trace.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pl.TraceWarning)
        out = pl.replay(twice)
    assert "the clock was set back (1 times)" in out.trace.warnings and out.trace.skipped < 10


DAYS = np.array(["2026-05-02", "2026-05-01"], "datetime64[ns]")


@pytest.mark.parametrize(
    ("keys", "make", "expected"),
    [
        (["b", "a"], lambda data: data, ["b", "a"]),
        ([2, 1], lambda data: data, [2, 1]),
        (DAYS, lambda data: data, list(DAYS)),
        (DAYS, pd.DataFrame, [pd.Timestamp(day) for day in DAYS]),
        ([2, 1], pa.table, [2, 1]),
        ([None, 1], pa.table, [None, 1]),
        (DAYS.astype("datetime64[us]"), pa.table, [day.item() for day in DAYS.astype("datetime64[us]")]),
        (DAYS.astype("datetime64[us]"), polars.DataFrame, [day.item() for day in DAYS.astype("datetime64[us]")]),
        ([True, False], polars.DataFrame, [True, False]),
    ],
)
def test_a_group_keeps_the_type_of_its_key(trace, keys, make, expected):
    half = len(trace["t_s"]) // 2
    named = [key for key in keys for _ in range(half)]
    column = np.array(named) if isinstance(keys, np.ndarray) or None not in keys else pa.array(named)
    blades = {name: values[: 2 * half] for name, values in trace.items()} | {"blade": column}
    found = pl.replay(make(blades), group="blade")
    assert list(found) == expected and [type(key) for key in found] == [type(key) for key in expected]
    first = {name: values[:half] for name, values in trace.items()}
    assert without_trace(found[expected[0]]) == without_trace(pl.replay(first))


def test_rows_of_groups_may_stand_mixed(trace):
    half = len(trace["t_s"]) // 2
    parts = [{name: values[:half] for name, values in trace.items()}, {n: v[half:] for n, v in trace.items()}]
    mixed = {name: np.column_stack([parts[0][name], parts[1][name]]).ravel() for name in trace}
    mixed["blade"] = np.tile([7, 3], half)
    for make in (lambda data: data, pd.DataFrame, polars.DataFrame, pa.table):
        found = pl.replay(make(mixed), group="blade")
        assert list(found) == [7, 3]
        for key, part in zip((7, 3), parts, strict=True):
            assert without_trace(found[key]) == without_trace(pl.replay(part))


def test_the_import_brings_nothing_that_is_slow():
    """numpy comes with the first name that is asked for."""
    slow = {"numpy", "pandas", "polars", "pyarrow", "matplotlib"}
    code = f"import sys, pitchleak; print(sorted({slow} & sys.modules.keys()))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"
    asked = "import sys, pitchleak; pitchleak.replay; print('pandas' in sys.modules, len(dir(pitchleak)) > 40)"
    done = subprocess.run([sys.executable, "-c", asked], check=True, capture_output=True, text=True)
    assert done.stdout.split() == ["False", "True"]
    with pytest.raises(AttributeError, match="no attribute 'gremlin'"):
        _ = pl.gremlin
    assert set(pl.__all__) <= set(dir(pl))
