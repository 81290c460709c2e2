"""A trace in parts is the trace."""

import pickle
import re
import threading

import numpy as np
import pytest

import pitchleak as pl


@pytest.fixture(scope="module")
def si(columns):
    """The trace in SI, as `update` takes it."""
    return {
        "t": columns["t_s"],
        "x": columns["x_mm"] / 1e3,
        "pa": columns["pa_bar"] * 1e5,
        "pb": columns["pb_bar"] * 1e5,
        "qa": columns["qa_lpm"] / 60e3,
        "qb": columns["qb_lpm"] / 60e3,
        "force": columns["force_n"],
    }


@pytest.fixture(scope="module")
def whole(si, rig):
    headers = ("t_s", "x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s", "force_n")
    return pl.replay(dict(zip(headers, si.values(), strict=True)), rig)


def test_samples_one_by_one(si, rig, whole):
    est = pl.Estimator(rig)
    renewals = sum(est.update(*row[:6], force=row[6]) for row in zip(*si.values(), strict=True))
    assert est.state() == whole
    assert renewals == len(np.flatnonzero(np.diff(whole.table["internal_leak_coefficient"])))
    assert est.time_s == si["t"][-1]


@pytest.mark.parametrize("part", [1, 2, 7, 1000, 10**6])
def test_arrays_of_any_length(part, si, rig, whole):
    est = pl.Estimator(rig)
    for start in range(0, len(si["t"]), part):
        rows = {name: values[start : start + part] for name, values in si.items()}
        est.update(**rows)
    assert est.state() == whole


def test_frames(columns, rig):
    est = pl.Estimator(rig)
    for rows in (slice(0, 100), slice(100, 101), slice(101, None)):
        est.extend({name: values[rows] for name, values in columns.items()})
    assert est.state() == pl.replay(columns, rig)
    assert repr(est).endswith("at 39.990 s>")


def test_time_stamps_count_from_the_first_part(columns, rig):
    stamps = np.datetime64("2026-11-20T22:10:31") + np.arange(len(columns["t_s"])) * np.timedelta64(10, "ms")
    frame = {"timestamp": stamps} | {name: values for name, values in columns.items() if name != "t_s"}
    est = pl.Estimator(rig)
    for rows in (slice(0, 100), slice(100, None)):
        est.extend({name: values[rows] for name, values in frame.items()})
    assert est.state() == pl.replay(frame, rig)


@pytest.mark.parametrize("estimator", ["rls", "paper"])
@pytest.mark.parametrize("sensors", ["", "bias = 0.01", "bias = 0.01, gain = 0.01"])
def test_a_saved_estimator_goes_on_as_if_nothing_had_been(estimator, sensors, columns, tmp_path):
    text = pl.Rig.paper().to_toml()
    if sensors:
        text = text.replace("bias = 0.0, gain = 0.0", sensors)
    rig = pl.Rig.parse(text + "[effects]\nposition_gain = { value = 0.01, std = 0.002 }\n")
    whole = pl.replay(columns, rig, estimator=estimator)
    path = tmp_path / "blade1.state"
    pl.Estimator(rig, estimator=estimator, strict=True).save(path)
    for start in range(0, 4000, 617):
        est = pl.Estimator.load(path)
        est.extend({name: values[start : start + 617] for name, values in columns.items()})
        est.save(path)
    assert pl.Estimator.load(path).state() == whole
    assert pickle.loads(pickle.dumps(est)).state() == whole
    assert est.strict and [file.name for file in tmp_path.iterdir()] == ["blade1.state"]


def test_a_file_that_is_no_state_is_refused(rig, tmp_path):
    est = pl.Estimator(rig)
    est.update(0.0, 0.1, 5e6, 4e6)
    saved = est.saved()
    for bad in (b"", b"hello", saved[:100], saved[:-1], saved + b"\0", re.sub(rb"state/\d+", b"state/0", saved)):
        with pytest.raises(ValueError, match="saved"):
            pl.Estimator.from_bytes(bad)
    with pytest.raises(ValueError, match="another rig"):
        pl.Estimator(pl.Rig.paper()).restore(saved)


def test_what_is_not_plain_is_made_so(si, rig, whole):
    est = pl.Estimator(rig)
    est.update(**{name: values.tolist() for name, values in si.items()})
    assert est.state() == whole
    est = pl.Estimator(rig)
    est.update(**{name: np.repeat(values, 3)[::3] for name, values in si.items()})
    assert est.state() == whole
    unaligned = {}
    for name, values in si.items():
        memory = np.zeros(8 * len(values) + 1, np.uint8)
        shifted = memory[1:].view(np.float64)
        shifted[:] = values
        unaligned[name] = shifted
    est = pl.Estimator(rig)
    est.update(**unaligned)
    assert est.state() == whole


def test_bad_samples(rig):
    est = pl.Estimator(rig)
    with pytest.raises(ValueError, match="no sample yet"):
        est.state()
    est.update(0.0, np.nan, 5e6, 4e6)
    est.update(0.01, 0.1, 5e6, 4e6)
    assert (est.state().trace.samples, est.state().trace.skipped) == (1, 1)
    strict = pl.Estimator(rig, strict=True)
    strict.update(0.0, 0.1, 5e6, 4e6, 1e-5, 1e-5)
    with pytest.raises(pl.TraceError, match="row 1, column `t_s`: 0 s is not after 0 s") as error:
        strict.update(0.0, 0.1, 5e6, 4e6, 1e-5, 1e-5)
    assert (error.value.column, error.value.row, error.value.line) == ("t_s", 1, None)
    with pytest.raises(pl.TraceError, match="column `x_m` has 2 rows, `t_s` has 3"):
        strict.update(np.arange(3.0), np.zeros(2), np.zeros(3), np.zeros(3))
    with pytest.raises(TypeError, match="column `x_m`, row 0: str where a number is expected"):
        strict.update([0.1], np.array(["much"], object), [5e6], [4e6])


def test_an_estimator_is_shared_by_threads(si, rig):
    est = pl.Estimator(rig)
    rows = {name: values[:1000] for name, values in si.items()}

    def work():
        for _ in range(20):
            est.update(**rows)
            est.state()

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    trace = est.state().trace
    assert trace.samples + trace.skipped == 80 * 1000


def test_saves_from_many_threads_leave_a_whole_file(columns, tmp_path):
    """They shared one temporary: the file was torn, or gone."""
    path = tmp_path / "cylinder.state"
    estimators = [pl.Estimator(pl.Rig.paper()) for _ in range(4)]
    for count, est in enumerate(estimators):
        est.extend({name: values[: 100 * (count + 1)] for name, values in columns.items()})
    failures = []

    def save(est):
        try:
            for _ in range(20):
                est.save(path)
                pl.Estimator.load(path)
        except Exception as failure:
            failures.append(failure)

    threads = [threading.Thread(target=save, args=(est,)) for est in estimators]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_outputs_that_cannot_be_written(tmp_path):
    with pytest.raises(FileNotFoundError, match="absent"):
        pl.Estimator().save(tmp_path / "absent" / "cylinder.state")
    with pytest.raises(FileNotFoundError, match="absent"):
        pl.simulate(wind=13, duration=10, out=tmp_path / "absent" / "trace.csv")
    source = tmp_path / "x.csv"
    source.write_text("t_s,x_mm\n0,50\n5,60\n")
    with pytest.raises(ValueError, match="input"):
        pl.simulate(position=str(source), load="2 kN", duration=10, out=source)
    assert source.read_text().startswith("t_s,x_mm")
