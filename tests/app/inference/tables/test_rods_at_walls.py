"""A rod that touches a wall overlaps it by no more than rods overlap each other."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rodsight.inference.correction.tables.rods_at_walls import ROUGH, SIGMAS, RodsAtWalls
from rodsight.inference.correction.tables.wall_places import correct_wall_places

from ..diagnosis.test_direct_tests import NOISE, PITCH, RADIUS, rolling_tracks
from .test_wall_places import misplaced

OVERLAP = 0.02 * RADIUS


def pressed_tracks():
    """Rods that overlap all of their neighbours."""
    tracks = rolling_tracks()
    return replace(tracks, radius=0.0 * tracks.radius + 0.5 * (PITCH + OVERLAP))


def test_rods_touch_within_noise_or_the_overlaps_of_rods():
    assert RodsAtWalls.of(rolling_tracks()).width == pytest.approx(max(SIGMAS * NOISE, ROUGH * RADIUS), rel=1e-3)
    assert RodsAtWalls.of(pressed_tracks()).width == pytest.approx(OVERLAP, abs=3.0 * NOISE)
    assert RodsAtWalls.of(pressed_tracks()).width > 3.0 * SIGMAS * NOISE


@pytest.mark.parametrize(("inside", "stays"), [(0.9 * OVERLAP, True), (2.5 * OVERLAP, False)])
def test_a_wall_that_rods_overlap_as_one_another_stays(inside, stays):
    # Rods of these radii reach beyond their places in the box, all by the same.
    beyond = 0.5 * (PITCH + OVERLAP) - RADIUS
    walls = misplaced(beyond - inside)
    corrected, done = correct_wall_places(pressed_tracks(), walls)
    assert (corrected is walls) is stays
    assert ("too far inside" in done) is not stays
