"""Simulation, check, diagnosis, reproduction, linkage: what the program gives, as objects."""

import copy
import json
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
from conftest import TRACES, read_columns

import pitchleak as pl


def test_simulate_is_the_programs(program, tmp_path):
    arguments = ("--wind", 13, "--leak-internal", "0.5 L/min", "--noise", "1 %", "--seed", 7, "--duration", "5 s")
    path = tmp_path / "program.csv.gz"
    program("simulate", *arguments, "--effect", "position_gain=0.02", "--out", path)
    options = {
        "leak_internal": "0.5 L/min",
        "noise": 0.01,
        "seed": 7,
        "duration": 5,
        "effects": {"position_gain": 0.02},
    }
    simulation = pl.simulate(13, **options)
    for name, values in read_columns(path).items():
        np.testing.assert_array_equal(simulation.columns[name], values)
    assert simulation.raw == json.loads((tmp_path / "program.json").read_text())
    pl.simulate(13, **options, out=tmp_path / "ours.csv.gz")
    for ending in (".csv.gz", ".json"):
        assert (tmp_path / f"ours{ending}").read_bytes() == (tmp_path / f"program{ending}").read_bytes()
    assert len(simulation.plot().axes) == 3 and "<table>" in simulation._repr_html_()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "give either wind, or both position and load"),
        ({"wind": "nowhere.outb"}, "nowhere.outb"),
        ({"wind": 13, "leak_internal": "1 bar"}, "leak_internal: .*L/min"),
        ({"wind": 13, "effects": {"gremlins": 1.0}}, "`gremlins`: "),
        ({"wind": 13, "noise": "loud"}, "noise: .*`none`, or `rig`"),
        ({"wind": 13, "duration": -1}, "duration: must not be negative"),
    ],
)
def test_simulate_names_the_argument(arguments, words):
    with pytest.raises(ValueError, match=words):
        pl.simulate(**arguments)


def test_check_is_the_programs(program):
    ours = json.loads(program("check", TRACES[0], "--json"))
    checked = pl.check(TRACES[0])
    assert checked.raw == ours
    assert checked.leaks.internal.identifiable and list(checked.to_pandas()["signal"])[:2] == ["x", "pa"]
    assert "<table>" in checked._repr_html_() and str(checked).startswith("trace  ")


def test_diagnose_is_the_programs(program, tmp_path):
    path = tmp_path / "trace.csv.gz"
    rig_file = tmp_path / "rig.toml"
    rig_file.write_text(pl.Rig.paper().to_toml().replace("accuracy = 0.01", "accuracy = 0.001"))
    pl.simulate(21, noise="0.1 %", effects={"coulomb_friction": 300.0}, seed=3, duration=60, out=path)
    ours = json.loads(program("diagnose", path, "--json", "--save-rig", tmp_path / "mended.toml"))
    found = pl.diagnose(read_columns(path), pl.Rig.load(rig_file))
    assert found.raw == ours == pl.diagnose([path]).raw
    assert found.effects[0].id == "coulomb_friction"
    assert found.rig.effects.keys() == pl.Rig.load(tmp_path / "mended.toml").effects.keys()
    assert found.after.rmse.force_n < 0.1 * found.before.rmse.force_n
    assert len(found.plot().axes) == 3 and "coulomb_friction" in found._repr_html_()
    before, after = found.residuals_before["force_n"], found.residuals_after["force_n"]
    assert len(before.t_s) == len(before.residual) and np.std(after.residual) < 0.1 * np.std(before.residual)
    assert found.effects[0].confident and found.effects[0].doubt is None
    assert found.wiring is None and found.samples.read == found.samples.fitted == len(read_columns(path)["t_s"])
    assert pl.diagnose(path, test=[read_columns(path)]).effects[0].id == "coulomb_friction"
    with pytest.raises(ValueError, match="both fitted and judged on"):
        pl.diagnose(path, test=[path])
    with pytest.warns(pl.TraceWarning, match="given twice"):
        assert pl.diagnose([path, path]).raw == ours
    assert list(found.to_polars()["id"]) == [effect.id for effect in found.effects]


def test_diagnose_names_a_mistake_of_wiring():
    columns = dict(pl.simulate(21, noise="0.3 %", duration=60).columns)
    qa, qb = (next(name for name in columns if name.startswith(flow)) for flow in ("qa_", "qb_"))
    found = pl.diagnose(columns | {qa: columns[qb], qb: columns[qa]})
    assert isinstance(found.wiring, pl.Wiring) and "qa and qb exchanged" in found.wiring.suggestion
    assert found.wiring.residual_before > 3 * found.wiring.residual_after
    assert found.effects == () and found.raw["wiring"]["suggestion"] in str(found)


FORKED = """
import multiprocessing, sys
import pitchleak as pl

def diagnosed(path):
    return pl.diagnose([path]).raw

if __name__ == "__main__":
    before = diagnosed(sys.argv[1])
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(diagnosed, (sys.argv[1],)).get(timeout=100) == before
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_a_forked_process_diagnoses_too(tmp_path):
    path, script = tmp_path / "trace.csv", tmp_path / "forked.py"
    pl.simulate(21, noise="1 %", duration=5, out=path)
    script.write_text(FORKED)
    subprocess.run([sys.executable, script, path], check=True, timeout=200)


def test_reproduce_is_the_programs(program, tmp_path):
    told = []
    table = pl.reproduce(1, out=tmp_path, progress=lambda done, whole: told.append((done, whole)))
    assert told and all(0 < done <= whole for done, whole in told)
    page = tmp_path / "page.html"
    assert table.raw == json.loads(program("reproduce", "--seeds", 1, "--json", "--report", page))
    assert table.to_html() == page.read_text() == pickle.loads(pickle.dumps(table)).to_html()
    assert list(tmp_path.glob("*.svg"))
    assert len(table.to_pandas()) == len(table.rows) == 32
    assert table.plot().get_yscale() == "log" and "<table>" in table._repr_html_()
    assert json.loads(table.to_json()) == table.to_dict() == table.raw
    assert pickle.loads(pickle.dumps(table)).rows == copy.deepcopy(table).rows == table.rows
    with pytest.raises(ValueError, match="at least 1"):
        pl.reproduce(0)


def test_linkage():
    linkage = pl.Linkage()
    pitch = np.radians(np.linspace(2.4, 90.0, 12).reshape(3, 4))
    position = linkage.position_m(pitch)
    assert position.shape == (3, 4) and position[1, 2] == linkage.position_m(pitch[1, 2])
    np.testing.assert_allclose(linkage.pitch_rad(position), pitch, atol=1e-9)
    np.testing.assert_array_equal(linkage.position_m(pitch.T), position.T)
    torque = linkage.torque_nm(0.5, 1e4)
    assert math.isclose(torque, 1e4 * linkage.arm_m(0.5)) and math.isclose(linkage.force_n(0.5, torque), 1e4)
    with pytest.raises(ValueError, match=r"\[1\]: the linkage cannot reach this pitch angle"):
        linkage.position_m(np.array([0.5, 0.0]))
    with pytest.raises(ValueError, match="lengths of the linkage must be positive"):
        pl.Linkage(crank_radius_m=-1.0)
