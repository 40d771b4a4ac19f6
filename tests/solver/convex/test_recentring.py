"""Products that a step would leave far from the centre are aimed nearer to it; the others are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from solver.convex.interior_point_kernels import LEAST_PRODUCT, MOST_PRODUCT, Iterate, Room, recentre

CENTRE = 0.2
LOW, HIGH = LEAST_PRODUCT * CENTRE, MOST_PRODUCT * CENTRE


def correction(part: list[float], multiplier: list[float], share: float = 1.0) -> list[float]:
    """What is taken off the excess of one contact whose step leads to these parts and multipliers."""
    pair = np.zeros((1, 2))
    at = Iterate(np.ones((1, 2)), np.ones((1, 2)), np.zeros(3))
    to = (np.array([part]) - 1.0) / share, (np.array([multiplier]) - 1.0) / share
    move = Iterate(*to, np.zeros(3))
    room = Room(pair, np.zeros(3), np.zeros((1, 2)), np.zeros((1, 3)), pair, np.zeros(9), np.zeros(1, np.int64), move,
                move, pair)  # fmt: skip
    recentre(at, room, share, share, CENTRE)
    return (-room.excess[0]).tolist()


def test_products_near_the_centre_are_left_alone():
    assert correction([1.1 * LOW, 0.9 * HIGH], [1.0, 1.0]) == [0.0, 0.0]


def test_small_and_negative_products_are_raised_to_the_least():
    assert correction([0.5 * LOW, -0.3], [1.0, 1.0]) == pytest.approx([0.5 * LOW, LOW + 0.3])


def test_large_ones_are_lowered_to_the_most_but_not_by_more_than_that():
    assert correction([1.0, 1.0], [1.5 * HIGH, 9.0 * HIGH]) == pytest.approx([-0.5 * HIGH, -HIGH])


def test_what_counts_is_the_step_as_far_as_it_is_tried():
    assert correction([0.5 * LOW, 1.0], [1.0, CENTRE], share=0.5) == pytest.approx([0.5 * LOW, 0.0])
