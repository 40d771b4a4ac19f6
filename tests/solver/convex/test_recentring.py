"""Centrality corrections move products towards the target only if a step leaves them far from it."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.convex.interior_point_kernels import MAX_PRODUCT, MIN_PRODUCT, Iterate, Workspace, recentre

TARGET = 0.2
LOW, HIGH = MIN_PRODUCT * TARGET, MAX_PRODUCT * TARGET


def correction(edge_force: list[float], multiplier: list[float], step_length: float = 1.0) -> list[float]:
    """Correction of one contact whose step leads to these edge forces and multipliers."""
    pair = np.zeros((1, 2))
    current = Iterate(np.ones((1, 2)), np.ones((1, 2)), np.zeros(3))
    to = (np.array([edge_force]) - 1.0) / step_length, (np.array([multiplier]) - 1.0) / step_length
    step = Iterate(*to, np.zeros(3))
    workspace = Workspace(pair, np.zeros(3), np.zeros((1, 2)), np.zeros((1, 3)), pair, np.zeros(9),
                          np.zeros(1, np.int64), step, step, pair)  # fmt: skip
    recentre(current, workspace, step_length, step_length, TARGET)
    return (-workspace.complementarity_residual[0]).tolist()


def test_products_near_the_target_are_unchanged():
    assert correction([1.1 * LOW, 0.9 * HIGH], [1.0, 1.0]) == [0.0, 0.0]


def test_small_and_negative_products_are_raised_to_the_lower_bound():
    assert correction([0.5 * LOW, -0.3], [1.0, 1.0]) == pytest.approx([0.5 * LOW, LOW + 0.3])


def test_large_products_are_lowered_by_at_most_the_upper_bound():
    assert correction([1.0, 1.0], [1.5 * HIGH, 9.0 * HIGH]) == pytest.approx([-0.5 * HIGH, -HIGH])


def test_the_correction_uses_the_extended_step():
    assert correction([0.5 * LOW, 1.0], [1.0, TARGET], step_length=0.5) == pytest.approx([0.5 * LOW, 0.0])
