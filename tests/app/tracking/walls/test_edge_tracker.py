"""Tracking of bars without paint by their edges: accuracy across the bars, their ends, and what is no edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.tracking.walls.edge_tracker import EdgeTracker, move_to_corners

from tests.app.tracking.walls.test_wall_tracker import (
    BARS,
    PIXEL_SIZE,
    SCALE,
    SETTINGS,
    move_bar,
    normal_error,
    photograph,
)

NORMAL_ALLOWED = 0.25 * PIXEL_SIZE  # bars cross at their ends, which hides the edge


def plain(bars: np.ndarray, noise_seed: int) -> np.ndarray:
    """A photograph of plain bars and painted rods."""
    return photograph(bars, noise_seed, settings=replace(SETTINGS, bar_coverage=0.0))


@pytest.fixture(scope="module")
def tracker() -> EdgeTracker:
    return EdgeTracker(plain(BARS, 1), BARS, SCALE)


@pytest.mark.parametrize("wall", [0, 1, 2])
@pytest.mark.parametrize(("dx", "dy", "degrees"), [(1.3, -0.7, 0.2), (-3.2, 2.4, -0.4), (31.0, -14.0, 0.5)])
def test_moved_bars_are_found_across_their_faces(
    tracker: EdgeTracker, wall: int, dx: float, dy: float, degrees: float
) -> None:
    bars = move_bar(wall, dx, dy, degrees)
    poses = tracker.follow(plain(bars, 2), [tracker.first()])
    assert np.abs(_off(poses.endpoints, bars)).max() < NORMAL_ALLOWED
    assert (poses.fraction > 0.5).all()


def test_steady_motion_is_extrapolated(tracker: EdgeTracker) -> None:
    history = [tracker.first()]
    for k in range(1, 4):
        bars = move_bar(1, -11.0 * k, 2.0 * k, -0.3 * k)
        history.append(tracker.follow(plain(bars, 40 + k), history))
        assert np.abs(_off(history[-1].endpoints, bars)).max() < NORMAL_ALLOWED


def test_sigma_covers_the_error(tracker: EdgeTracker) -> None:
    scaled = []
    for k in range(6):
        bars = move_bar(k % 3, 0.4 * k, 0.3, 0.05 * k)
        poses = tracker.follow(plain(bars, 20 + k), [tracker.first()])
        scaled.append(_off(poses.endpoints, bars) / poses.sigma)
    assert 0.2 < np.sqrt(np.mean(np.square(scaled))) < 1.5


def test_a_missing_bar_has_no_pose(tracker: EdgeTracker) -> None:
    away = BARS.copy()
    away[1] += 10.0
    poses = tracker.follow(plain(away, 5), [tracker.first()])
    assert np.isnan(poses.endpoints[1]).all()
    assert np.isfinite(poses.endpoints[[0, 2]]).all()
    again = tracker.follow(plain(BARS, 6), [tracker.first(), poses])
    assert np.abs(normal_error(again.endpoints, BARS)).max() < NORMAL_ALLOWED


def test_a_side_without_a_bar_shows_no_edge() -> None:
    image = plain(BARS[:2], 7)
    assert EdgeTracker(image, BARS, SCALE).seen.tolist() == [True, True, False]


def test_a_face_beside_its_edge_stays_beside_it(tracker: EdgeTracker) -> None:
    """A face is given where rods touch it: the edge shows its motion, not its place."""
    inward = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])[:, None] * 2.0 * PIXEL_SIZE
    beside = EdgeTracker(plain(BARS, 1), BARS + inward, SCALE)
    bars = move_bar(0, 0.0, 3.0, 0.0)
    found = beside.follow(plain(bars, 2), [beside.first()]).endpoints
    assert np.abs(normal_error(found, bars + inward)).max() < NORMAL_ALLOWED


def test_ends_move_along_a_bar_as_the_corners_do() -> None:
    """A side bar leans over while the top moves along itself: its ends are where both meet, as on the first frame."""
    first = np.array([[[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [4.0, 2.2]], [[4.0, 2.0], [0.0, 2.0]]])
    second = first.copy()
    second[1] = [[4.0, 0.0], [4.4, 2.2]]
    second[2] = [[4.0, 1.8], [0.0, 1.8]]
    ends = np.stack([first, second])
    moved = move_to_corners(ends, np.array([False, True, True]))
    lean = np.array([0.4, 2.2]) / np.hypot(0.4, 2.2)
    corner = np.array([4.0 + 0.4 * 1.8 / 2.2, 1.8])
    np.testing.assert_array_equal(moved[0], first)
    np.testing.assert_allclose(moved[1, 1], [[4.0, 0.0], corner + 0.2 * lean])  # it reaches beyond the top bar
    np.testing.assert_allclose(moved[1, 2], [corner, [0.0, 1.8]])  # on the left it meets nothing
    np.testing.assert_array_equal(moved[1, 0], second[0])


def test_ends_at_a_bar_that_is_not_found_move_across_only() -> None:
    first = np.array([[[0.0, 0.0], [4.0, 0.0]], [[4.0, 0.0], [4.0, 2.0]]])
    second = np.array([[[0.1, 0.1], [4.1, 0.1]], np.full((2, 2), np.nan)])
    moved = move_to_corners(np.stack([first, second]), np.array([True, True]))
    np.testing.assert_allclose(moved[1, 0], [[0.0, 0.1], [4.0, 0.1]], atol=1e-12)
    assert np.isnan(moved[1, 1]).all()


def _off(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distances (w, 2) [m] of the true ends from the lines that were found."""
    along = found[:, 1] - found[:, 0]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return np.einsum("wek,wk->we", true - found[:, :1], normal)
