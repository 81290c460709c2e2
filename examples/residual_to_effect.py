"""From a residual to the missing effect: leaks that cannot be, what the model lacks, and the leaks once it has it.

Run it with

    pip install '.[plot]'
    python examples/residual_to_effect.py [picture.png]
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import pitchleak as pl

# What is wrong with a cylinder without a leak: its position sensor is scaled 2 % too long, its seals rub.
EFFECTS = {"position_gain": 0.02, "coulomb_friction": 300.0}


def main(picture=None):
    rig = pl.Rig.paper().replace(accuracy="0.1 %", name="turbine 7")
    trace = pl.simulate(21, rig, noise="rig", effects=EFFECTS, seed=5, duration=60).columns

    before = pl.replay(trace, rig)
    print("before:", before.verdict.text)

    found = pl.diagnose(trace, rig)
    print(found)
    sizes = {effect.id: effect.value for effect in found.effects}
    assert sizes.keys() == EFFECTS.keys()
    assert all(abs(sizes[effect] / size - 1.0) < 0.1 for effect, size in EFFECTS.items())

    after = pl.replay(trace, found.rig)
    print("after: ", after.verdict.text)
    assert after.verdict.faults == ()

    if picture:
        figure = plt.figure(figsize=(8, 8), layout="constrained")
        top, bottom = figure.subfigures(2, 1, height_ratios=(3, 2))
        found.plot(top)
        effects = ", ".join(f"{effect.id} {effect.value:.3g} {effect.unit.strip('1')}" for effect in found.effects)
        top.suptitle(f"residuals before and after: {effects}")
        ax = bottom.subplots()
        for shift, (when, out) in ((-0.08, ("before", before)), (0.08, ("after", after))):
            flows = list(out.leakage.items())
            ax.errorbar(
                [place + shift for place in range(3)],
                [flow.mean_lpm for _, flow in flows],
                yerr=[1.96 * flow.std_lpm for _, flow in flows],
                fmt="o",
                capsize=4,
                label=when,
            )
        ax.axhline(0.0, color="grey", linewidth=0.8)
        ax.set_xticks(range(3), ["internal", "external A", "external B"])
        ax.set_ylabel("leak flow, L/min (95 %)")
        ax.legend()
        figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
