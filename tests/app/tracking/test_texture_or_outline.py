"""Rods are followed by their outlines where the paint shows too little of them, and else by their texture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.tracking.detection.detect import refine_grains
from rodsight.tracking.texture_or_outline import prefer_outlines

from tests.app.tracking.outline.discs import WHITE, photograph_discs
from tests.app.tracking.speckled import grid_of_rods

RODS = grid_of_rods(7, 6, radius=18.0, pitch=37.0, margin=40.0)
RNG = np.random.default_rng(5)
TURN = RNG.normal(0.0, 0.05, RODS.count)  # [rad]
# [px], with what rods really move against their neighbours
MOVE_X = 1.7 + 0.01 * RODS.y + RNG.normal(0.0, 0.12, RODS.count)
MOVE_Y = -0.6 + 0.004 * RODS.x + RNG.normal(0.0, 0.12, RODS.count)


def with_one_dot(x: Array, y: Array, rotation: Array, seed: int) -> np.ndarray:
    """White rods with one dark dot half-way between their centre and their rim."""
    picture = photograph_discs(
        WHITE, (RODS.height, RODS.width), x, y, RODS.radius, np.zeros(RODS.count), seed
    )  # fmt: skip
    fine = np.zeros((4 * RODS.height, 4 * RODS.width), np.float32)
    for k in range(RODS.count):
        at = x[k] + 9.0 * np.cos(rotation[k]), y[k] + 9.0 * np.sin(rotation[k])
        cv2.circle(fine, tuple(round(4.0 * each + 1.5) for each in at), 14, 150.0, -1)
    return picture - cv2.resize(fine, picture.shape[::-1], interpolation=cv2.INTER_AREA)


@pytest.mark.parametrize(
    ("paint", "reason"), [("dot", "paint shows too little"), ("none", "42 of 42"), ("speckle", "")]
)
def test_outlines_are_preferred_where_paint_does_not_fix_a_rod(paint: str, reason: str) -> None:
    moved = RODS.x + MOVE_X, RODS.y + MOVE_Y
    if paint == "speckle":
        pictures = RODS.reference(), RODS.moved(MOVE_X, MOVE_Y, TURN)
    elif paint == "dot":
        pictures = with_one_dot(RODS.x, RODS.y, 0.0 * TURN, 1), with_one_dot(*moved, TURN, 2)
    else:
        size, none = (RODS.height, RODS.width), np.zeros(RODS.count)
        pictures = tuple(
            photograph_discs(WHITE, size, x, y, RODS.radius, none, seed)
            for seed, (x, y) in enumerate([(RODS.x, RODS.y), moved])
        )
    found = refine_grains(pictures[0], RODS.x, RODS.y, RODS.radius)
    assert reason in (stated := prefer_outlines(pictures[0], pictures[1], found))
    assert bool(stated) == bool(reason)
