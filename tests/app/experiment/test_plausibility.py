"""Tracks, radii and walls that cannot belong together are told."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.experiment.plausibility import neighbour_spacing, rods_beyond_ends
from rodsight.tracks import Tracks, TrackStatus, WallTracks

RADIUS = 0.01  # [m]


def row_of_rods(count: int) -> Tracks:
    """Rods side by side on the line y = 0, the first touching x = 0."""
    x = RADIUS * (1.0 + 2.0 * np.arange(count))
    position = np.stack([x, np.full(count, RADIUS)], axis=1)[None]
    given = np.full((1, count), TrackStatus.GIVEN, np.uint8)
    zero = np.zeros((1, count))
    return Tracks(np.arange(count), np.full(count, RADIUS), np.zeros(1), position, zero, zero, zero * np.nan, given)


def floor(length: float) -> WallTracks:
    return WallTracks(("floor",), np.array([[[[0.0, 0.0], [length, 0.0]]]]), np.array([np.nan]))


@pytest.mark.parametrize(("missing", "told"), [(0, []), (2, ["2 rods"])])
def test_rods_beyond_a_wall_s_end_are_told(missing, told):
    found = rods_beyond_ends(row_of_rods(6), floor(2.0 * RADIUS * (6 - missing)))
    assert [sentence[:6] for sentence in found] == told
    assert all("'floor'" in sentence for sentence in found)


def test_touching_neighbours_lie_the_sum_of_their_radii_away():
    rods = row_of_rods(5)
    assert neighbour_spacing(rods.position[0], rods.radius) == pytest.approx(np.ones(5))
    assert neighbour_spacing(rods.position[0], 2.0 * rods.radius) == pytest.approx(np.full(5, 0.5))
    assert len(neighbour_spacing(rods.position[0, :1], rods.radius[:1])) == 0
