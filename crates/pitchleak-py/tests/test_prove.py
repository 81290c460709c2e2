"""What a trace proves, and what a verdict weighs."""

import json
import pickle

import pytest

import pitchleak as pl

RIG = pl.Rig.paper().replace(accuracy="0.3 %")


@pytest.fixture(scope="module")
def trace():
    return pl.simulate(13, RIG, noise="rig", duration=30, sample_rate=50).columns


def test_a_leak_that_is_put_in_is_found_at_its_size(trace):
    proof = pl.prove(trace, RIG, leak_internal="0.5 L/min", leak_external_b=[0.5 / 60e3])
    assert proof.proven and proof.verdict.status == "sound"
    internal, external = proof.cases
    assert (internal.leak, external.leak) == ("internal", "external_b")
    for case in proof.cases:
        assert case.put_in_lpm == pytest.approx(0.5)
        assert abs(case.found_lpm - 0.5) < 4 * case.std_lpm < 0.2
        assert case.alarm_after_s >= case.bound_after_s > 0
    assert proof.found_from.internal.lpm < 0.5
    assert proof.to_pandas()["found"].tolist() == [True, True]
    assert "PROVEN" in str(proof) and "<h1" in proof.to_html()
    assert pickle.loads(pickle.dumps(proof)).raw == proof.raw
    axes = proof.plot()
    assert "put in" in axes.get_xlabel()


def test_it_is_what_the_program_says(program, tmp_path):
    pl.simulate(13, RIG, noise="rig", duration=30, sample_rate=50, out=tmp_path / "trace.csv", progress=False)
    (tmp_path / "rig.toml").write_text(RIG.to_toml())
    told = program("prove", tmp_path / "trace.csv", "--leak-internal", "0.3 L/min", "--json", "--quiet")
    proof = pl.prove(tmp_path / "trace.csv", leak_internal="0.3 L/min")
    theirs, ours = json.loads(told), proof.to_dict()
    assert theirs["cases"] == ours["cases"] and theirs["found_from"] == ours["found_from"]
    proof.report(tmp_path / "proof.html")
    with pytest.raises(ValueError, match=r"rig.toml"):
        proof.report(tmp_path / "rig.toml")


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ({"leak_internal": "0 L/min"}, "leak_internal: a leak that is put in is more than none"),
        ({"leak_external_a": "3 bar"}, "leak_external_a: "),
        ({"leak_external_b": "much"}, "leak_external_b: "),
    ],
)
def test_what_is_no_leak_is_refused_by_its_name(trace, sizes, message):
    with pytest.raises(ValueError, match=message):
        pl.prove(trace, RIG, **sizes)


def test_without_flow_meters_nothing_can_be_put_in(trace):
    shut = pl.simulate(13, RIG, noise="rig", duration=30, shut="5 s..20 s").columns
    blind = {name: values for name, values in shut.items() if name not in ("qa_lpm", "qb_lpm")}
    with pytest.raises(ValueError, match=r"no flow is measured|hold test"):
        pl.prove(blind, RIG)


def test_explanations_have_their_probabilities():
    swapped = pl.simulate(13, RIG, noise="rig", duration=60, sample_rate=50, faults=["swap qa qb"])
    verdict = pl.replay(swapped.columns, RIG).verdict
    assert verdict.status == "doubtful" and verdict.reasons[0].sensors == ("qa", "qb")
    best = verdict.explanations[0]
    assert best.sensors == ("qa", "qb") and best.probability > 0.9
    assert sum(one.probability for one in verdict.explanations) <= 1 + 1e-9
    axes = verdict.plot()
    assert axes.patches[0].get_width() == pytest.approx(100 * best.probability)
    assert best.text in verdict._repr_html_()


def test_a_leak_is_found_by_its_name(trace):
    leakage = pl.replay(trace, RIG).leakage
    assert leakage["external_a"] is leakage.external_a
    with pytest.raises(KeyError, match="'external' is no leak: internal, external_a or external_b"):
        leakage["external"]


def test_every_explanation_is_listed(program):
    listed = {one.id: one for one in pl.explanations()}
    assert listed["exchanged_flows"].kind == "wiring" and 0 < listed["flow_lag"].share < 1
    assert listed["flow_lag"].cannot_be_told_from == ("position_lag",)
    told = program("explanations").splitlines()
    assert [line.split()[1] for line in told[1:]] == [one.id for one in pl.explanations()]
