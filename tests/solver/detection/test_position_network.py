import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.detection.position_network import PositionNetwork
from rodsight.solver.detection.touch_probability import TouchCandidates

R = 0.01


def test_positions_and_variances_are_those_of_the_dense_least_squares():
    """Every message is an equation for the gap of a pair; every measured position is another one."""
    rng = np.random.default_rng(4)
    grains = Grains.of_rods(np.full(4, R), density=2700.0, length=0.06)
    # The third pair is with a wall; the grain with most pairs is not the first to be eliminated.
    i, j = np.array([0, 0, 0, 0, 2], np.int32), np.array([1, 3, 4, 2, 3], np.int32)
    angle, gap = rng.uniform(-3, 3, 5), rng.normal(0, 1e-5, 5)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    weight, mean = rng.uniform(0.5, 2.0, 5) * 1e10, rng.normal(0, 1e-6, 5)
    sigma = np.array([1e-5, 2e-5, 1.5e-5, 2.5e-5])
    network = PositionNetwork.of(grains, TouchCandidates(i, j, gap[None], np.full((1, 5), 1e-5)))
    found = network.refine(normal, gap, weight, weight * mean, sigma)

    design, tangent = np.zeros((5, 8)), np.zeros((5, 8))
    for c in range(5):
        for row, n in ((design, normal[c]), (tangent, np.array([-normal[c, 1], normal[c, 0]]))):
            row[c, 2 * i[c] : 2 * i[c] + 2] = -n
            if j[c] < 4:
                row[c, 2 * j[c] : 2 * j[c] + 2] = n
    covariance = np.linalg.inv(design.T @ np.diag(weight) @ design + np.diag(np.repeat(sigma**-2.0, 2)))
    moved = covariance @ design.T @ (weight * (mean - gap))
    assert found.displacement.ravel() == pytest.approx(moved, rel=1e-9)
    assert found.gap == pytest.approx(gap + design @ moved, rel=1e-9)
    assert found.gap_variance == pytest.approx(np.diag(design @ covariance @ design.T), rel=1e-9)
    assert found.sliding_variance == pytest.approx(np.diag(tangent @ covariance @ tangent.T), rel=1e-9)


def test_unknown_pair_has_no_effect():
    grains = Grains.of_rods(np.full(3, R), density=2700.0, length=0.06)
    i, j = np.array([0, 1], np.int32), np.array([1, 2], np.int32)
    gap, normal = np.array([1e-5, np.nan]), np.array([[1.0, 0.0], [np.nan, np.nan]])
    network = PositionNetwork.of(grains, TouchCandidates(i, j, gap[None], np.full((1, 2), 1e-5)))
    found = network.refine(normal, gap, np.full(2, 1e10), np.zeros(2), np.full(3, 1e-5))
    assert found.displacement[2].tolist() == [0.0, 0.0]
    assert found.displacement[0, 0] > 0.0 > found.displacement[1, 0]
    for of_pairs in (found.gap, found.gap_variance, found.sliding_variance):
        assert np.isfinite(of_pairs).tolist() == [True, False]
