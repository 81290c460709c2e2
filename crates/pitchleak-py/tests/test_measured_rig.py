"""The script that makes traces of the measured rig, on made-up counts."""

import gzip
import importlib.util

from conftest import ROOT

COUNTS = {0: 5, 2: 110, 3: 250, 10: -600, 13: 40, 14: 20}


def load():
    spec = importlib.util.spec_from_file_location("measured_rig", ROOT / "examples" / "measured_rig.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_counts_become_si_and_the_valve_says_which_chamber_is_fed(tmp_path):
    rows = [[{**COUNTS, 16: valve}.get(column, 0) for column in range(17)] for valve in (1000, -1000, 0)]
    raw = tmp_path / "raw.csv"
    raw.write_text("header\n" + "".join(";".join(map(str, row)) + "\n" for row in rows))
    load().convert(raw, tmp_path / "trace.csv.gz")
    with gzip.open(tmp_path / "trace.csv.gz", "rt") as file:
        header, *lines = file.read().splitlines()
    assert header == "t_s,x_m,pa_pa,pb_pa,qa_m3s,qb_m3s,pump_rps,x_ref_m"
    flows = ["1.6e-05,", ",1.6e-05", ","]
    assert lines == [f"0.005,0.000500,625000,60700,{flow},-10,0.001000" for flow in flows]


def test_the_rig_is_one(tmp_path):
    import pitchleak as pl

    (tmp_path / "rig.toml").write_text(load().RIG)
    assert pl.Rig.load(tmp_path / "rig.toml").to_toml()
