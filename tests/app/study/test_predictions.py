"""Predictions of `check` are compared with the results of whole tests."""

import io
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from rich.console import Console
from rodsight import prediction
from rodsight.inference.diagnosis.causes import CAUSES, finding
from rodsight.inference.diagnosis.trial import Trial
from rodsight.prediction import Prediction
from rodsight.solver.assessment.evidence import Evidence
from rodsight.solver.assessment.expected_correlation import predict_correlation
from rodsight.solver.assessment.penalties import TRUST_OF_FEW, find_penalties
from rodsight.study.scenarios.predictions import TRUE_CAUSE, PredictionOutcome, print_predictions
from rodsight.study.scenarios.scenario_score import ScenarioScore
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS

from ..inference.test_data_quality import GOOD

SOUND = Evidence(False, 0.05, 0.1, 0.01, 0.01, 1.0, 1e-3, 4e-3, 5, agreement=0.96, overlap_agreement=0.9)
WRONG = replace(
    SOUND, correction=2.0, old_unbalance=0.15, disagreement=0.5, agreement=0.1, overlap_agreement=0.1, unbalance=0.3
)

TRACKS = SimpleNamespace(frame_count=2)


def predicted(evidence: Evidence | None) -> Prediction:
    return Prediction(GOOD, None if evidence is None else Trial((evidence,), 1))


def outcome(prediction: Prediction | None, r: float | None) -> PredictionOutcome:
    return PredictionOutcome(ScenarioScore("shear", 2, "", r=(None, None, None, r)), prediction)


def test_the_prediction_follows_from_the_evidence_of_the_first_photographs():
    assert predicted(SOUND).expected == pytest.approx(predict_correlation([SOUND]))
    r, low, high = predicted(SOUND).expected
    assert 0.0 < low < r < high < 1.0


def test_a_trial_is_judged_by_the_frames_whose_members_are_known():
    unknown = replace(WRONG, disagreement=math.nan)
    assert Trial((SOUND, unknown), 1).expected == pytest.approx(predict_correlation([SOUND]))
    assert Trial((SOUND, unknown), 1).score == pytest.approx(Trial((SOUND,), 1).score)
    assert math.isnan(Trial((unknown,), 1).expected[0])
    assert Trial((unknown,), 1).score == -math.inf


def test_hidden_and_unseen_rods_lower_the_prediction():
    hidden = replace(SOUND, hidden_fraction=0.2)
    assert Trial((hidden,), 1).expected[0] < 0.9 * Trial((SOUND,), 1).expected[0]


def test_a_named_cause_contradicts_the_evidence_unless_a_run_corrects_it():
    sound, contradicted = predict_correlation([SOUND]), predict_correlation([SOUND], contradicted=True)
    assert contradicted[0] < sound[0]
    for cause, expected in (("outlier_tracks", sound), ("friction", contradicted)):
        each = replace(predicted(SOUND), diagnosis=(finding(cause, "evidence"),))
        assert each.expected == pytest.approx(expected)
        assert not each.good


def test_the_weightiest_reason_is_stated():
    weak = replace(SOUND, correction=0.6)
    trial = Trial((weak, WRONG), 1)
    assert trial.worst == max(find_penalties(WRONG)[0], find_penalties(weak)[0])
    assert find_penalties(WRONG)[0].words != find_penalties(weak)[0].words


def test_data_that_show_little_without_a_load_cannot_carry_forces():
    little = replace(
        SOUND, loaded=False, agreement=0.3, overlap_agreement=0.3, disagreement=0.9, position_agreement=0.6,
        interior=25, correction=0.3,
        information=replace(SOUND.information, noise=7e-5, diameter=0.02, undetermined=0.45),
    )  # fmt: skip
    assert Trial((little,), 1).expected[0] < prediction.POOR
    assert predicted(little).verdict().startswith("These data cannot carry forces: ")
    assert "no load is known" in predicted(little).verdict()
    assert predicted(WRONG).verdict().startswith("Something is wrong: ")


def test_a_remark_states_why_there_is_no_prediction():
    assert Prediction(GOOD, None, "The first photographs determine no friction.").verdict().endswith("no friction.")


@pytest.mark.parametrize("trial", [None, Trial((), 12)])
def test_photographs_that_show_everything_but_no_equilibrium_are_no_lack_of_photographs(monkeypatch, trial):
    for name in ("Inputs", "material_of", "settings_of", "measure_data_quality"):
        monkeypatch.setattr(prediction, name, lambda *_: GOOD)
    monkeypatch.setattr(prediction, "inputs_as_used", lambda inputs: (inputs, None))
    monkeypatch.setattr(prediction, "solve_trial", lambda *_, **__: trial)
    monkeypatch.setattr(prediction, "diagnose", lambda *_: ())
    assert prediction.predict_accuracy("config", TRACKS, "walls").verdict() == prediction.NO_FORCES
    monkeypatch.setattr(prediction, "measure_data_quality", lambda *_: None)
    assert "two consecutive photographs" in prediction.predict_accuracy("config", TRACKS, "walls").verdict()
    one = prediction.predict_accuracy("config", SimpleNamespace(frame_count=1), "walls")
    assert "one photograph shows no motion" in one.verdict()


@pytest.mark.parametrize(("evidence", "compared"), [(SOUND, False), (WRONG, True)])
def test_rival_inputs_are_compared_where_the_first_twelve_photographs_leave_them_open(monkeypatch, evidence, compared):
    solved, diagnosed = [], []

    def solve(inputs, photographs=6, observer=None, *, by_forces=False, corrected=None):
        solved.append((photographs, by_forces))
        return Trial((evidence,), photographs)

    monkeypatch.setattr(prediction, "Inputs", lambda *_: "inputs")
    monkeypatch.setattr(prediction, "inputs_as_used", lambda inputs: (inputs, None))
    monkeypatch.setattr(prediction, "material_of", lambda _: None)
    monkeypatch.setattr(prediction, "settings_of", lambda _: None)
    monkeypatch.setattr(prediction, "measure_data_quality", lambda *_: GOOD)
    monkeypatch.setattr(prediction, "solve_trial", solve)
    monkeypatch.setattr(prediction, "diagnose", lambda inputs, trial, progress: diagnosed.append(trial) or ())
    monkeypatch.setattr(prediction, "COMPARED", 0.9)
    found = prediction.predict_accuracy("config", TRACKS, "walls")
    assert found.trial == Trial((evidence,), 12)
    # The prediction corrects what a run corrects; rivals are compared with the input as it is.
    assert solved == ([(12, True), (6, False)] if compared else [(12, True)])
    assert diagnosed == ([Trial((evidence,), 6)] if compared else [None])
    assert prediction.predict_accuracy("config", TRACKS, None) == Prediction(GOOD, None)
    assert len(diagnosed) == 1


def test_too_few_photographs_or_interior_rods_are_stated_first_and_limit_the_prediction_as_the_trust():
    two = Prediction(GOOD, Trial((SOUND,), 1, 2))
    assert two.expected == (TRUST_OF_FEW,) * 3
    assert not two.good
    assert two.verdict() == (
        "The forces cannot be judged: the test has only 2 photographs: one motion alone is not confirmed by another; "
        "take more; expected r(f_n) 0.28."
    )
    contradicted = replace(two, diagnosis=(finding("friction", "it slides"),)).verdict()
    assert contradicted.startswith("The forces cannot be judged: the test has")
    assert "it slides" in contradicted
    assert Prediction(GOOD, Trial((SOUND,), 1, 3)).good
    few = Prediction(GOOD, Trial((replace(SOUND, interior=5),), 1))
    assert few.expected[0] == pytest.approx(0.25, abs=1e-3)
    assert few.verdict().startswith("The forces cannot be judged: only 5 grains have neighbours all around")
    assert few.verdict().endswith("expected r(f_n) 0.25.")


def test_no_verdict_states_a_correlation_of_one(monkeypatch):
    monkeypatch.setattr(Trial, "expect", lambda *_, **__: (0.998, 0.996, 0.9991))
    assert predicted(SOUND).verdict() == "The forces can be found: expected r(f_n) 0.99."


def test_the_verdict_names_what_contradicts_the_forces():
    assert predicted(SOUND).good
    assert predicted(SOUND).verdict().startswith("The forces can be found: expected r(f_n) 0.9")
    assert not predicted(WRONG).good
    verdict = predicted(WRONG).verdict()
    assert verdict.startswith("Something is wrong: expected r(f_n) 0.")
    assert "out of balance" in verdict or "correct the measured motion" in verdict
    hidden = Prediction(replace(GOOD, noise=1.2e-4), Trial((WRONG,), 1))
    assert hidden.verdict().startswith("These data cannot carry forces: noise is 1.0 of the motion")
    assert "every third photograph, --frames ::3" in Prediction(GOOD, Trial((SOUND,), 3)).verdict()
    assert predicted(None).verdict().startswith("The accuracy of the forces is not predicted")


def test_results_outside_the_predicted_interval_are_marked():
    r, low, high = predicted(SOUND).expected
    cases = [
        outcome(predicted(SOUND), r),
        outcome(predicted(SOUND), low - 0.01),
        outcome(predicted(SOUND), 1.0),
        outcome(None, 0.5),
        outcome(predicted(None), 0.5),
        outcome(predicted(SOUND), None),
    ]
    assert high < 1.0
    assert [each.inside for each in cases] == [True, False, False, None, None, None]
    assert math.isnan(cases[3].expected[0])
    printed = io.StringIO()
    print_predictions(Console(file=printed, width=200), cases)
    text = printed.getvalue()
    assert text.count("outside") == 2
    assert "1 of 3 are in their interval" in text
    assert "no prediction" in text
    assert "refused" in text


@pytest.mark.parametrize(
    ("scenario", "named", "rightly"),
    [("mu_01", "friction", True), ("mu_01", "walls_shifted", False), ("sheared", "friction", False),
     ("sheared", None, None), ("cohesion", "not_explained", None), ("wrong_class", "exchanged_sizes", True)],
)  # fmt: skip
def test_a_diagnosis_is_right_only_with_the_true_cause(scenario, named, rightly):
    diagnosis = () if named is None else (finding(named, "evidence"),)
    each = PredictionOutcome(ScenarioScore(scenario, 2, ""), replace(predicted(SOUND), diagnosis=diagnosis))
    assert each.rightly is rightly


def test_every_scenario_of_wrong_input_has_a_true_cause_or_needs_none():
    wrong = {name for name, each in SCENARIOS.items() if each.group == "wrong input"}
    assert wrong - set(TRUE_CAUSE) == {"theta_absent", "overhang"}
    assert {cause for causes in TRUE_CAUSE.values() for cause in causes} <= set(CAUSES)
