"""From a controller's raw CSV to a decision: which cylinder leaks, how much, and is the data good enough to say so.

Run it with

    pip install '.[pandas,plot]'
    python examples/raw_csv_to_decision.py [picture.png]
"""

import io
import sys
import warnings

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import pitchleak as pl

# What a rig file says: the cylinder, its oil, how good the sensors are, what the controller calls its columns.
RIG = """
[cylinder]
area_a = "12.6 cm^2"
area_b = "9.4 cm^2"
stroke = "0.2 m"
moving_mass = "20 kg"
[fluid]
bulk_modulus = "0.8 GPa"
bulk_modulus_std = "0.2 GPa"
[sensors]
flow = { full_scale = "20 L/min", accuracy = "1 %" }
pressure = { full_scale = "16 MPa", accuracy = "1 %" }
position = { full_scale = "0.2 m", accuracy = "1 %" }
[alarms]
internal = "0.1 L/min"
external_a = "0.1 L/min"
external_b = "0.1 L/min"
[columns]
t = { name = "Zeit", unit = "s" }
x = { name = "Weg", unit = "mm" }
pa = { name = "Druck A", unit = "bar" }
pb = { name = "Druck B", unit = "bar" }
qa = { name = "Strom A", unit = "L/min" }
qb = { name = "Strom B", unit = "L/min" }
"""
NAMES = {
    "t_s": "Zeit",
    "x_mm": "Weg",
    "pa_bar": "Druck A",
    "pb_bar": "Druck B",
    "qa_lpm": "Strom A",
    "qb_lpm": "Strom B",
}


def raw_csv():
    """Three blades in one export, with the flaws that exports have."""
    leaks = {
        "blade 1": {},
        "blade 2": {"leak_internal": "0.4 L/min", "onset": 20},
        "blade 3": {"leak_external_a": "0.25 L/min"},
    }
    parts = []
    for seed, (blade, leak) in enumerate(leaks.items()):
        trace = pl.simulate(13, noise="1 %", seed=seed, duration=60, **leak).to_pandas()
        parts.append(trace[list(NAMES)].rename(columns=NAMES).assign(Blatt=blade, Bemerkung="auto"))
    export = pd.concat(parts).sort_values("Zeit", kind="stable", ignore_index=True)
    export.loc[1000:1003, "Druck A"] = np.nan  # a sensor that dropped out
    export.loc[5000, "Weg"] = 9999.0  # a telegram that went wrong
    return export.to_csv(index=False)


def main(picture=None):
    rig = pl.Rig.parse(RIG, "turbine 7")
    export = pd.read_csv(io.StringIO(raw_csv()))

    one = export[export["Blatt"] == "blade 3"].drop(columns=["Blatt", "Bemerkung"])
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("always")
        checked = pl.check(one, rig)
    print(checked, *(f"noticed: {warning.message}" for warning in noticed), sep="\n")

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pl.TraceWarning)
        blades = pl.replay(export.drop(columns="Bemerkung"), rig, group="Blatt")
    for blade, out in blades.items():
        print(f"{blade}: {out.verdict.text}")
    print(blades.to_pandas().to_string(index=False))
    assert {blade: out.verdict.faults for blade, out in blades.items()} == {
        "blade 1": (),
        "blade 2": ("internal",),
        "blade 3": ("external_a",),
    }

    if picture:
        figure, axes = plt.subplots(3, 1, figsize=(8, 7.5), sharex=True, layout="constrained")
        for ax, (blade, out) in zip(axes, blades.items(), strict=True):
            out.plot(ax)
            ax.set_title(f"{blade}: {out.verdict.text.split(':')[0]}", loc="left", fontsize="medium")
        for ax in axes[:-1]:
            ax.set_xlabel("")
        figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
