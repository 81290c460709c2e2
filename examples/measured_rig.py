"""Traces of a measured rig for `pitchleak diagnose`, from a clone of the public repository that holds the raw runs.

    git clone https://github.com/ivliev123/Electro-Hydraulic-Actuator
    git -C Electro-Hydraulic-Actuator checkout 415a623
    python examples/measured_rig.py Electro-Hydraulic-Actuator traces && cd traces
    pitchleak diagnose d1018*stroke[13].csv.gz --test d1018*stroke[24].csv.gz d1017*.csv.gz

A laboratory's pump-controlled cylinder, 31 s at 1 kHz per run, of 17 and 18 October 2024; docs/bench/diagnosis.md says
what comes out. That repository declares no licence, so its data are no part of this project. Counts become SI with
its own calibration (4_ANALIZE_DATA/PYTHON_Processing/processing_data_1.py). Needs nothing but Python.
"""

import csv
import gzip
import sys
from pathlib import Path

RUNS = "2_EHA_desktop program_python_project"
# The rig as far as its authors' simulation model tells; none of it was checked. The displacement of the pump may be off
# by 20 % (`gain`), its volumetric efficiency is not known.
RIG = """\
[cylinder]
area_a = "19.63495 cm^2"
area_b = "16.49336 cm^2"
stroke = "75 mm"
moving_mass = "10 kg"
dead_volume_a = "0.02 l"
dead_volume_b = "0.02 l"

[fluid]
bulk_modulus = "1.4 GPa"
bulk_modulus_std = "0.3 GPa"

[sensors]
flow = { full_scale = "3 L/min", accuracy = "1 %", gain = "20 %" }
pressure = { full_scale = "10 MPa", accuracy = "1 %" }
position = { full_scale = "75 mm", accuracy = "0.1 %" }
"""

# Columns of the raw files.
TIME_MS, PRESSURE_A, PRESSURE_B, PUMP_RPM, REFERENCE, POSITION, VALVE = 0, 2, 3, 10, 13, 14, 16
ENCODER_M = 25e-6
PUMP_M3 = 1.6e-6
"""Displacement of the pump per revolution. The flow columns are this times the pump's speed: no flow meter."""


def row(counts: list[int]) -> list[str]:
    """One instant in SI. The relay valve gives the pump's flow to A (1000), to B (-1000) or to neither."""
    pump_rps = round(counts[PUMP_RPM] / 60, 5)
    flow = f"{abs(PUMP_M3 * pump_rps):.5g}"
    return [
        f"{1e-3 * counts[TIME_MS]:.3f}",
        f"{ENCODER_M * counts[POSITION]:.6f}",
        f"{1e5 * (0.0625 * counts[PRESSURE_A] - 0.625):.0f}",
        f"{1e5 * (0.07576 * counts[PRESSURE_B] - 18.333):.0f}",
        flow if counts[VALVE] > 0 else "",
        flow if counts[VALVE] < 0 else "",
        f"{pump_rps:.4g}",
        f"{ENCODER_M * counts[REFERENCE]:.6f}",
    ]


def convert(raw: Path, trace: Path) -> None:
    with raw.open(newline="") as source, gzip.open(trace, "wt", newline="") as target:
        lines = csv.reader(source, delimiter=";")
        next(lines)
        out = csv.writer(target, lineterminator="\n")
        out.writerow(["t_s", "x_m", "pa_pa", "pb_pa", "qa_m3s", "qb_m3s", "pump_rps", "x_ref_m"])
        out.writerows(row([int(cell) for cell in line]) for line in lines if line)


def main(clone: Path, folder: Path) -> None:
    runs = clone / RUNS
    traces = {f"d1017_test{n}": runs / "Arhiv_2024_10_17" / f"test{n}.csv" for n in range(1, 7)}
    for load in range(1, 6):
        for stroke in range(1, 5):
            name = f"d1018_load{load}_stroke{stroke}"
            traces[name] = runs / "ARHIV_2024_10_18" / f"exp_data_{load}_{stroke}.csv"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(RIG)
    for name, raw in traces.items():
        convert(raw, folder / f"{name}.csv.gz")
    print(f"{len(traces)} traces and rig.toml in {folder}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]))
