"""A farm on Dask: every trace judged on a cluster, with the rows that this machine alone would give.

Run it with

    pip install '.[arrow,plot]' 'dask[distributed]'
    python examples/fleet_on_dask.py [picture.png]
"""

import itertools
import sys
import tempfile
from pathlib import Path

import matplotlib
import pyarrow.parquet

matplotlib.use("Agg")
from dask.distributed import Client, LocalCluster

import pitchleak as pl

LEAK_A_DAY_LPM = {"T1/B1": 0.0, "T1/B2": 0.02, "T2/B1": 0.0, "T2/B2": 0.05}
DAYS = 6


def make_farm(farm: Path) -> None:
    """A trace of 20 s a day for each blade, in Parquet partitioned by turbine and blade."""
    for (cylinder, lpm), day in itertools.product(LEAK_A_DAY_LPM.items(), range(1, DAYS + 1)):
        turbine, blade = cylinder.split("/")
        folder = farm / f"turbine={turbine}" / f"blade={blade}"
        folder.mkdir(parents=True, exist_ok=True)
        trace = pl.simulate(13, leak_internal=f"{lpm * day} L/min", noise="0.3 %", seed=day, duration=20)
        pyarrow.parquet.write_table(trace.to_arrow(), folder / f"2026-05-{day:02}.parquet")
        (folder / "rig.toml").write_text(pl.Rig.paper().replace(accuracy="0.3 %").to_toml())


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        make_farm(Path(folder))
        traces = f"{folder}/**/*.parquet"
        with (
            LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
        ):
            found = pl.fleet(traces, map=client.map)
        assert found == pl.fleet(traces), "a cluster finds what one machine finds"
    print(found)
    print()
    for cylinder, leaks in found.trends.items():
        trend = leaks.internal
        if trend is not None:
            day = 24.0
            print(f"{cylinder}: {trend.slope_lpm_per_h * day:+.4f} ± {1.96 * trend.std * day:.4f} L/min a day")
    found.plot("T2/B2").figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "fleet.png", dpi=120)


if __name__ == "__main__":
    main()
