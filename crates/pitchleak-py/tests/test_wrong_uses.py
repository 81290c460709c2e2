"""Wrong uses by analysts: each raises one error in one line, which names what is wrong and what is allowed."""

import datetime as dt

import numpy as np
import pandas as pd
import pytest

import pitchleak as pl

RIG = pl.Rig.paper()
TRACE = pl.simulate(13, duration=3, noise="0.3 %").columns
FRAME = pd.DataFrame(TRACE)
TIMES = pd.date_range("2026-01-01", periods=len(FRAME), freq="10ms", tz="UTC")
MIXED = [time if row % 2 else time.tz_localize(None) for row, time in enumerate(TIMES)]
NAN = float("nan")


def simulate(**arguments):
    return pl.simulate(**{"wind": 13, "duration": 1} | arguments)


def without(*columns):
    return FRAME.drop(columns=list(columns))


def timed(times):
    return FRAME.drop(columns="t_s").assign(timestamp=times)


#: What was done, by its name; what is raised; what the message has to say.
OF_RIGS = {
    "area_without_unit": (lambda: RIG.replace(area_a="12.6"), pl.RigError, "`area_a` no unit 12.6 cm^2"),
    "area_in_cm2": (lambda: RIG.replace(area_a=12.6), pl.RigError, "`area_a` 12.6 m^2 from 0.000001 to 10 m^2"),
    "area_in_kg": (lambda: RIG.replace(area_a="12.6 kg"), pl.RigError, "`area_a` `kg` m^2, cm^2, mm^2"),
    "areas_in_a_list": (lambda: RIG.replace(area_a=[12.6, 9.4]), TypeError, "`area_a` list number in SI"),
    "area_in_an_array": (lambda: RIG.replace(area_a=np.ones(2)), TypeError, "`area_a` ndarray number in SI"),
    "area_negative": (lambda: RIG.replace(area_a="-1 cm^2"), pl.RigError, "`area_a` from 0.000001 to 10 m^2"),
    "area_nan": (lambda: RIG.replace(area_a=NAN), pl.RigError, "`area_a` NaN from 0.000001 to 10 m^2"),
    "accuracy_in_percent": (lambda: RIG.replace(accuracy=50), pl.RigError, '`accuracy` 50 from 0 to 1 "0.5 %"'),
    "accuracy_without_unit": (lambda: RIG.replace(accuracy="0.5"), pl.RigError, '`accuracy` no unit "0.5 %"'),
    "accuracy_by_sensor": (lambda: RIG.replace(accuracy={"flow": "1 %"}), TypeError, "`accuracy` dict one share"),
    "argument_misspelt": (lambda: RIG.replace(area_c="1 cm^2"), TypeError, "`area_c` there are area_a, area_b"),
    "key_misspelt": (
        lambda: RIG.replace(flow={"acuracy": "1 %"}),
        pl.RigError,
        "`flow_a.acuracy` full_scale, accuracy",
    ),
    "sheet_as_text": (lambda: RIG.replace(pressure="160 bar"), pl.RigError, "`pressure` must be a table"),
    "threshold_negative": (lambda: RIG.replace(alarms={"internal": "-1 L/min"}), pl.RigError, "`alarms.internal` from"),
    "threshold_in_lpm": (
        lambda: RIG.replace(alarms={"internal": 0.3}),
        pl.RigError,
        "`alarms.internal` 0.3 m^3/s from",
    ),
    "alpha_in_percent": (lambda: RIG.replace(decision={"alpha": 95}), pl.RigError, "`decision.alpha` 95 to 0.5"),
    "alpha_is_confidence": (lambda: RIG.replace(decision={"alpha": 0.95}), pl.RigError, "`decision.alpha` 0.95 to 0.5"),
    "odds_of_nothing": (lambda: RIG.replace(decision={"odds": {"sun": "1 %"}}), pl.RigError, "`decision.odds.sun`"),
    "estimator_unknown": (lambda: RIG.replace(estimator="kalman"), pl.RigError, "kalman rls or paper"),
    "bulk_modulus_in_gpa": (lambda: RIG.replace(bulk_modulus=0.8), pl.RigError, "`bulk_modulus` 0.8 Pa from 1000000"),
    "half_a_rig": (lambda: pl.Rig(area_a="12.6 cm^2"), pl.RigError, "`area_b` from 0.000001 to 10 m^2"),
    "path_as_text_of_a_rig": (lambda: pl.Rig.parse("rig.toml"), pl.RigError, "not a TOML file"),
    "saved_by_nobody": (lambda: pl.Estimator.from_bytes(b"rig"), ValueError, "not a saved estimator"),
    "pitch_as_text": (lambda: pl.Linkage().position_m("30 deg"), TypeError, "str number angles in rad"),
    "pitch_in_degrees": (lambda: pl.Linkage().position_m([0.1, 30]), ValueError, "[1] pitch angle"),
}
OF_TRACES = {
    "no_pa": (lambda: pl.replay(without("pa_bar")), pl.TraceError, "pressure A pa_pa pa_bar header has t_s"),
    "no_time": (lambda: pl.check(without("t_s")), pl.TraceError, "time t_s timestamp header has x_mm"),
    "no_position": (lambda: pl.diagnose(without("x_mm")), pl.TraceError, "piston position x_m or x_mm"),
    "texts": (lambda: pl.replay(FRAME.astype(str)), TypeError, "`t_s` row 0 str number"),
    "decimal_commas": (lambda: pl.check(FRAME.assign(pa_bar="50,1")), TypeError, "`pa_bar` row 0 str number"),
    "flags": (lambda: pl.replay(FRAME.assign(pa_bar=True)), TypeError, "`pa_bar` bool numbers"),
    "complex": (lambda: pl.replay(FRAME.assign(pa_bar=1j)), TypeError, "`pa_bar` complex128 numbers"),
    "times_in_seconds": (lambda: pl.replay(FRAME.assign(t_s=TIMES)), TypeError, "`t_s` Timestamp number"),
    "back_in_time": (lambda: pl.replay(FRAME.iloc[::-1]), pl.TraceError, "`t_s` sort them `group`"),
    "empty": (lambda: pl.replay(FRAME.iloc[:0]), pl.TraceError, "no usable row only a header"),
    "nothing": (lambda: pl.prove(pd.DataFrame()), pl.TraceError, "no column for time t_s no column"),
    "all_nan": (lambda: pl.replay(FRAME * NAN), pl.TraceError, "300 skipped `t_s` missing"),
    "pressure_all_nan": (lambda: pl.prove(FRAME.assign(pa_bar=NAN)), pl.TraceError, "300 skipped `pa_bar` missing"),
    "infinite": (lambda: pl.replay(FRAME.assign(pa_bar=np.inf)), pl.TraceError, "`pa_bar` not a finite number"),
    "metres_in_mm": (
        lambda: pl.replay(FRAME.rename(columns={"x_mm": "x_m"})),
        pl.TraceError,
        '`x_m` stroke unit = "mm"',
    ),
    "unknown_unit": (
        lambda: pl.replay(FRAME.rename(columns={"pa_bar": "pa_at"})),
        pl.TraceError,
        "`pa_at` kpa, mpa, bar",
    ),
    "signal_twice": (lambda: pl.replay(FRAME.assign(pa_pa=5e6)), pl.TraceError, "`pa_bar` `pa_pa` both give `pa`"),
    "name_twice": (
        lambda: pl.replay(pd.concat([FRAME, FRAME[["pa_bar"]]], axis=1)),
        ValueError,
        "two `pa_bar` keep one",
    ),
    "too_short_a_column": (lambda: pl.replay(TRACE | {"x_mm": TRACE["x_mm"][:-1]}), pl.TraceError, "`x_mm` 299 300"),
    "scalar_as_column": (lambda: pl.replay(TRACE | {"x_mm": 100.0}), pl.TraceError, "`x_mm` 1 rows 300"),
    "table_as_column": (lambda: pl.replay(TRACE | {"x_mm": np.ones((300, 2))}), ValueError, "`x_mm` 2 dimensions"),
    "headers_of_two_levels": (lambda: pl.replay(pd.concat({"a": FRAME}, axis=1)), TypeError, "texts such as `t_s`"),
    "array_without_names": (lambda: pl.replay(FRAME.to_numpy()), TypeError, "ndarray data frame dict of arrays"),
    "one_column": (lambda: pl.replay(FRAME["pa_bar"]), TypeError, "Series data frame dict of arrays"),
    "traces_in_a_list": (lambda: pl.check([TRACE, TRACE]), TypeError, "list data frame dict of arrays"),
    "some_times_with_zone": (lambda: pl.replay(timed(MIXED)), ValueError, "`timestamp` row 0 zone"),
    "no_times": (lambda: pl.replay(timed(pd.NaT)), pl.TraceError, "`timestamp` missing"),
    "times_as_numbers": (lambda: pl.replay(timed(TIMES.asi8)), TypeError, "`timestamp` int64 datetime64"),
    "samples_of_two_lengths": (
        lambda: pl.Estimator(RIG).update(np.ones(3), np.ones(2), np.ones(3), np.ones(3)),
        pl.TraceError,
        "`x_m` 2 rows `t_s` 3",
    ),
    "sample_as_text": (lambda: pl.Estimator(RIG).update("0", 0.1, 5e6, 4e6), TypeError, "`t_s` numbers"),
    "part_of_no_trace": (lambda: pl.Estimator(RIG).extend(None), TypeError, "NoneType data frame dict of arrays"),
}
OF_ARGUMENTS = {
    "rig_and_trace_exchanged": (lambda: pl.replay(RIG, FRAME), TypeError, "`rig` DataFrame pitchleak.Rig path"),
    "rig_as_trace": (lambda: pl.replay(RIG), TypeError, "Rig data frame path"),
    "rig_as_dict": (lambda: pl.check(TRACE, {"area_a": 1}), TypeError, "`rig` dict pitchleak.Rig path"),
    "rig_as_wind": (lambda: simulate(wind=RIG), TypeError, "wind: Rig 5, 13, 21 or 30"),
    "columns_of_no_signal": (
        lambda: pl.replay(TRACE, columns={"head": "pa_bar"}),
        pl.RigError,
        "`columns.head` pa, pb",
    ),
    "columns_the_wrong_way": (
        lambda: pl.replay(TRACE, columns={"pa_bar": "pa"}),
        pl.RigError,
        "`columns.pa_bar` pa, pb",
    ),
    "columns_absent": (
        lambda: pl.replay(without("pa_bar"), columns={"pa": "Head [bar]"}),
        pl.TraceError,
        "pressure A Head [bar] header has t_s",
    ),
    "columns_without_unit": (lambda: pl.replay(TRACE, columns={"pa": "head"}), pl.RigError, "`columns.pa` head kpa"),
    "columns_in_a_list": (lambda: pl.replay(TRACE, columns=["t_s"]), TypeError, "columns: list dict such as"),
    "two_signals_of_a_column": (
        lambda: pl.replay(TRACE, columns={"pa": "pa_bar", "pb": "pa_bar"}),
        pl.RigError,
        "`columns.pb` another column `pa`",
    ),
    "no_such_group": (lambda: pl.replay(FRAME, group="blade"), KeyError, "`blade` there are t_s, x_mm"),
    "two_groups": (lambda: pl.replay(FRAME, group=["farm", "blade"]), TypeError, "group: list one column"),
    "groups_of_a_file": (lambda: pl.replay("trace.csv", group="blade"), TypeError, "group: str data frame"),
    "estimator_misspelt": (lambda: pl.replay(TRACE, estimator="kalman"), ValueError, "estimator `kalman` rls or paper"),
    "two_estimators": (lambda: pl.replay(TRACE, estimator=["rls"]), TypeError, "estimator: list rls or paper"),
    "strict_as_text": (lambda: pl.check(TRACE, strict="no"), TypeError, "strict: str True or False"),
    "progress_as_text": (lambda: pl.replay([TRACE], progress="yes"), TypeError, "progress: str True, False"),
    "threshold_of_replay": (lambda: pl.replay(TRACE, threshold=0.3), TypeError, "'threshold'"),
    "nothing_to_diagnose": (lambda: pl.diagnose([]), ValueError, "data: no trace"),
    "share_as_test": (lambda: pl.diagnose(TRACE, test=0.2), TypeError, "float data frame path"),
    "proof_without_unit": (
        lambda: pl.prove(TRACE, leak_internal="0.3"),
        ValueError,
        "leak_internal: no unit 0.3 L/min",
    ),
    "proof_in_lpm": (lambda: pl.prove(TRACE, leak_internal=0.3), ValueError, "leak_internal: 18000 L/min '0.3 L/min'"),
    "proof_in_bar": (lambda: pl.prove(TRACE, leak_internal="3 bar"), ValueError, "leak_internal: `bar` L/min"),
    "proof_of_none": (lambda: pl.prove(TRACE, leak_internal=None), TypeError, "leak_internal: NoneType 0.3 L/min"),
    "proof_of_zero": (lambda: pl.prove(TRACE, leak_internal=0), ValueError, "leak_internal: more than none"),
    "proof_negative": (lambda: pl.prove(TRACE, leak_internal="-1 L/min"), ValueError, "leak_internal: negative"),
    "proof_without_flows": (lambda: pl.prove(without("qa_lpm", "qb_lpm")), ValueError, "no flow is measured"),
    "no_valve": (lambda: pl.calibrate(TRACE, leaks="zero"), ValueError, "no [valve] rated_flow rated_drop"),
    "leaks_yes": (lambda: pl.calibrate(TRACE, leaks=True), TypeError, "leaks: bool zero or unknown"),
    "leaks_none": (lambda: pl.calibrate(TRACE, leaks="none"), ValueError, "leaks: `none` zero nor unknown"),
    "half_a_seed": (lambda: pl.reproduce(1.5), TypeError, "seeds: float whole number"),
    "no_seeds": (lambda: pl.reproduce(0), ValueError, "seeds: at least 1"),
}
OF_SIMULATIONS = {
    "nothing_to_follow": (lambda: pl.simulate(), ValueError, "wind position load"),
    "wind_that_is_not_there": (lambda: simulate(wind=12), ValueError, "winds 5, 13, 21 and 30"),
    "winds_in_a_list": (lambda: simulate(wind=[5, 13]), TypeError, "wind: list 5, 13, 21 or 30"),
    "leak_without_unit": (lambda: simulate(leak_internal="0.5"), ValueError, "leak_internal: no unit 0.5 L/min"),
    "leak_in_lpm": (lambda: simulate(leak_external_a=0.5), ValueError, "leak_external_a: 30000 L/min '0.5 L/min'"),
    "leaks_in_a_list": (lambda: simulate(leak_internal=["1 L/min"]), TypeError, "leak_internal: list 0.5 L/min"),
    "leak_negative": (lambda: simulate(leak_internal="-1 L/min"), ValueError, "leak_internal: negative"),
    "duration_without_unit": (lambda: simulate(duration="60"), ValueError, "duration: `60` no unit 60 s"),
    "duration_negative": (lambda: simulate(duration=-5), ValueError, "duration: negative"),
    "duration_nan": (lambda: simulate(duration=NAN), ValueError, "duration: nan 60 s"),
    "duration_of_datetime": (lambda: simulate(duration=dt.timedelta(0, 5)), TypeError, "duration: timedelta 60 s"),
    "a_century": (lambda: simulate(duration=3e9), ValueError, "duration in s between 0.01 and 1000000"),
    "noise_in_percent": (lambda: simulate(noise=3), ValueError, "noise: `3 %` `none` `rig`"),
    "noise_yes": (lambda: simulate(noise=True), TypeError, "noise: bool '1 %'"),
    "bias_in_percent": (lambda: simulate(bias=5), ValueError, "bias: `5 %`"),
    "seed_negative": (lambda: simulate(seed=-1), ValueError, "seed: at least 0"),
    "seed_none": (lambda: simulate(seed=None), TypeError, "seed: NoneType whole number"),
    "sample_rate_zero": (lambda: simulate(sample_rate=0), ValueError, "sample rate in Hz between 1 and 100000"),
    "oil_in_celsius": (lambda: simulate(oil_temp=45), ValueError, "oil temperature -40 °C 150 °C"),
    "position_in_mm": (lambda: simulate(wind=None, position=100, load=0), ValueError, "position 100 0 to 200 mm"),
    "effects_in_a_list": (lambda: simulate(effects=["entrained_air"]), TypeError, "effects: list dict such as"),
    "effect_misspelt": (lambda: simulate(effects={"air": 1.0}), ValueError, "`air` known ones entrained_air"),
    "effect_as_text": (lambda: simulate(effects={"entrained_air": "1"}), TypeError, "effects: entrained_air: str SI"),
    "faults_as_dict": (lambda: simulate(faults={"qa": "dead"}), TypeError, "faults: dict 'qa dead'"),
    "fault_misspelt": (lambda: simulate(faults=["qa broken"]), ValueError, "`broken` dead, stuck, missing"),
    "shut_as_numbers": (lambda: simulate(shut=(5, 15)), TypeError, "shut: tuple '5 s..15 s'"),
    "scale_as_text": (lambda: simulate(load_scale="2"), TypeError, "load_scale: str number"),
    "out_yes": (lambda: simulate(out=True), TypeError, "out: bool path"),
    "out_as_excel": (lambda: simulate(out="trace.xlsx"), ValueError, "trace.xlsx .csv or .csv.gz"),
}
OF_FLEETS = {
    "no_traces": (lambda: pl.fleet(None), TypeError, "traces: NoneType paths or patterns"),
    "a_frame": (lambda: pl.fleet(FRAME), TypeError, "traces: DataFrame {'T1/B1': frame}"),
    "frames_in_a_list": (lambda: pl.fleet([FRAME]), TypeError, "traces: DataFrame {'T1/B1': frame}"),
    "columns_by_name": (lambda: pl.fleet(TRACE), TypeError, "cylinder `t_s` ndarray data frame"),
    "nothing_by_a_name": (lambda: pl.fleet({"B1": None}), TypeError, "cylinder `B1` NoneType data frame"),
    "rigs_in_a_list": (lambda: pl.fleet({"B1": TRACE}, [RIG]), TypeError, "rigs: list by the names of cylinders"),
    "rigs_as_a_frame": (lambda: pl.fleet({"B1": TRACE}, FRAME), TypeError, "rigs: DataFrame by the names of cylinders"),
    "no_rig_for_it": (lambda: pl.fleet({"B1": TRACE}, {"B2": RIG}), KeyError, "no rig for cylinder `B1`"),
    "cores_as_map": (lambda: pl.fleet({"B1": TRACE}, map=4), TypeError, "map: int function"),
    "table_of_what_is_no_file": (lambda: pl.fleet({"B1": TRACE}, table="t"), TypeError, "table: files `B1` in memory"),
    "no_match": (lambda: pl.fleet("nowhere/*.parquet"), FileNotFoundError, "nowhere/*.parquet"),
}
ALL = OF_RIGS | OF_TRACES | OF_ARGUMENTS | OF_SIMULATIONS | OF_FLEETS


@pytest.mark.parametrize(("use", "error", "words"), ALL.values(), ids=ALL)
def test_a_wrong_use_is_told(use, error, words, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(error) as raised:
        use()
    says(raised.value, words)


def says(error, words):
    text = str(error)
    assert "\n" not in text
    missing = [word for word in words.split() if word not in text]
    assert not missing, f"{missing} not in: {text}"


@pytest.mark.parametrize(
    "use", [pl.replay, pl.check, pl.diagnose, pl.prove, pl.Rig.load, lambda path: pl.replay([path])]
)
def test_a_file_that_is_not_there(use):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.csv"):
        use("nowhere.csv")


#: A file that is no trace, or no rig; what is raised; what the message has to say.
FILES = {
    "folder_as_trace": (lambda at: pl.replay(at), pl.TraceError, "folder, not a trace name the files"),
    "folder_as_fleet": (lambda at: pl.fleet(at), IsADirectoryError, "folder name its traces"),
    "folder_as_rig": (lambda at: pl.replay(TRACE, at), IsADirectoryError, "Is a directory"),
    "empty_file": (lambda at: pl.replay(at / "empty.csv"), pl.TraceError, "empty.csv header row"),
    "binary_file": (lambda at: pl.check(at / "binary.csv"), pl.TraceError, "binary.csv not a CSV file"),
    "rig_as_trace": (lambda at: pl.replay(at / "rig.toml"), pl.TraceError, "rig.toml a rig file, not a trace"),
    "trace_as_rig": (lambda at: pl.replay(TRACE, at / "trace.csv"), pl.RigError, "trace.csv:1: not a TOML file"),
    "notes_as_rig": (lambda at: pl.replay(TRACE, at / "notes.toml"), pl.RigError, "`title` cylinder, fluid, sensors"),
    "trace_as_estimator": (lambda at: pl.Estimator.load(at / "trace.csv"), ValueError, "not a saved estimator"),
    "out_in_no_folder": (lambda at: simulate(out=at / "no" / "a.csv"), FileNotFoundError, "a.csv"),
    "out_in_a_folder": (lambda at: simulate(out=at), ValueError, ".csv or .csv.gz"),
}


@pytest.mark.parametrize(("use", "error", "words"), FILES.values(), ids=FILES)
def test_a_file_of_another_kind_is_told(use, error, words, tmp_path):
    FRAME.to_csv(tmp_path / "trace.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG.to_toml())
    (tmp_path / "notes.toml").write_text("title = 'notes'\n")
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))
    (tmp_path / "empty.csv").touch()
    with pytest.raises(error) as raised:
        use(tmp_path)
    says(raised.value, words)


#: What may be right, and is wrong here: no leak is told, and the text says why.
DOUBTED = {
    "bar_called_pascal": (
        FRAME.rename(columns={"pa_bar": "pa_pa", "pb_bar": "pb_pa"}),
        "not_sure",
        "pressures changing",
    ),
    "no_flows": (without("qa_lpm", "qb_lpm"), "not_sure", "No flow is recorded"),
    "milliseconds_called_seconds": (FRAME.assign(t_s=FRAME["t_s"] * 1000), "doubtful", "With t divided by 1000"),
}


@pytest.mark.filterwarnings("ignore::pitchleak.TraceWarning")
@pytest.mark.parametrize(("frame", "status", "words"), DOUBTED.values(), ids=DOUBTED)
def test_what_only_the_numbers_show_is_doubted(frame, status, words):
    verdict = pl.replay(frame).verdict
    assert verdict.status == status and not verdict.faults and words in verdict.text


def test_columns_that_the_trace_lacks_are_told():
    with pytest.warns(pl.TraceWarning, match="mapped but not in the trace: Head"):
        pl.replay(TRACE, columns={"pa": "Head [bar]"})


def test_times_of_several_zones_are_one_time():
    several = [time.tz_convert("Europe/Berlin") if row % 2 else time for row, time in enumerate(TIMES)]
    assert pl.replay(timed(several)).raw == pl.replay(timed(TIMES)).raw
