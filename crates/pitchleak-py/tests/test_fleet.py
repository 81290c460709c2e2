"""Fleets: the program's rows, whichever map makes them; and months of them."""

import csv
import gzip
import json
import multiprocessing
import pickle
import shutil
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import cloudpickle
import fsspec
import numpy as np
import pandas as pd
import polars
import pyarrow as pa
import pyarrow.compute as arrow
import pyarrow.parquet
import pytest
from conftest import ROOT, TRACES, read_columns
from fsspec.generic import rsync

import pitchleak as pl


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    """Two turbines with two blades, a day each, as text."""
    farm = tmp_path_factory.mktemp("farm")
    for trace, cylinder in zip(TRACES, ("T1/B1", "T1/B2", "T2/B1", "T2/B2"), strict=True):
        folder = farm / cylinder
        folder.mkdir(parents=True)
        (folder / "2026-05-01.csv").write_bytes(gzip.decompress(trace.read_bytes()))
        shutil.copy(ROOT / "data" / "traces" / "rig.toml", folder)
    return farm


@pytest.fixture(scope="module")
def found(farm):
    return pl.fleet(f"{farm}/**/*.csv", progress=False)


def test_rows_are_those_of_the_program(farm, found, program, tmp_path):
    out = tmp_path / "fleet.csv"
    raw = json.loads(program("fleet", f"{farm}/**/*.csv", "--out", out, "--json"))
    assert found.to_dict() == raw
    with open(out, newline="") as file:
        header, *lines = csv.reader(file)
    assert header == list(found.table)
    internal = header.index("internal_lpm")
    assert [float(line[internal]) for line in lines] == found.table["internal_lpm"].tolist()
    found.save(tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == out.read_bytes()


def test_rows_are_what_replay_says(found):
    for row in found.rows:
        out = pl.replay(row.path)
        assert (row.status, row.faults, row.samples) == (out.verdict.status, out.verdict.faults, out.trace.samples)
        for leak, flow in out.leakage.items():
            of = getattr(row.leaks, leak)
            assert (of.mean_lpm, of.std_lpm) == (flow.mean_lpm, flow.std_lpm)
            assert of.trend == getattr(out.trend, leak)
        assert row.begins == "2026-05-01T00:00:00Z"
    assert [row.cylinder[-5:] for row in found.rows] == ["T1/B1", "T1/B2", "T2/B1", "T2/B2"]


def test_a_fleet_teaches_odds(farm, found, program, tmp_path):
    raw = json.loads(program("fleet", f"{farm}/**/*.csv", "--odds", "--json"))["odds"]
    assert [(one.id, one.share) for one in found.odds.shares] == [(one["id"], one["share"]) for one in raw["shares"]]
    assert found.odds.cylinders == 4
    assert found.rows[0].explanations[0].probability > 0.5
    rig = tmp_path / "rig.toml"
    rig.write_text((ROOT / "data" / "traces" / "rig.toml").read_text() + str(found.odds))
    taught = pl.fleet(f"{farm}/T1/B1/*.csv", rig, progress=False)
    assert taught.rows[0].odds["as_declared"] == pytest.approx(
        next(one.share for one in found.odds.shares if one.id == "as_declared"), abs=1e-4
    )


def with_joblib(work, items):
    joblib = pytest.importorskip("joblib")
    return joblib.Parallel(n_jobs=2)(joblib.delayed(work)(item) for item in items)


def test_a_table_grows_by_what_is_new(farm, found, program, tmp_path):
    nights, asked = tmp_path / "nights", []

    def counted(function, jobs):
        asked.append(len(jobs))
        return map(function, jobs)

    first = pl.fleet(f"{farm}/T1/**/*.csv", table=nights, map=counted)
    again = pl.fleet(f"{farm}/**/*.csv", table=nights, map=counted)
    assert asked == [2, 2] and len(first.rows) == 2
    assert sorted(again.table["internal_lpm"]) == pytest.approx(sorted(found.table["internal_lpm"]), rel=1e-14)
    # The program knows what Python has judged; any reader reads it.
    assert len(json.loads(program("fleet", f"{farm}/**/*.csv", "--table", nights, "--json"))["rows"]) == 4
    assert len(list(nights.glob("day=*/*.parquet"))) == 2
    assert sorted(pd.read_parquet(nights)["cylinder"]) == sorted(found.table["cylinder"])
    with pytest.raises(TypeError, match=r"^table: takes traces that are files, `B1`"):
        pl.fleet({"B1": read_columns(TRACES[0])}, table=nights)


def test_a_bucket_is_mirrored_and_each_night_reads_what_is_new(farm, found, tmp_path):
    """As docs/fleet.md says: a file that is there already stays as it is, and so is not read again."""
    bucket, asked = fsspec.filesystem("memory"), []

    def counted(function, jobs):
        asked.append(len(jobs))
        return map(function, jobs)

    def night(turbine):
        bucket.put(f"{farm}/{turbine}/", f"/bucket/{turbine}/", recursive=True)
        rsync("memory://bucket", f"file://{tmp_path}/mirror")
        return pl.fleet(f"{tmp_path}/mirror/**/*.csv", table=tmp_path / "nights", map=counted)

    turbines = sorted(path.name for path in farm.iterdir() if path.is_dir())
    nights = [night(turbine) for turbine in turbines]
    assert asked == [2, 2]
    assert sorted(nights[-1].table["internal_lpm"]) == pytest.approx(sorted(found.table["internal_lpm"]), rel=1e-14)


def test_any_map_makes_the_same_rows(farm, found):
    def fleet(map):
        return pl.fleet(f"{farm}/**/*.csv", map=map, progress=False)

    assert fleet(map) == found
    assert fleet(with_joblib) == found
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        assert fleet(pool.map) == found
        assert fleet(lambda work, items: [pool.submit(work, item) for item in items]) == found
    with ThreadPoolExecutor(2) as pool:
        assert fleet(pool.map) == found


def test_frames_are_judged_as_files_are(farm, found):
    frames = {row.cylinder: pd.DataFrame(read_columns(trace)) for row, trace in zip(found.rows, TRACES, strict=True)}
    rig = pl.Rig.load(ROOT / "data" / "traces" / "rig.toml")
    for kind in (lambda frame: frame, polars.from_pandas, lambda frame: pa.table(frame)):
        again = pl.fleet({name: kind(frame) for name, frame in frames.items()}, rig, map=map)
        for row, expected in zip(again.rows, found.rows, strict=True):
            assert (row.cylinder, row.status, row.leaks) == (expected.cylinder, expected.status, expected.leaks)
            assert row.path == "data"


def test_rigs_by_file_table_name_or_value(farm, found, tmp_path):
    file = ROOT / "data" / "traces" / "rig.toml"
    rig = pl.Rig.load(file)
    table = tmp_path / "rigs.csv"
    table.write_text(f"trace,rig,cylinder\n{farm}/T1/B1/*.csv,{file},first\n{farm}/**/*.csv,{file},\n")
    flows = found.table["internal_lpm"]
    names = [row.cylinder for row in found.rows]
    for rigs in (file, rig, table, dict.fromkeys(names, file), dict.fromkeys(names, rig)):
        again = pl.fleet([f"{farm}/**/*.csv"], rigs, progress=False)
        np.testing.assert_array_equal(again.table["internal_lpm"], flows)
    named = pl.fleet(f"{farm}/**/*.csv", table, progress=False)
    assert [row.cylinder[-5:] for row in named.rows] == ["first", "T1/B2", "T2/B1", "T2/B2"]
    with pytest.raises(KeyError, match="no rig for cylinder"):
        pl.fleet(f"{farm}/**/*.csv", {"T9": rig}, progress=False)


def test_what_cannot_be_judged_is_a_row(farm, tmp_path):
    (tmp_path / "broken.csv").write_text("a,b\n1,2\n")
    with pytest.warns(pl.TraceWarning, match="1 of 2 traces could not be judged, the first for this: .*broken.csv"):
        out = pl.fleet([farm / "T1/B1/2026-05-01.csv", tmp_path / "broken.csv"], progress=False)
    assert [row.status is None for row in out.rows] == [False, True]
    assert out.counts["error"] == 1
    assert np.isnan(out.table["internal_lpm"][1])
    with pytest.warns(pl.TraceWarning, match="the first for this: data: no column for piston position"):
        assert pl.fleet({"a": {"t_s": [0.0]}}, progress=False).rows[0].status is None
    with pytest.raises(FileNotFoundError, match="no such trace"):
        pl.fleet(tmp_path / "*.parquet")
    with pytest.raises(IsADirectoryError):
        pl.fleet(tmp_path)


def test_progress_is_told(farm):
    told = []
    pl.fleet(f"{farm}/**/*.csv", progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_as_tables(found, tmp_path):
    arrow, frame, polar = found.to_arrow(), found.to_pandas(), found.to_polars()
    assert arrow.num_rows == len(frame) == polar.height == len(found) == 4
    assert arrow.column_names == list(frame.columns) == polar.columns == list(found.table)
    found.save(tmp_path / "fleet.parquet")
    written = polars.read_parquet(tmp_path / "fleet.parquet")
    for name in ("cylinder", "status", "internal_lpm", "internal_ci95_low_lpm", "samples", "internal_identifiable"):
        np.testing.assert_array_equal(written[name].to_numpy(), np.asarray(found.table[name]))
    assert str(written["begins"].dtype).startswith("Datetime")


def test_a_notebook_shows_it(found):
    assert "4 cylinders: 3 leak, 1 sound" in repr(found) and "(4 traces)" in repr(found)
    html = found._repr_html_()
    assert "L/min" in html and "LEAK" in html
    axes = found.plot()
    assert axes.get_ylabel() == "leak flow, L/min"


def measured(leak_lpm, day, rng):
    """Twenty seconds of the paper's cylinder with an internal leak of this mean flow, sensors of 0.3 %."""
    t, stroke, area_a, area_b, beta = np.arange(2000) * 0.01, 0.2, 1.26e-3, 0.94e-3, 0.8e9
    x, v = 0.1 + 0.05 * np.sin(0.5 * t), 0.025 * np.cos(0.5 * t)
    pa, pb = 8e6 + 1e6 * np.sin(0.8 * t), 4e6 + 1e6 * np.cos(0.7 * t)
    leak = (pa - pb) * leak_lpm / 6e4 / np.mean(pa - pb)
    qa = area_a * v + area_a * x / beta * 0.8e6 * np.cos(0.8 * t) + leak
    qb = -area_b * v - area_b * (stroke - x) / beta * 0.7e6 * np.sin(0.7 * t) - leak
    scales = {
        "x_m": (x, 0.2),
        "pa_pa": (pa, 16e6),
        "pb_pa": (pb, 16e6),
        "qa_m3s": (qa, 20 / 6e4),
        "qb_m3s": (qb, 20 / 6e4),
    }
    begins = np.datetime64("2026-05-01T06:00") + np.timedelta64(day, "D")
    stamps = {"timestamp": begins + np.round(1e3 * t).astype("timedelta64[ms]")}
    return stamps | {name: value + rng.normal(0.0, 0.001 * full, len(t)) for name, (value, full) in scales.items()}


def months():
    """A leak that grows, and one that stays, over twenty days."""
    rng = np.random.default_rng(1)
    rig = pl.Rig.parse(pl.Rig.paper().to_toml().replace("accuracy = 0.01", "accuracy = 0.003"))
    parts = []
    for day in range(20):
        traces = {"grows": measured(0.05 + 0.01 * day, day, rng), "stays": measured(0.2, day, rng)}
        parts.append(pl.fleet(traces, rig, progress=False))
    return sum(parts[1:], parts[0])


def test_many_days_make_a_trend():
    out = months()
    assert len(out) == 40
    grows, stays = (out.trends[name].internal for name in ("grows", "stays"))
    day = 24.0
    assert abs(grows.slope_lpm_per_h * day - 0.01) < 1.96 * grows.std * day < 0.002
    assert abs(stays.slope_lpm_per_h) < 1.96 * stays.std
    assert grows.traces == 20 and grows.from_.startswith("2026-05-01") and grows.to.startswith("2026-05-20")
    assert "GROWS     grows  internal by 0." in str(out)
    axes = out.plot("grows")
    assert len(axes.get_legend().get_texts()) == 3


def test_cylinders_are_those_of_the_program(farm, found, program):
    raw = json.loads(program("fleet", f"{farm}/**/*.csv", "--json"))
    assert list(found.cylinders) == [entry["cylinder"] for entry in raw["by_cylinder"]]
    assert found.cylinder_counts == raw["cylinder_counts"]
    for entry, one in zip(raw["by_cylinder"], found.cylinders.values(), strict=True):
        assert (one.status, list(one.faults), one.since) == (entry["status"], entry["faults"], entry["since"])
        row = found.rows[one.latest]
        assert (row.cylinder, row.status, one.rows) == (one.cylinder, one.status, (one.latest,))
        assert one.leaks.internal.flow == row.leaks.internal
        assert one.leaks.internal.stands == ("internal" in one.faults)


def test_many_days_of_a_cylinder_are_one():
    out = months()
    assert (len(out), sorted(out.cylinders)) == (40, ["grows", "stays"])
    assert out.cylinder_counts["leak"] == 2 and out.counts["leak"] > 20
    grows = out.cylinders["grows"]
    assert grows.since > grows.other_until > "2026-05-01"
    assert grows.counts["leak"] + grows.counts["sound"] + grows.counts["not_sure"] == grows.traces == 20
    assert grows.leaks.internal.trend == out.trends["grows"].internal
    assert out.rows[grows.rows[-1]].begins.startswith("2026-05-20")


def test_copies_count_once_and_are_told(farm, tmp_path):
    (tmp_path / "T1").mkdir()
    for name in ("a.csv", "b.csv"):
        shutil.copy(farm / "T1/B1/2026-05-01.csv", tmp_path / "T1" / name)
    with pytest.warns(pl.TraceWarning, match=r"b\.csv is a copy of .*a\.csv: judged once, as a trace of .*T1/a"):
        assert len(pl.fleet(tmp_path / "T1/*.csv", progress=False)) == 1


def test_a_fleet_pickles(found):
    assert pickle.loads(pickle.dumps(found)) == found


@pytest.fixture(scope="module")
def dask():
    """The map of a client of two processes that Dask started, as it does on a cluster."""
    with warnings.catch_warnings():
        # Dask's own, of ports that are taken and clocks that are late.
        warnings.simplefilter("ignore")
        distributed = pytest.importorskip("distributed")
        with (
            distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
            distributed.Client(cluster) as client,
        ):
            yield client.map


@pytest.fixture(scope="module")
def blades(found):
    """Every blade's samples in one table, as a lake has them."""
    parts = []
    for row in found.rows:
        turbine, blade = row.cylinder.split("/")[-2:]
        named = polars.lit(turbine).alias("turbine"), polars.lit(blade).alias("blade")
        parts.append(polars.read_csv(row.path).with_columns(*named))
    return polars.concat(parts, how="diagonal").to_arrow()


def verdicts(fleet):
    return [(row.status, row.faults, row.leaks) for row in fleet.rows]


def test_dask_gives_the_same_rows(dask, farm, found):
    assert pl.fleet(f"{farm}/**/*.csv", map=dask, progress=False) == found


def test_dask_judges_parquet_partitioned_by_turbine_and_blade(dask, blades, found, tmp_path):
    pyarrow.parquet.write_to_dataset(blades, tmp_path, partition_cols=["turbine", "blade"])
    rig = ROOT / "data" / "traces" / "rig.toml"
    here = pl.fleet(f"{tmp_path}/**/*.parquet", rig, progress=False)
    assert [row.cylinder for row in here.rows] == ["T1/B1", "T1/B2", "T2/B1", "T2/B2"]
    assert verdicts(here) == verdicts(found)
    assert pl.fleet(f"{tmp_path}/**/*.parquet", rig, map=dask, progress=False) == here


def test_polars_groups(blades, found, rig):
    """As docs/fleet.md shows it."""
    frame = polars.from_arrow(blades).with_columns(blade=polars.concat_str("turbine", "blade", separator="/"))

    def judge(part):
        return pl.fleet({part["blade"][0]: part.drop("turbine", "blade")}, rig, map=map, progress=False).to_polars()

    out = frame.group_by("blade", maintain_order=True).map_groups(judge)
    assert out["cylinder"].to_list() == ["T1/B1", "T1/B2", "T2/B1", "T2/B2"]
    assert out["status"].to_list() == [row.status for row in found.rows]
    assert out["internal_lpm"].to_list() == found.table["internal_lpm"].tolist()
    schema = pl.Fleet([]).to_polars().schema
    lazy = frame.lazy().group_by("blade", maintain_order=True).map_groups(judge, schema=schema).collect()
    assert lazy.equals(out)


def test_the_schema_is_the_same_whatever_is_missing(found):
    """So that Spark knows it before any row is there."""
    assert pl.Fleet([]).to_arrow().schema == found.to_arrow().schema
    assert pl.Fleet([]).to_polars().schema == found.to_polars().schema


def test_what_spark_calls(blades, found, rig):
    """As docs/fleet.md shows it: `applyInArrow` gives the keys as scalars and a group in any order, and pickles `judge`
    with all that it needs."""
    schema = pl.Fleet([]).to_arrow().schema

    def judge(key, part):
        turbine, blade = (value.as_py() for value in key)
        found = pl.fleet({f"{turbine}/{blade}": part.sort_by("t_s")}, rig, map=map, progress=False)
        return found.to_arrow()

    there = cloudpickle.loads(cloudpickle.dumps(judge))
    shuffled = blades.take(np.random.default_rng(1).permutation(blades.num_rows))
    for row, key in zip(found.rows, [("T1", "B1"), ("T1", "B2"), ("T2", "B1"), ("T2", "B2")], strict=True):
        group = shuffled.filter((arrow.field("turbine") == key[0]) & (arrow.field("blade") == key[1]))
        out = there(tuple(pa.scalar(value) for value in key), group)
        assert out.schema == schema
        assert out["cylinder"].to_pylist() == ["/".join(key)]
        assert out["status"].to_pylist() == [row.status]
        assert out["internal_lpm"].to_pylist() == [row.leaks.internal.mean_lpm]
