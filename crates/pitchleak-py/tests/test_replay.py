"""The same numbers as the program's, to the last bit, whatever the trace comes in."""

import copy
import json
import pickle
import threading

import numpy as np
import pandas as pd
import polars
import pyarrow as pa
import pytest
from conftest import ROOT, TRACES, read_columns

import pitchleak as pl


def without_trace(raw):
    return {key: value for key, value in raw.items() if key != "trace"}


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.name)
@pytest.mark.parametrize("estimator", ["rls", "paper"])
def test_the_programs_numbers(path, estimator, program, rig, tmp_path):
    out_file = tmp_path / "over_time.csv"
    name = path.relative_to(ROOT)
    ours = json.loads(program("replay", name, "--estimator", estimator, "--json", "--out", out_file))

    from_path = pl.replay(path, estimator=estimator)
    assert without_trace(from_path.raw) | {"rig": ours["rig"]} == without_trace(ours)
    from_arrays = pl.replay(read_columns(path), rig, estimator=estimator)
    assert without_trace(from_arrays.raw) | {"rig": ours["rig"]} == without_trace(ours)
    assert from_arrays.trace.samples == ours["trace"]["samples"]

    over_time = read_csv(out_file)
    for out in (from_path, from_arrays):
        assert list(out.table) == list(over_time)
        for column, values in over_time.items():
            np.testing.assert_array_equal(out.table[column], values, strict=False)


def read_csv(path):
    header, *lines = path.read_text().splitlines()
    rows = [[float(cell) for cell in line.split(",")] for line in lines]
    return dict(zip(header.split(","), np.array(rows).T, strict=True))


def frames(columns):
    table = pa.table(columns)
    half = len(table) // 2
    chunks = pa.concat_tables([table.slice(0, half), table.slice(half)])
    frame = pd.DataFrame(columns)
    return {
        "pandas": frame,
        "pandas strided": pd.DataFrame(np.column_stack(list(columns.values())), columns=list(columns)),
        "pandas nullable": frame.astype("Float64"),
        "pandas arrow": frame.astype("double[pyarrow]"),
        "polars": polars.DataFrame(columns),
        "pyarrow": table,
        "pyarrow chunks": chunks,
        "pyarrow batches": chunks.to_reader(),
        "pyarrow batch": table.to_batches()[0],
        "lists": {name: values.tolist() for name, values in columns.items()},
        "strided": {name: np.repeat(values, 2)[::2] for name, values in columns.items()},
        "big endian": {name: values.astype(">f8") for name, values in columns.items()},
        "backwards": {name: values[::-1].copy()[::-1] for name, values in columns.items()},
    }


KINDS = list(frames({"t_s": np.zeros(2)}))


@pytest.mark.parametrize("kind", KINDS)
def test_any_frame_gives_the_same(kind, columns, rig):
    assert pl.replay(frames(columns)[kind], rig).raw == pl.replay(columns, rig).raw


def test_missing_flows_rest_whatever_they_are_written_as(columns, rig):
    columns = {name: values.copy() for name, values in columns.items()}
    columns["qa_lpm"][500:900] = np.nan
    expected = pl.replay(columns, rig)
    assert expected.raw != pl.replay(columns | {"qa_lpm": columns["qb_lpm"]}, rig).raw
    for frame in frames(columns).values():
        assert pl.replay(frame, rig).raw == expected.raw
    nulls = polars.DataFrame(columns).with_columns(polars.col("qa_lpm").fill_nan(None))
    assert nulls["qa_lpm"].null_count() == 400
    assert pl.replay(nulls, rig).raw == expected.raw
    masked = columns | {"qa_lpm": np.ma.masked_invalid(columns["qa_lpm"])}
    assert pl.replay(masked, rig).raw == expected.raw


# Whole litres per minute jump like spikes, and are left out as such, in all three.
@pytest.mark.filterwarnings("ignore:.*spike")
def test_whole_numbers_and_single_precision_are_numbers(columns, rig):
    rounded = {name: np.round(values) for name, values in columns.items()} | {"t_s": columns["t_s"]}
    expected = pl.replay(rounded, rig)
    as_int = {name: values if name == "t_s" else values.astype(np.int32) for name, values in rounded.items()}
    as_single = {name: values if name == "t_s" else values.astype(np.float32) for name, values in rounded.items()}
    for frame in (as_int, as_single, pa.table(as_int), polars.DataFrame(as_single)):
        assert pl.replay(frame, rig).raw == expected.raw


def test_time_stamps(columns, rig):
    count = len(columns["t_s"])
    stamps = np.datetime64("2026-11-20T22:10:31.5") + np.arange(count) * np.timedelta64(10, "ms")
    rest = {name: values for name, values in columns.items() if name != "t_s"}
    stamped = {"timestamp": stamps} | rest
    expected = pl.replay({"t_s": np.arange(count) * 0.01} | rest, rig)
    zoned = pd.DataFrame(stamped)
    zoned["timestamp"] = zoned["timestamp"].dt.tz_localize("UTC").dt.tz_convert("Europe/Berlin")
    texts = stamped | {"timestamp": stamps.astype(str)}
    frames = (stamped, pd.DataFrame(stamped), polars.DataFrame(stamped), pa.table(stamped), zoned, texts)
    for frame in frames:
        out = pl.replay(frame, rig)
        for column, values in expected.table.items():
            np.testing.assert_allclose(out.table[column], values, rtol=1e-9, atol=1e-15)


def addresses(batch):
    return [array.__array_interface__["data"][0] for array in batch]


def test_float64_columns_are_not_copied(columns, rig):
    from pitchleak import _inputs

    table, polar = pa.table(columns), polars.DataFrame(columns)
    in_pandas = pd.DataFrame(columns)
    for frame, arrays in (
        (columns, columns.values()),
        (in_pandas, [in_pandas[name].to_numpy() for name in columns]),
        (polar, [polar[name].to_numpy() for name in columns]),
        (table, [table[name].chunk(0).to_numpy() for name in columns]),
    ):
        (batch,) = _inputs.source(frame, rig).batches
        assert addresses(batch) == addresses(arrays)
    for whole, pieces in (
        (table, pa.concat_tables([table[:1500], table[1500:]])),
        (polar, polars.concat([polar[:1500], polar[1500:]], rechunk=False)),
    ):
        (batch,) = _inputs.source(whole, rig).batches
        first, second = _inputs.source(pieces, rig).batches
        assert addresses(first) == addresses(batch)
        assert addresses(second) == [address + 8 * 1500 for address in addresses(batch)]


def test_other_columns_may_hold_anything(columns, rig):
    note = np.array([object()] * len(columns["t_s"]))
    with pytest.warns(pl.TraceWarning, match="columns ignored: note"):
        out = pl.replay(columns | {"note": note}, rig)
    assert out.estimates == pl.replay(columns, rig).estimates


def test_a_result_in_every_form(columns, rig):
    out = pl.replay(columns, rig)
    assert out.verdict.faults == ("internal", "external_a")
    assert out.to_dict()["schema"] == "pitchleak.replay/1"
    assert "L/min" in str(out) and "both" not in repr(out)
    assert "<table>" in out._repr_html_() and "external A" in out._repr_html_()
    for table in (out.to_arrow(), out.to_pandas(), out.to_polars()):
        assert list(table.columns if not isinstance(table, pa.Table) else table.column_names) == list(out.table)
    assert len(out.plot().get_lines()) == 3 + len(out.alarms)


def test_a_verdict_says_what_to_check(columns, rig):
    sure = pl.replay(columns, rig)
    assert (sure.verdict.status, sure.verdict.sure, sure.verdict.reasons) == ("leak", True, ())
    assert str(sure).startswith(str(sure.verdict)) and repr(sure).endswith(f"{sure.verdict}>")
    assert [episode.fault for episode in sure.episodes] == [alarm.fault for alarm in sure.alarms]

    swapped = columns | {"qa_lpm": columns["qb_lpm"], "qb_lpm": columns["qa_lpm"]}
    out = pl.replay(swapped, rig)
    assert (out.verdict.status, out.verdict.sure, out.verdict.word) == ("doubtful", False, "DOUBTFUL")
    first = out.verdict.reasons[0]
    assert first.id == "wiring" and "qa and qb exchanged" in first.text and "[columns]" in first.suggestion
    assert first.text in out.verdict._repr_html_() and first.suggestion in out._repr_html_().replace("&quot;", '"')

    both = pl.replay([columns, swapped], rig)
    assert list(both.to_pandas()["status"]) == ["leak", "doubtful"]
    assert both.table["reasons"][1].startswith("wiring")
    assert repr(both) == "<Replays of 2 cylinders, leaks in 0, in doubt 1>"


def test_a_result_does_not_outlive_its_data(columns, rig):
    mine = {name: values.copy() for name, values in columns.items()}
    out = pl.replay(mine, rig)
    mine["qa_lpm"] += 1.0
    with pytest.raises(RuntimeError, match="changed since the replay"):
        out.to_pandas()


def test_many_cylinders(columns, rig):
    count = len(columns["t_s"])
    other = read_columns(ROOT / "data" / "traces" / "internal.csv.gz")
    other = {name: other[name] for name in columns}
    alone = {"left": pl.replay(columns, rig).raw, "right": pl.replay(other, rig).raw}
    by_list = pl.replay([columns, other], rig)
    assert [out.raw for out in by_list.values()] == list(alone.values())

    names = np.array(["left"] * count + ["right"] * len(other["t_s"]))
    both = {name: np.concatenate([columns[name], other[name]]) for name in columns} | {"blade": names}
    mixed = np.argsort(both["t_s"], kind="stable")
    mixed = {name: values[mixed] for name, values in both.items()}
    for data in (both, mixed):
        for frame in (data, pd.DataFrame(data), polars.DataFrame(data), pa.table(data)):
            out = pl.replay(frame, rig, group="blade")
            assert {key: each.raw for key, each in out.items()} == alone
    assert list(out.to_pandas()["faults"]) == ["internal, external_a", "internal"]
    assert "<table>" in out._repr_html_() and repr(out) == "<Replays of 2 cylinders, leaks in left, right>"
    with pytest.raises(KeyError, match="no column `turbine`"):
        pl.replay(both, rig, group="turbine")


def test_an_error_names_its_cylinder(columns, rig):
    bad = {name: values.copy() for name, values in columns.items()}
    bad["t_s"][7] = np.nan
    with pytest.raises(pl.TraceError, match="row 7, column `t_s`: missing") as error:
        pl.replay([columns, bad], rig, strict=True)
    assert error.value.__notes__ == ["in cylinder 1"]


def test_threads_do_not_wait_for_each_other(columns, rig):
    expected = pl.replay(columns, rig).raw
    results = [None] * 8

    def work(index):
        results[index] = pl.replay(columns, rig).raw

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(results))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(result == expected for result in results)


def test_rigs_compare_and_travel(rig):
    assert rig == pl.Rig.load(ROOT / "data" / "traces" / "rig.toml") != pl.Rig.paper()
    assert pickle.loads(pickle.dumps(rig)) == copy.deepcopy(rig) == rig
    with pytest.raises(pl.RigError, match=r"bad.toml:2: unknown key `cylinder.aera_a`"):
        pl.Rig.parse("[cylinder]\naera_a = '1 cm^2'", "bad.toml")
    with pytest.raises(FileNotFoundError) as error:
        pl.Rig.load("nowhere.toml")
    assert error.value.filename == "nowhere.toml"


def test_a_hold_is_judged_without_flows():
    trace = pl.simulate(
        position="100 mm", load="4 kN", shut="2 s..", leak_internal="0.0003 L/min/bar", noise="0.3 %", duration=12
    )
    rig = pl.Rig.paper().replace(accuracy="0.3 %")
    held = {name: values for name, values in trace.columns.items() if name not in ("qa_lpm", "qb_lpm")}
    out = pl.replay(held, rig)
    assert (out.verdict.status, out.verdict.faults) == ("leak", ("internal",))
    assert out.hold.ended_by == "trace" and out.hold.usable_s == pytest.approx(9.99)
    assert out.hold.leaks.internal.probability > 0.95
    shut = held["shut"] > 0.5
    true = np.abs(held["q_int_lpm"][shut]).mean()
    assert out.leakage.internal.mean_lpm == pytest.approx(true, abs=2.6 * out.leakage.internal.std_lpm)
    table = pytest.importorskip("pyarrow").table(held | {"shut": shut})
    for frame in (held | {"shut": shut}, table):
        assert pl.replay(frame, rig).raw == out.raw
    assert pl.check(held, rig).hold == out.hold
    with pytest.raises(ValueError, match="shut: `2 s` is no span of time"):
        pl.simulate(position="100 mm", load="4 kN", shut="2 s")
