"""Leaks without flow meters: the valve's flows stand for them."""

from pathlib import Path

import pytest

import pitchleak as pl

RIG = """
[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "200 mm"
moving_mass = "60 kg"
dead_volume_a = "50 mL"
dead_volume_b = "50 mL"
[fluid]
bulk_modulus = "0.8 GPa"
[sensors]
pressure = { full_scale = "160 bar", accuracy = "0.3 %" }
position = { full_scale = "200 mm", accuracy = "0.3 %" }
spool = { accuracy = "0.3 %" }
[valve]
rated_flow = "4 L/min"
rated_drop = "35 bar"
"""


def rig(folder: Path, more: str = "") -> pl.Rig:
    path = folder / "rig.toml"
    path.write_text(RIG + more)
    return pl.Rig.load(path)


def test_a_leak_is_found_by_the_valves_flows_and_a_calibration_tells_external_ones(tmp_path: Path) -> None:
    plain = rig(tmp_path)
    leaking = pl.simulate(13, plain, leak_internal="0.002 L/min/bar", noise="rig")
    assert "spool_percent" in leaking.columns and "qa_lpm" not in leaking.columns
    found = pl.replay(leaking.columns, plain)
    assert found.verdict.status == "leak" and found.verdict.faults == ("internal",)
    assert found.valve is not None and found.valve.calibrated is None and found.valve.leaks is not None
    assert found.valve.leaks.internal.probability > 0.95
    checked = pl.check(leaking.columns, plain)
    assert checked.valve is not None

    then = pl.simulate(13, plain, noise="rig", seed=3, duration="200 s", valve=["clearance=0.02 L/min"])
    calibration = pl.calibrate(then.columns, plain, leaks="unknown")
    assert calibration.seconds == pytest.approx(199.99) and calibration.scatter == pytest.approx(1, abs=0.05)
    assert "changes since today" in str(calibration)
    path = str(tmp_path / "then.csv")
    pl.simulate(13, plain, noise="rig", seed=3, duration="200 s", valve=["clearance=0.02 L/min"], out=path)
    with pytest.warns(pl.TraceWarning, match=r"then\.csv is given twice: it is read once"):
        assert pl.calibrate([path, path], plain, leaks="unknown").seconds == pytest.approx(199.99)
    still = {"position": "100 mm", "load": "4 kN", "shut": "2 s..", "duration": "12 s", "noise": "rig"}
    hold = pl.simulate(rig=plain, **still).columns
    with pytest.warns(pl.TraceWarning, match="with it they are `zero`"):
        pl.calibrate(then.columns, plain, leaks="unknown", evidence=hold)
    calibration.save(tmp_path / "valve.toml")
    calibrated = rig(tmp_path, 'calibration = "valve.toml"\n')
    now = pl.simulate(21, calibrated, noise="rig", seed=4, valve="clearance=0.02 L/min", leak_external_a="0.1 L/min")
    without_pb = {name: column for name, column in now.columns.items() if name != "pb_bar"}
    blind = pl.replay(without_pb, calibrated)
    assert blind.valve is not None and blind.valve.unread == "pb"
    external = pl.replay(now.columns, calibrated)
    assert external.verdict.faults == ("external_a",)
    assert external.leakage.external_a.since == calibration.date and external.leakage.internal.since is None


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    plain = rig(tmp_path)
    trace = pl.simulate(13, noise="1 %", duration=5).columns
    with pytest.raises(ValueError, match=r"has no \[valve\]"):
        pl.calibrate(trace, leaks="zero")
    with pytest.raises(ValueError, match="spool_percent"):
        pl.calibrate(trace, plain, leaks="zero")
    with pytest.raises(ValueError, match="is no evidence that nothing leaks"):
        pl.calibrate(trace, plain, leaks="zero", evidence=trace)
    with pytest.raises(ValueError, match="neither zero nor unknown"):
        pl.calibrate(trace, plain, leaks="none")
    with pytest.raises(ValueError, match="droop=2 bar"):
        pl.simulate(13, plain, valve=["lag=2 ms"], duration=1)
    with pytest.raises(ValueError, match="no \\[valve\\]"):
        pl.simulate(13, valve=["droop=2 bar"], duration=1)
