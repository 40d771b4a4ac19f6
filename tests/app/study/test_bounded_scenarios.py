"""Forces of packings that other things than walls hold: a periodic cell, outermost rods, a membrane."""

import pytest
from rodsight.study.scenarios.scenario_score import StudyPlan, score_scenario


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "grains", "least"), [("periodic", 300, 0.97), ("outer", 450, 0.94)])
def test_forces_without_walls_follow_the_truth(tmp_path, scenario, grains, least):
    score = score_scenario(StudyPlan(grains, tmp_path), scenario, 1)
    assert not score.refused
    assert score.r_late is not None
    assert score.r_late > least
    assert score.scale is None
    assert score.too_trusting(suspect=False)[0] == 0


@pytest.mark.slow
def test_the_part_of_a_load_that_boundary_rods_bear_is_left_out(tmp_path):
    score = score_scenario(StudyPlan(200, tmp_path), "membrane", 42)
    assert not score.refused
    assert score.scale == pytest.approx(1.0, abs=0.04)  # 1.10 with the whole load on the other rods
    assert score.r_late is not None
    assert score.r_late > 0.95
    assert score.too_trusting(suspect=False)[0] == 0
