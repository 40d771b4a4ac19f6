"""Forces of packings without walls against the truth: a periodic cell, and the interior of a packing."""

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
