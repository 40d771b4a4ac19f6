"""The calibration report: it tells what it was made of, what does not hold, and (slow) that all holds."""

from dataclasses import replace

import numpy as np
import pytest
import rodsight
from rodsight.study.report.calibration_report import CalibrationStudy, TrustedFrames, broken, study_calibration
from rodsight.study.report.report_page import report_page
from rodsight.study.worlds.contact_errors import ContactErrors
from rodsight.study.worlds.numbers import Compared, compared_names
from rodsight.study.worlds.world_score import WorldPlan

from solver.sequence.judging.intervals import Term

COUNT = 6000


@pytest.fixture(scope="module")
def study():
    rng = np.random.default_rng(3)
    none = np.zeros(COUNT, np.bool_)
    errors = ContactErrors(
        world=np.full(COUNT, "shear"), seed=np.zeros(COUNT, np.int64), frame=np.ones(COUNT, np.int64),
        group=np.ones(COUNT, np.uint8), wall=rng.random(COUNT) < 0.1, sliding=none, doubtful=none,
        witness=np.zeros(COUNT, np.uint8), terms=np.zeros((COUNT, len(Term))),
        force=rng.random((COUNT, 2)) * 2,
        error=rng.standard_normal((COUNT, 2)), deviation=np.ones((COUNT, 2)), formula=np.ones((COUNT, 2)),
    )  # fmt: skip
    ten = np.ones(10)
    numbers = [
        Compared("shear", 0, name, 1.02 * ten, ten, 0.05 * ten, 0.1 * ten, np.zeros(10, np.uint8))
        for name in compared_names()
    ]
    frames = TrustedFrames(np.full(10, "shear"), 0.9 * ten, 0.97 * ten, np.zeros(10, np.bool_))
    return CalibrationStudy(("shear",), (0,), 30, errors, numbers, frames)


def test_what_holds_is_not_complained_of_and_what_does_not_is(study):
    assert broken(study) == []
    narrow = replace(study, errors=replace(study.errors, deviation=0.5 * study.errors.deviation))
    assert any("of f_n of weak contacts: covers" in each for each in broken(narrow))
    trusting = replace(study, frames=replace(study.frames, trust=np.where(np.arange(10) < 1, 0.99, 0.9)))
    assert any("below the trust in 10 %" in each for each in broken(trusting))
    numbers = [replace(each, stated=1.3 * each.true) for each in study.numbers]
    assert any("sliding contacts is off by +30 %" in each for each in broken(replace(study, numbers=numbers)))


def test_the_page_tells_version_seeds_and_the_hash_of_its_data(study):
    page = report_page(study)
    assert study.data_hash in page
    other = replace(study, errors=replace(study.errors, error=study.errors.error + 1e-9))
    assert other.data_hash != study.data_hash
    for word in (rodsight.__version__, "shear", "seeds", "sliding_fraction", "All that is stated holds", "doubtful"):
        assert (word in page) == (word != "doubtful"), word  # no doubtful contacts, nothing said of them
    assert page.count("<tr><td>shear</td>") == 2  # its intervals, and the share that slides in it
    narrow = report_page(replace(study, errors=replace(study.errors, deviation=0.8 * study.errors.deviation)))
    assert ("f_n 68 −" in page, "f_n 68 −" in narrow) == (False, True)
    assert "http" not in page.replace("http://www.w3.org", "")  # it needs nothing else


@pytest.mark.slow
def test_what_is_stated_holds_on_worlds_and_a_seed_that_were_not_fitted(tmp_path):
    found = study_calibration(WorldPlan(250, tmp_path), ("sheared", "radii_1"), (4,))
    assert broken(found) == []
