"""Tracking of grains: accuracy, range, and the status of failures."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.registration.poses import FramePoses
from rodsight.tracking.settings import TrackingSettings
from rodsight.tracking.tracker import Tracker
from rodsight.tracks import TrackStatus

from tests.app.tracking.speckled import Rods, grid_of_rods

PATCH_RADIUS = 20.0  # [px]
BIAS_ALLOWED = 0.005  # [px], the aim for a method without pull towards whole or half pixels
RMS_ALLOWED = 0.015  # [px]
ROTATION_ALLOWED = 1e-3  # [rad]
OCCLUDED_RMS_ALLOWED = 0.03  # [px] with 30 % of every patch covered
WRONG = 0.5  # [px] error of a wrong place, as distinct from an inaccurate one


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(6, 6, radius=PATCH_RADIUS / TrackingSettings().patch_fraction, pitch=49.0, margin=90.0)


@pytest.fixture(scope="module")
def tracker(rods: Rods) -> Tracker:
    return Tracker(rods.reference(), (rods.x, rods.y, rods.radius))


def errors(poses: FramePoses, rods: Rods, dx: float, dy: float) -> np.ndarray:
    return np.stack([poses.x - rods.x - dx, poses.y - rods.y - dy], axis=1)


def unflagged(poses: FramePoses) -> np.ndarray:
    return np.isin(poses.status, [TrackStatus.OK, TrackStatus.RESCUED, TrackStatus.ROBUST])


def test_first_frame_is_the_reference_itself(rods: Rods, tracker: Tracker) -> None:
    first = tracker.first()
    assert np.array_equal(first.x, rods.x)
    assert np.array_equal(first.y, rods.y)
    assert not first.rotation.any()
    assert (first.status == TrackStatus.OK).all()
    assert ((first.sigma > 0) & (first.sigma < 0.02)).all()


@pytest.mark.parametrize("part", [0.0, 0.25, 0.5, 0.75])
def test_no_bias_towards_whole_or_half_pixels(rods: Rods, tracker: Tracker, part: float) -> None:
    poses = tracker.follow(rods.moved(1.0 + part, -2.0 - part, 0.0), [tracker.first()])
    error = errors(poses, rods, 1.0 + part, -2.0 - part)
    assert np.abs(error.mean(axis=0)).max() < BIAS_ALLOWED
    assert np.sqrt((error**2).mean()) < RMS_ALLOWED


def test_error_is_near_the_cramer_rao_bound(rods: Rods, tracker: Tracker) -> None:
    # sigma of the first frame is the bound for the noise of one photograph; two of them are compared.
    bound = np.sqrt(2.0) * tracker.first().sigma * rods.settings.noise / tracker.noise
    scaled = []
    for seed in range(4):
        poses = tracker.follow(rods.moved(0.3 * seed, 0.7, 0.02 * seed, noise_seed=10 + seed), [tracker.first()])
        scaled.append(errors(poses, rods, 0.3 * seed, 0.7) / bound[:, None])
    # The speckle of this reference is one draw; its own noise is common to the four.
    assert np.sqrt(np.mean(np.square(scaled))) < 1.15


def test_sigma_covers_the_error(rods: Rods, tracker: Tracker) -> None:
    poses = tracker.follow(rods.moved(0.4, 0.4, 0.3), [tracker.first()])
    scaled = errors(poses, rods, 0.4, 0.4) / poses.sigma[:, None]
    assert 0.75 < np.sqrt((scaled**2).mean()) < 1.25


def test_rotation_counts_from_x_towards_y(rods: Rods, tracker: Tracker) -> None:
    rotation = np.linspace(-0.3, 0.3, rods.count)
    poses = tracker.follow(rods.moved(0.0, 0.0, rotation), [tracker.first()])
    assert np.sqrt(np.mean((poses.rotation - rotation) ** 2)) < ROTATION_ALLOWED


def test_rotation_continues_beyond_half_a_revolution(rods: Rods, tracker: Tracker) -> None:
    history = [tracker.first()]
    for rotation in (1.2, 2.4, 3.6, 4.8):
        history.append(tracker.follow(rods.moved(0.0, 0.0, rotation), history[-2:]))
        assert np.abs(history[-1].rotation - rotation).max() < 5 * ROTATION_ALLOWED


@pytest.mark.parametrize(("dx", "dy"), [(40.0, 0.0), (-28.3, 28.3)])
def test_jump_of_forty_pixels_with_sixty_degrees_loses_none(rods: Rods, tracker: Tracker, dx: float, dy: float) -> None:
    rotation = np.deg2rad(60.0) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    poses = tracker.follow(rods.moved(dx, dy, rotation), [tracker.first()])
    assert poses.has_pose.all()
    assert np.abs(errors(poses, rods, dx, dy)).max() < 0.05
    assert np.abs(poses.rotation - rotation).max() < 5 * ROTATION_ALLOWED
    assert (poses.status == TrackStatus.RESCUED).mean() > 0.5


@pytest.mark.parametrize("grey", [0.0, 255.0])
def test_thirty_per_cent_covered_is_still_followed(rods: Rods, tracker: Tracker, grey: float) -> None:
    image = rods.moved(1.3, -2.2, 0.1)
    cover(image, rods.x + 1.3, rods.y - 2.2, 0.3, grey)
    poses = tracker.follow(image, [tracker.first()])
    assert poses.has_pose.all()
    assert (poses.status == TrackStatus.ROBUST).mean() > 0.9
    error = errors(poses, rods, 1.3, -2.2)
    assert np.sqrt((error**2).mean()) < OCCLUDED_RMS_ALLOWED


def test_half_covered_gives_no_unflagged_wrong_pose(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(12.0, 5.0, 0.4)
    cover(image, rods.x + 12.0, rods.y + 5.0, 0.5, 255.0)
    poses = tracker.follow(image, [tracker.first()])
    wrong = np.abs(errors(poses, rods, 12.0, 5.0)).max(axis=1) > WRONG
    assert not (wrong & unflagged(poses)).any()


@pytest.mark.parametrize("other", ["other paint", "blank"])
def test_foreign_photograph_loses_every_grain(rods: Rods, tracker: Tracker, other: str) -> None:
    image = np.full((rods.height, rods.width), 100.0, np.float32)
    if other == "other paint":
        unmoved = np.zeros(rods.count)
        image = rods.photograph(rods.x, rods.y, unmoved, noise_seed=4, pattern_seed=77).astype(np.float32)
    poses = tracker.follow(image, [tracker.first()])
    assert (poses.status == TrackStatus.LOST).all()
    assert not np.isfinite(poses.x).any()


def test_lost_grains_are_found_again(rods: Rods, tracker: Tracker) -> None:
    first = tracker.first()
    covered = rods.moved(2.0, 0.0, 0.1)
    cover(covered, rods.x[:5] + 2.0, rods.y[:5], 1.0, 20.0)
    second = tracker.follow(covered, [first])
    assert (second.status[:5] == TrackStatus.LOST).all()
    third = tracker.follow(rods.moved(4.0, 1.0, 0.2), [first, second])
    assert third.has_pose.all()
    assert np.abs(errors(third, rods, 4.0, 1.0)).max() < 0.05


def test_grain_at_the_border_is_flagged(rods: Rods, tracker: Tracker) -> None:
    history = [tracker.first()]
    for shift in (25.0, 50.0, 75.0):
        history.append(tracker.follow(rods.moved(-shift, 0.0, 0.0), history))
    leaves = rods.x - 75.0 < PATCH_RADIUS
    assert leaves.any()
    assert (history[-1].status[leaves] == TrackStatus.OUT_OF_FRAME).all()
    assert not np.isfinite(history[-1].x[leaves]).any()
    assert history[-1].has_pose[~leaves].all()


def test_grain_cut_by_the_border_of_the_reference_has_no_pose(rods: Rods) -> None:
    x = np.concatenate([rods.x[:2], [5.0]])
    y = np.concatenate([rods.y[:2], [60.0]])
    tracker = Tracker(rods.reference(), (x, y, rods.radius[:3]))
    assert tracker.first().status.tolist() == [TrackStatus.OK, TrackStatus.OK, TrackStatus.OUT_OF_FRAME]
    again = tracker.follow(rods.moved(1.0, 0.0, 0.0), [tracker.first()])
    assert again.status.tolist() == [TrackStatus.OK, TrackStatus.OK, TrackStatus.OUT_OF_FRAME]


def test_sixteen_bits_are_used_to_the_full() -> None:
    # At a hundredth of full scale eight bits leave three grey levels; sixteen leave six hundred.
    dim = {"white": 185.0 / 60, "black": 60.0 / 60, "gap": 0.2, "gap_texture": 0.05, "bar_metal": 1.0, "noise": 0.02}
    rms = {}
    for depth in (8, 16):
        rods = grid_of_rods(4, 4, radius=23.5, pitch=49.0, margin=60.0, depth=depth, **dim)
        scale = np.float32(60.0 if depth == 8 else 60.0 * 255.0 / 65535.0)
        tracker = Tracker(rods.reference() * scale, (rods.x, rods.y, rods.radius))
        poses = tracker.follow(rods.moved(0.37, 0.21, 0.0) * scale, [tracker.first()])
        rms[depth] = np.sqrt(np.nanmean(errors(poses, rods, 0.37, 0.21) ** 2))
    assert rms[16] < 0.3 * rms[8]


def test_results_do_not_depend_on_the_number_of_workers(rods: Rods) -> None:
    rotation = np.where(np.arange(rods.count) % 3, 0.1, 1.0)
    image = rods.moved(3.0, 20.0, rotation)
    cover(image, rods.x[:9] + 3.0, rods.y[:9] + 20.0, 0.3, 255.0)
    found = []
    for workers in (1, 2):
        tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=workers)
        found.append(tracker.follow(image, [tracker.first()]))
    for other in found[1:]:
        for name in ("x", "y", "rotation", "sigma", "zncc", "status"):
            assert getattr(found[0], name).tobytes() == getattr(other, name).tobytes()


def test_resuming_from_stored_poses_is_bit_identical(rods: Rods, tracker: Tracker) -> None:
    history = [tracker.first()]
    images = [rods.moved(2.0 * k, -1.0 * k, 0.05 * k, noise_seed=20 + k) for k in (1, 2, 3)]
    for image in images:
        history.append(tracker.follow(image, history))
    again = Tracker(rods.reference(), (rods.x, rods.y, rods.radius)).follow(images[-1], history[1:3])
    assert np.array_equal(again.x, history[-1].x)
    assert np.array_equal(again.rotation, history[-1].rotation)


def test_history_must_not_be_empty(rods: Rods, tracker: Tracker) -> None:
    with pytest.raises(ValueError, match="history"):
        tracker.follow(rods.reference(), [])


def test_photograph_of_another_size_is_refused(rods: Rods, tracker: Tracker) -> None:
    with pytest.raises(ValueError, match="reference"):
        tracker.follow(rods.reference()[:-1], [tracker.first()])


def cover(image: np.ndarray, x: np.ndarray, y: np.ndarray, fraction: float, grey: float) -> None:
    """Cover a cap of every patch with one grey, on a side that differs from grain to grain."""
    angle = np.linspace(0.0, 2 * np.pi, 1001)
    # Fraction of a unit disc beyond a chord at distance cos(half the angle it subtends).
    cap = (angle - np.sin(angle)) / (2 * np.pi)
    chord = PATCH_RADIUS * np.cos(0.5 * np.interp(fraction, cap, angle))
    row, column = np.mgrid[: image.shape[0], : image.shape[1]]
    for k in range(len(x)):
        dx, dy = column - x[k], row - y[k]
        side = 2.4 * k
        image[(np.hypot(dx, dy) < PATCH_RADIUS + 4) & (dx * np.cos(side) + dy * np.sin(side) > chord)] = grey
