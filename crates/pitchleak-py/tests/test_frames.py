"""A trace in whatever kind of frame it comes: the same numbers to the last bit, or a typed error."""

import sys
import warnings
from decimal import Decimal

import duckdb
import numpy as np
import pandas as pd
import polars
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pitchleak as pl


@pytest.fixture(scope="module")
def trace():
    return pl.simulate(13, leak_external_a="0.5 L/min", duration=10, noise="0.3 %").columns


@pytest.fixture(scope="module")
def expected(trace):
    return pl.replay(trace)


def same(out, expected):
    """All but the clock of the time stamps and the warnings about columns that nobody reads."""
    drop = ("warnings", "begins")
    left, right = out.to_dict(), expected.to_dict()
    return all(
        {key: value for key, value in one["trace"].items() if key not in drop}
        == {key: value for key, value in other["trace"].items() if key not in drop}
        and {key: value for key, value in one.items() if key != "trace"}
        == {key: value for key, value in other.items() if key != "trace"}
        for one, other in ((left, right),)
    )


def without_time(trace):
    return {name: values for name, values in trace.items() if name != "t_s"}


def stamps(trace):
    return pd.Timestamp("2026-05-01") + pd.to_timedelta(np.round(trace["t_s"] * 1e3), unit="ms")


def test_time_may_be_the_index(trace, expected):
    rest = without_time(trace)
    named = pd.DataFrame(rest, index=pd.Index(trace["t_s"], name="t_s"))
    nameless = pd.DataFrame(rest, index=pd.Index(trace["t_s"]))
    milliseconds = pd.DataFrame(rest, index=pd.Index(np.round(trace["t_s"] * 1e3), name="t_ms"))
    spans = pd.DataFrame(rest, index=pd.to_timedelta(np.round(trace["t_s"] * 1e3), unit="ms"))
    for frame in (named, nameless):
        assert same(pl.replay(frame), expected)
    exact = pl.replay(trace | {"t_s": np.round(trace["t_s"] * 1e3) / 1e3})
    for frame in (milliseconds, spans):
        out = pl.replay(frame)
        assert out.verdict.faults == exact.verdict.faults
        assert abs(out.leakage.external_a.mean_lpm - exact.leakage.external_a.mean_lpm) < 1e-9


def test_a_datetime_index_is_a_column_of_time_stamps(trace):
    rest = without_time(trace)
    stamped = pl.replay(rest | {"timestamp": stamps(trace).to_numpy()})
    assert stamped.trace.begins == "2026-05-01T00:00:00+00:00"
    for zone, begins in (
        (None, stamped.trace.begins),
        ("UTC", stamped.trace.begins),
        ("Europe/Berlin", "2026-04-30T22:00:00+00:00"),
    ):
        index = stamps(trace).tz_localize(zone)
        out = pl.replay(pd.DataFrame(rest, index=index))
        assert same(out, stamped) and out.trace.begins == begins
    night = pd.date_range("2026-10-25 00:59:55", periods=len(trace["t_s"]), freq="10ms", tz="UTC")
    through = pd.DataFrame(rest, index=night.tz_convert("Europe/Berlin"))
    assert pl.replay(through).trace.gaps == 0


def test_rows_that_are_only_counted_are_no_time(trace):
    rest = pd.DataFrame(without_time(trace))
    for frame in (
        rest,
        rest.set_index(rest.index.astype(str)),
        rest.set_index(pd.MultiIndex.from_arrays([rest.index] * 2)),
    ):
        with pytest.raises(pl.TraceError, match="no column for time"):
            pl.replay(frame)
    assert pl.replay(pd.DataFrame(trace, index=pd.Index(trace["t_s"] + 5.0))).trace.samples == len(trace["t_s"])


def test_tables_that_are_not_in_memory_yet(trace, expected, tmp_path):
    frame = polars.DataFrame(trace).with_columns(note=polars.lit("x"))
    frame.write_parquet(tmp_path / "t.parquet")
    relation = duckdb.from_arrow(frame.to_arrow())
    for lazy in (
        frame.lazy(),
        polars.scan_parquet(tmp_path / "t.parquet"),
        pyarrow.dataset.dataset(tmp_path / "t.parquet"),
        pa.table(frame).to_reader(),
        relation,
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pl.TraceWarning)
            assert same(pl.replay(lazy), expected)
    with pytest.raises(pl.TraceError, match="no column for time"):
        pl.replay(frame.lazy().drop("t_s"))
    with pytest.raises(polars.exceptions.ColumnNotFoundError):
        pl.replay(frame.lazy().select("t"))


@pytest.mark.parametrize(
    "write",
    [
        lambda frame, path: frame.write_parquet(path),
        lambda frame, path: frame.write_parquet(path, compression_level=19, row_group_size=300),
        lambda frame, path: frame.to_pandas().to_parquet(path),
        lambda frame, path: pyarrow.parquet.write_table(
            frame.to_arrow(), path, compression="zstd", data_page_version="2.0", data_page_size=1000
        ),
    ],
    ids=["polars", "polars, small groups", "pandas", "pyarrow, zstd in pages of version 2"],
)
def test_a_file_of_parquet_as_its_writer_writes_it(trace, expected, tmp_path, write):
    path = tmp_path / "t.parquet"
    write(polars.DataFrame(trace), path)
    read = pl.replay(path)
    assert (read.estimates, read.leakage) == (expected.estimates, expected.leakage)


@pytest.mark.parametrize("empty", [polars.DataFrame(), pd.DataFrame(), pa.table({}), {}, polars.LazyFrame()])
def test_a_frame_without_columns_is_a_trace_without_time(empty):
    with pytest.raises(pl.TraceError, match="no column for time"):
        pl.replay(empty)


def test_columns_of_any_number_type_without_a_copy_of_their_own(trace):
    rounded = {name: values.astype(np.float32) for name, values in trace.items()} | {"t_s": trace["t_s"]}
    expected = pl.replay({name: values.astype(np.float64) for name, values in rounded.items()})
    block = np.zeros((len(trace["t_s"]), 2 * len(trace)))
    strided = {}
    for place, (name, values) in enumerate(rounded.items()):
        block[:, 2 * place] = values
        strided[name] = block[:, 2 * place]
    backwards = {name: values[::-1].copy()[::-1] for name, values in rounded.items()}
    for data in (
        rounded,
        strided,
        backwards,
        pd.DataFrame(rounded),
        pd.DataFrame(block[:, ::2], columns=list(rounded)),
        polars.DataFrame(rounded),
        pa.table(rounded),
    ):
        assert same(pl.replay(data), expected)


class Capsule:
    """A table of a library that nobody knows, by its interface alone."""

    def __init__(self, table):
        self.table = table

    def __arrow_c_stream__(self, requested_schema=None):
        return self.table.__arrow_c_stream__(requested_schema)


def decimals(values):
    return pa.array([Decimal(str(value)) for value in values], pa.decimal128(20, 10))


@pytest.mark.parametrize(
    ("make", "rounding"),
    [
        (pa.array, 0.0),
        (lambda values: pa.array(values).dictionary_encode(), 0.0),
        (lambda values: pa.array(values.astype(np.float32)), 1e-7),
        (decimals, 1e-15),
        (
            lambda values: pa.chunked_array([pa.array(values[:10]), pa.array(values[10:11]), pa.array(values[11:])]),
            True,
        ),
    ],
    ids=["float64", "dictionary", "float32", "decimal", "cut at other rows"],
)
def test_arrow_columns_of_any_type_of_number(trace, make, rounding):
    read = make(trace["pa_bar"]).cast(pa.float64()).to_numpy(zero_copy_only=False)
    np.testing.assert_allclose(read, trace["pa_bar"], rtol=rounding)
    expected = pl.replay(trace | {"pa_bar": read})
    table = pa.table(trace | {"pa_bar": make(trace["pa_bar"])})
    for data in (table, table.combine_chunks().to_batches()[0], Capsule(table)):
        assert same(pl.replay(data), expected)


def test_polars_columns_of_any_type_of_number(trace):
    whole = trace | {"temp_c": np.full(len(trace["t_s"]), 40.0)}
    expected = pl.replay(whole)
    frame = polars.DataFrame(whole)
    for kind in (polars.Int8, polars.UInt64, polars.Int128, polars.Float32, polars.Decimal(10, 2)):
        assert same(pl.replay(frame.with_columns(polars.col("temp_c").cast(kind))), expected), kind
    cut = polars.concat([frame["pa_bar"][:7], frame["pa_bar"][7:]], rechunk=False)
    assert cut.n_chunks() == 2 and same(pl.replay(frame.with_columns(cut)), expected)
    missing = frame.with_columns(polars.Series("temp_c", [None] * len(frame)))
    assert same(pl.replay(missing), pl.replay(whole | {"temp_c": np.full(len(frame), np.nan)}))


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("zone", [None, "Europe/Berlin"])
def test_time_stamps_of_any_unit_and_zone(unit, zone):
    count = 300
    columns = {"x_m": np.full(count, 0.1), "pa_pa": np.full(count, 5e6), "pb_pa": np.full(count, 4e6)}
    seconds = np.arange(count) + np.datetime64("2026-10-25T00:58:00", "s")
    expected = pl.replay(columns | {"timestamp": seconds})
    late = [*seconds[:100].tolist(), None, *seconds[101:].tolist()]
    stamps = pa.array(seconds).cast(pa.timestamp(unit, zone))
    table = pa.table(columns | {"timestamp": stamps})
    frames = [table, Capsule(table)] if unit == "s" else [table, Capsule(table), polars.from_arrow(table)]
    for frame in frames:
        out = pl.replay(frame)
        assert same(out, expected) and out.trace.begins == "2026-10-25T00:58:00+00:00"
    with pytest.warns(pl.TraceWarning, match="row 100, column `timestamp`"):
        out = pl.replay(pa.table(columns | {"timestamp": pa.array(late, pa.timestamp(unit, zone))}))
    assert out.trace.skipped == 1


def test_times_beyond_nanoseconds_are_missing():
    times = np.array(["2026-01-01", "9999-01-01", "2026-01-01T00:00:01"], "datetime64[s]")
    columns = {"x_m": np.full(3, 0.1), "pa_pa": np.full(3, 5e6), "pb_pa": np.full(3, 4e6), "timestamp": times}
    for frame in (columns, pa.table(columns)):
        with pytest.warns(pl.TraceWarning, match="row 1, column `timestamp`"):
            assert pl.replay(frame).trace.skipped == 1


@pytest.mark.parametrize(
    ("data", "error", "words"),
    [
        (Capsule(pa.chunked_array([[1.0, 2.0]])), ValueError, "no table of columns: "),
        (pa.array([1.0, 2.0]), ValueError, "no table of columns: "),
        (pa.table([[1.0], [2.0]], names=["t_s", "t_s"]), ValueError, "`t_s`"),
        (pa.table({"timestamp": [1.0]}), pl.TraceError, "no column"),
        (pa.table({"timestamp": [1.0], "x_m": [1.0], "pa_pa": [1.0], "pb_pa": [1.0]}), TypeError, "timestamps are"),
        (pa.table({"t_s": [True], "x_m": [1.0], "pa_pa": [1.0], "pb_pa": [1.0]}), TypeError, "`t_s` holds bool"),
    ],
)
def test_arrow_that_is_no_trace(data, error, words):
    with pytest.raises(error, match=words) as raised:
        pl.replay(data)
    assert "\n" not in str(raised.value)


def test_without_pyarrow_polars_needs_nothing_and_others_say_what(trace, expected, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert same(pl.replay(polars.DataFrame(trace)), expected)
    with pytest.raises(ImportError, match="pitchleak\\[arrow\\]"):
        pl.replay(Capsule(polars.DataFrame(trace)))


KINDS = {
    "arrays": lambda columns: columns,
    "pandas": pd.DataFrame,
    "pandas with its nulls": lambda columns: pd.DataFrame(columns).astype("Float64"),
    "pandas over arrow": lambda columns: pa.table(columns, metadata=None).to_pandas(types_mapper=pd.ArrowDtype),
    "polars": lambda columns: polars.DataFrame(columns, nan_to_null=True),
    "polars in pieces": lambda columns: polars.concat(
        [polars.DataFrame(columns)[:7], polars.DataFrame(columns)[7:]], rechunk=False
    ),
    "lazy": lambda columns: polars.LazyFrame(columns),
    "arrow": lambda columns: pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()}),
    "dataset": lambda columns: pyarrow.dataset.dataset(pa.table(columns)),
    "duckdb": lambda columns: duckdb.from_arrow(pa.table(columns)),
}
READINGS = st.one_of(st.floats(-1.0, 1.0), st.just(np.nan), st.floats(allow_nan=True, allow_infinity=True))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.data())
def test_every_kind_of_frame_gives_the_same_or_a_typed_error(data):
    count = data.draw(st.integers(0, 30))
    base = {"t_s": 0.01 * np.arange(count), "x_m": 0.1, "pa_pa": 5e6, "pb_pa": 4e6, "qa_m3s": 1e-5, "qb_m3s": -1e-5}
    columns = {name: np.broadcast_to(value, count).astype(np.float64) for name, value in base.items()}
    if count:
        name = data.draw(st.sampled_from(sorted(columns)))
        columns[name][data.draw(st.integers(0, count - 1))] = data.draw(READINGS)
    outcomes = {}
    for kind, make in KINDS.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pl.TraceWarning)
            try:
                outcomes[kind] = pl.replay(make({name: values.copy() for name, values in columns.items()}))
            except pl.TraceError as error:
                outcomes[kind] = str(error)
    first = outcomes["arrays"]
    for kind, outcome in outcomes.items():
        assert type(outcome) is type(first), kind
        assert outcome == first if isinstance(first, str) else same(outcome, first), kind
