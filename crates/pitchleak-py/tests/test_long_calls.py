"""Long calls end soon after Ctrl-C, and say how far they are."""

import signal
import threading
import time

import numpy as np
import pytest

import pitchleak as pl


@pytest.fixture
def interruptible():
    """What a shell starts in the background ignores the signal, and so does its Python."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def long():
    """Eleven hours."""
    count = 4_000_000
    return {
        "t_s": np.arange(count) * 0.01,
        "x_m": 0.1 + 0.05 * np.sin(np.arange(count) * 0.01),
        "pa_pa": np.full(count, 5e6),
        "pb_pa": np.full(count, 4e6),
    }


CALLS = {
    "replay": lambda long, out: pl.replay(long),
    "over_time": lambda long, out: pl.replay(long).table,
    "replay of many": lambda long, out: pl.replay([long] * 6),
    "check": lambda long, out: pl.check(long),
    "diagnose": lambda long, out: pl.diagnose([long] * 6),
    "simulate": lambda long, out: pl.simulate(wind=13, duration=100_000, out=out),
    "reproduce": lambda long, out: pl.reproduce(100_000),
    "fleet": lambda long, out: pl.fleet(dict.fromkeys("abcdef", long)),
    "fleet, one after the other": lambda long, out: pl.fleet(dict.fromkeys("abcdef", long), map=map),
}


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="no signals to a thread of one's own")
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_control_c_ends_a_long_call(call, long, tmp_path, interruptible):
    """It was heeded after the call's end."""
    out = tmp_path / "trace.csv"
    main = threading.get_ident()
    asked = []

    def ask():
        asked.append(time.monotonic())
        signal.pthread_kill(main, signal.SIGINT)

    timer = threading.Timer(0.3, ask)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        call(long, out)
    # Within a second by the calls' design; other work on the machine may take more of it.
    assert time.monotonic() - asked[0] < 5
    assert not out.exists()


def collect(call):
    told = []
    call(lambda done, whole: told.append((done, whole)))
    return told


def test_progress_is_told_to_whoever_asks():
    trace = pl.simulate(13, duration=10, noise="0.1 %", progress=False).columns
    simulated = collect(lambda tell: pl.simulate(position="100 mm", load="2 kN", duration=60, progress=tell))
    assert all(0.0 <= done <= whole == 1.0 for done, whole in simulated)
    assert simulated[-1] == (1.0, 1.0), "the end is told, however short the call was"
    assert [done for done, _ in simulated] == sorted(done for done, _ in simulated)
    assert collect(lambda tell: pl.replay([trace, trace], progress=tell)) == [(1, 2), (2, 2)]
    fits = collect(lambda tell: pl.diagnose(trace, progress=tell))
    assert fits and all(np.isnan(whole) for _, whole in fits)


def test_what_progress_raises_ends_the_call():
    def enough(done, whole):
        raise LookupError("enough")

    for call in (
        lambda: pl.simulate(position="100 mm", load="2 kN", duration=1e6, progress=enough),
        lambda: pl.reproduce(1000, progress=enough),
        lambda: pl.fleet({"a": {"t_s": [0.0]}}, progress=enough),
    ):
        with pytest.raises(LookupError, match="enough"):
            call()
