"""Whatever comes in: a right answer or an exception that names column and row."""

import threading
import time
import warnings

import hypothesis.extra.numpy as hnp
import numpy as np
import pandas as pd
import polars
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import pitchleak as pl

HEADERS = ("t_s", "x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s")
SOUND = {"t_s": 0.0, "x_m": 0.1, "pa_pa": 5e6, "pb_pa": 4e6, "qa_m3s": 1e-5, "qb_m3s": -1e-5}
SIGNALS = {"t", "timestamp", "x", "v", "pa", "pb", "qa", "qb", "force", "temp", "q"}
EXPECTED = (TypeError, ValueError)  # TraceError is a ValueError


def sound(count):
    columns = {name: np.full(count, value) for name, value in SOUND.items()}
    return columns | {"t_s": np.arange(count) * 0.01}


def try_all(columns):
    """Every entry takes the columns or refuses them; all agree which, and none breaks."""
    outcomes = []
    estimator = pl.Estimator(pl.Rig.paper())
    for use in (pl.replay, pl.check, estimator.extend):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pl.TraceWarning)
            try:
                outcomes.append(use(columns))
            except EXPECTED as error:
                assert "\n" not in str(error)
                outcomes.append(None)
    replayed, checked, _ = outcomes
    assert (replayed is None) == (checked is None)
    if replayed is not None:
        # A row that lacks a reading may lie between two that have it: it is neither a sample nor bad.
        assert replayed.trace.samples + replayed.trace.skipped <= np.size(columns["t_s"])
        assert estimator.state().raw == replayed.raw
    return replayed


DTYPES = st.one_of(
    hnp.floating_dtypes(endianness="?"),
    hnp.integer_dtypes(endianness="?"),
    hnp.unsigned_integer_dtypes(),
    hnp.boolean_dtypes(),
    hnp.complex_number_dtypes(),
    hnp.datetime64_dtypes(),
    hnp.byte_string_dtypes(max_len=4),
    hnp.unicode_string_dtypes(max_len=4),
    st.just(np.dtype(object)),
)
SHAPES = hnp.array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=30)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.sampled_from(HEADERS), DTYPES.flatmap(lambda dtype: hnp.arrays(dtype, SHAPES)))
def test_any_array_in_place_of_a_column(header, array):
    try_all(sound(array.shape[0] if array.ndim else 1) | {header: array})


FLOATS = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 40).flatmap(lambda n: st.tuples(*[hnp.arrays(np.float64, n, elements=FLOATS)] * 6)))
def test_any_numbers(values):
    out = try_all(dict(zip(HEADERS, values, strict=True)))
    if out is not None:
        assert all(np.isfinite(out.table["t_s"]))


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_views_give_what_their_copies_give(data):
    count = data.draw(st.integers(2, 60))
    base = sound(count)
    for name in HEADERS[1:]:
        noise = data.draw(hnp.arrays(np.float64, count, elements=st.floats(-0.1, 0.1)))
        base[name] = base[name] * (1.0 + noise)
    expected = pl.replay(base)

    def view(values):
        step = data.draw(st.integers(1, 3))
        wide = np.full(step * count, np.nan)
        wide[::step] = values
        shown = wide[::step]
        shown.flags.writeable = data.draw(st.booleans())
        return shown

    views = {name: view(values) for name, values in base.items()}
    assert pl.replay(views).raw == expected.raw
    estimator = pl.Estimator(pl.Rig.paper())
    estimator.update(*views.values())
    assert estimator.state().raw == expected.raw


@settings(max_examples=100, deadline=None)
@given(st.lists(st.text(max_size=6), max_size=5, unique=True))
def test_any_headers(names):
    columns = {name: np.zeros(3) for name in names}
    with pytest.raises(pl.TraceError, match=r"no column for time|unknown unit"):
        pl.replay(columns)
    others = {name: np.zeros(1) for name in names if name not in SOUND}
    if not SIGNALS & {name.partition("_")[0] for name in others}:
        assert try_all(sound(3) | others) is not None


@settings(max_examples=200, deadline=None)
@given(st.lists(st.one_of(FLOATS, st.integers(), st.none()), min_size=9, max_size=9))
def test_any_sample(readings):
    estimator = pl.Estimator(pl.Rig.paper())
    *positional, force, v, temp = readings
    try:
        estimator.update(*positional, force=force, v=v, temp=temp)
    except (*EXPECTED, OverflowError):
        return
    trace = estimator.state().trace
    assert trace.samples + trace.skipped == 1


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"x_m": np.zeros(3)}, pl.TraceError, r"column `x_m` has 3 rows, `t_s` has 5: all must be of one length"),
        ({"x_m": np.zeros((5, 2))}, ValueError, "column `x_m` has 2 dimensions; one is expected"),
        ({"x_m": np.array([True] * 5)}, TypeError, "column `x_m` holds bool; numbers are expected"),
        ({"x_m": np.array(["much"] * 5)}, TypeError, "column `x_m` holds <U4; numbers are expected"),
        (
            {"x_m": np.array([0.1, "much", 0.1, 0.1, 0.1], object)},
            TypeError,
            "column `x_m`, row 1: str where a number is expected",
        ),
        ({"t_s": np.array([0, 0.01, np.nan, 0.03, 0.04])}, pl.TraceError, "row 2, column `t_s`: missing"),
        ({"qa_m3s": np.array([0, 0, 0, np.inf, 0])}, pl.TraceError, "row 3, column `qa_m3s`: not a finite number"),
        ({"t_s": np.zeros(5)}, pl.TraceError, "row 1, column `t_s`: 0 s is not after 0 s"),
        ({"pa_atm": np.zeros(5)}, pl.TraceWarning, "columns ignored: pa_atm"),
    ],
)
def test_an_error_names_column_and_row(change, error, words):
    frame = sound(5) | change
    with pytest.raises(error, match=words):
        pl.replay(frame, strict=True)


def test_an_error_carries_column_and_row():
    frame = sound(5) | {"x_m": np.array([0.1, 0.1, 5.0, 0.1, 0.1])}
    with pytest.raises(pl.TraceError, match="outside the stroke") as error:
        pl.replay(pd.DataFrame(frame), strict=True)
    assert (error.value.column, error.value.row, error.value.line) == ("x_m", 2, None)
    with pytest.warns(pl.TraceWarning, match=r"1 of 5 rows skipped .* row 2, column `x_m`"):
        assert pl.replay(frame).trace.skipped == 1


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (pa.table(sound(3) | {"x_m": ["a", "b", "c"]}), "column `x_m` holds string; numbers are expected"),
        (polars.DataFrame(sound(3) | {"x_m": [True, False, None]}), "column `x_m` holds Boolean"),
        (pd.DataFrame({0: [1.0]}), "column names are texts such as `t_s`; 0 is none"),
        (42, "int is no trace"),
        (None, "NoneType is no trace"),
    ],
)
def test_what_is_no_trace_is_refused(data, words):
    with pytest.raises(TypeError, match=words):
        pl.replay(data)


def test_files_that_are_not_there():
    with pytest.raises(FileNotFoundError) as error:
        pl.replay("nowhere.csv")
    assert error.value.filename == "nowhere.csv"
    with pytest.raises(ValueError, match="estimator `best`: must be rls or paper"):
        pl.replay(sound(3), estimator="best")


def test_nothing_at_all():
    for frame in (sound(0), pd.DataFrame(sound(0)), pa.table(sound(0)), polars.DataFrame(sound(0))):
        with pytest.raises(pl.TraceError, match="no usable row"):
            pl.replay(frame)
    assert pl.Estimator(pl.Rig.paper()).extend(sound(0)) == 0


def test_an_array_that_is_read_keeps_its_memory(rig):
    """Another thread that resized a column, `refcheck=False`, once ended the process."""
    count = 400_000
    columns = {
        "t_s": np.arange(count) * 0.01,
        "x_m": np.full(count, 0.1),
        "pa_pa": np.full(count, 5e6),
        "pb_pa": np.full(count, 4e6),
    }
    refused, stop = [], threading.Event()

    def resize():
        while not stop.is_set():
            time.sleep(0.001)  # All of one length: the replay can begin.
            for column in columns.values():
                try:
                    column.resize(2 * count, refcheck=False)
                    column.resize(count, refcheck=False)
                except ValueError as failure:
                    refused.append(failure)

    ends_s = time.monotonic() + 60
    while not refused and time.monotonic() < ends_s:
        thread = threading.Thread(target=resize)
        stop.clear()
        thread.start()
        try:
            pl.replay(columns, rig)
        except ValueError:
            pass  # Caught between two sizes.
        finally:
            stop.set()
            thread.join()
    assert refused
