"""The calibration report names its data and quantities outside their limits; (slow) all are within them."""

from dataclasses import replace

import numpy as np
import pytest
import rodsight
from rodsight.solver.assessment.intervals.force_intervals import Term
from rodsight.study.report.calibration_report import CalibrationStudy, TrustedFrames, study_calibration, violations
from rodsight.study.report.report_page import report_page
from rodsight.study.scenarios.contact_errors import ContactErrors
from rodsight.study.scenarios.scenario_score import StudyPlan
from rodsight.study.scenarios.statistic_errors import StatisticErrors, compared_names

from .test_predictions import SOUND, outcome, predicted

COUNT = 6000


@pytest.fixture(scope="module")
def study():
    rng = np.random.default_rng(3)
    none = np.zeros(COUNT, np.bool_)
    errors = ContactErrors(
        scenario=np.full(COUNT, "shear"), seed=np.zeros(COUNT, np.int64), frame=np.ones(COUNT, np.int64),
        group=np.ones(COUNT, np.uint8), wall=rng.random(COUNT) < 0.1, sliding=none, ambiguous=none,
        evidence_source=np.zeros(COUNT, np.uint8), terms=np.zeros((COUNT, len(Term))),
        force=rng.random((COUNT, 2)) * 2,
        error=rng.standard_normal((COUNT, 2)), sd=np.ones((COUNT, 2)), formula_sd=np.ones((COUNT, 2)),
    )  # fmt: skip
    ten = np.ones(10)
    numbers = [
        StatisticErrors("shear", 0, name, 1.02 * ten, ten, 0.05 * ten, 0.1 * ten, np.zeros(10, np.uint8))
        for name in compared_names()
    ]
    frames = TrustedFrames(np.full(10, "shear"), 0.9 * ten, 0.97 * ten, np.zeros(10, np.bool_))
    return CalibrationStudy(("shear",), (0,), 30, errors, numbers, frames)


def test_only_quantities_outside_their_limits_are_named(study):
    assert violations(study) == []
    narrow = replace(study, errors=replace(study.errors, sd=0.5 * study.errors.sd))
    assert any("of f_n of weak contacts: covers" in each for each in violations(narrow))
    trusting = replace(study, frames=replace(study.frames, trust=np.where(np.arange(10) < 1, 0.99, 0.9)))
    assert any("below the trust in 10 %" in each for each in violations(trusting))
    numbers = [replace(each, stated=1.3 * each.true) for each in study.numbers]
    assert any("sliding contacts is off by +30 %" in each for each in violations(replace(study, numbers=numbers)))


@pytest.mark.thorough
def test_the_page_names_version_seeds_and_the_hash_of_its_data(study):
    page = report_page(study)
    assert study.data_hash in page
    other = replace(study, errors=replace(study.errors, error=study.errors.error + 1e-9))
    assert other.data_hash != study.data_hash
    for word in (
        rodsight.__version__,
        "shear",
        "seeds",
        "sliding_fraction",
        "All stated quantities are within",
        "ambiguous",
    ):
        assert (word in page) == (word != "ambiguous"), word  # no ambiguous contacts
    assert page.count("<tr><td>shear</td>") == 2  # its intervals and its sliding fraction
    narrow = report_page(replace(study, errors=replace(study.errors, sd=0.8 * study.errors.sd)))
    assert ("f_n 68 −" in page, "f_n 68 −" in narrow) == (False, True)
    assert "http" not in page.replace("http://www.w3.org", "")  # self-contained


@pytest.mark.thorough
def test_the_page_compares_predictions_and_names_what_was_diagnosed(study):
    outcomes = (outcome(predicted(SOUND), 0.97), outcome(predicted(None), 0.9))
    page = report_page(replace(study, outcomes=outcomes))
    assert "Prediction and diagnosis" in page
    assert "<tr><td>shear</td><td>correct</td><td>nothing</td><td>nothing 2</td></tr>" in page
    assert "Prediction and diagnosis" not in report_page(study)
    assert replace(study, outcomes=outcomes).facts()["predicted"][0][2] == 0.97


@pytest.mark.slow
def test_limits_hold_on_scenarios_and_a_seed_that_were_not_fitted(tmp_path):
    found = study_calibration(StudyPlan(250, tmp_path), ("sheared", "radii_1"), (4,))
    assert violations(found) == []
