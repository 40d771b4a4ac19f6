"""Forces of packings without walls against the truth: a periodic cell, and the middle of a packing."""

import pytest
from rodsight.study.worlds.world_score import WorldPlan, score_world


@pytest.mark.slow
@pytest.mark.parametrize(("world", "grains", "least"), [("periodic", 300, 0.97), ("outer", 450, 0.94)])
def test_forces_without_walls_follow_the_truth(tmp_path, world, grains, least):
    score = score_world(WorldPlan(grains, tmp_path), world, 1)
    assert not score.refused
    assert score.r_late is not None
    assert score.r_late > least
    assert score.scale is None
    assert score.too_trusting(suspect=False)[0] == 0
