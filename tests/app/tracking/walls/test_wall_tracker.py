"""Tracking of the frame's bars: accuracy, rigidity, and a standard deviation that covers the error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.units import Scale
from rodsight.synthetic.speckle import RodScene, SpeckleSettings, render_photograph
from rodsight.tracking.walls.bar_depth import visible_depth
from rodsight.tracking.walls.rigid_motion import fit_common_motion, rotate
from rodsight.tracking.walls.wall_tracker import WallPoses, WallTracker

PIXEL_SIZE = 2.5e-4  # [m]
WIDTH, HEIGHT = 520, 460
SCALE = Scale(PIXEL_SIZE, HEIGHT)
NORMAL_ALLOWED = 5e-6  # [m], a fiftieth of a pixel: negligible for the sample's force networks
SETTINGS = SpeckleSettings(pixel_size=PIXEL_SIZE)
# The packing lies on the left: along the bottom to the right, up on the right, back on top.
BARS = PIXEL_SIZE * np.array(
    [[[60.3, 60.2], [440.7, 60.4]], [[440.1, 61.0], [455.6, 430.2]], [[450.2, 390.3], [75.4, 388.1]]]
)
RODS = PIXEL_SIZE * np.array([[150.0, 92.0], [260.0, 92.0], [250.0, 300.0], [407.0, 200.0]])


def photograph(
    bars: np.ndarray, noise_seed: int, rods: np.ndarray = RODS, settings: SpeckleSettings = SETTINGS
) -> np.ndarray:
    return render_photograph(
        settings,
        RodScene(
            width=WIDTH,
            height=HEIGHT,
            radius=np.full(len(rods), 30.0 * PIXEL_SIZE),
            position=rods,
            rotation=np.zeros(len(rods)),
            bars=bars,
            pattern_seed=5,
        ),
        noise_seed=noise_seed,
    ).astype(np.float32)


def move_bar(wall: int, dx: float, dy: float, degrees: float) -> np.ndarray:
    """The bars with one of them displaced [px] and rotated about its middle."""
    bars = BARS.copy()
    middle = bars[wall].mean(axis=0)
    bars[wall] = middle + rotate(np.deg2rad(degrees), bars[wall] - middle) + PIXEL_SIZE * np.array([dx, dy])
    return bars


def normal_error(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Errors of endpoints along the walls' normals (w, 2) [m]."""
    along = true[:, 1] - true[:, 0]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    return np.einsum("wek,wk->we", found - true, normal)


@pytest.fixture(scope="module")
def tracker() -> WallTracker:
    return WallTracker(photograph(BARS, 1), BARS, SCALE, np.full(3, SETTINGS.bar_thickness))


@pytest.mark.parametrize("wall", [0, 1, 2])
@pytest.mark.parametrize(("dx", "dy", "degrees"), [(1.3, -0.7, 0.2), (-3.2, 2.4, -0.4)])
def test_moved_bars_are_found_to_a_fiftieth_of_a_pixel(
    tracker: WallTracker, wall: int, dx: float, dy: float, degrees: float
) -> None:
    bars = move_bar(wall, dx, dy, degrees)
    poses = tracker.follow(photograph(bars, 2, RODS + 2 * PIXEL_SIZE), [tracker.first()])
    assert np.abs(normal_error(poses.endpoints, bars)).max() < NORMAL_ALLOWED
    assert np.abs(poses.endpoints - bars).max() < 2 * NORMAL_ALLOWED
    length = np.linalg.norm(poses.endpoints[:, 1] - poses.endpoints[:, 0], axis=1)
    assert length == pytest.approx(np.linalg.norm(BARS[:, 1] - BARS[:, 0], axis=1), rel=1e-12)


def test_sigma_covers_the_error(tracker: WallTracker) -> None:
    scaled = []
    for k in range(6):
        bars = move_bar(k % 3, 0.4 * k, 0.3, 0.05 * k)
        poses = tracker.follow(photograph(bars, 20 + k), [tracker.first()])
        scaled.append(normal_error(poses.endpoints, bars) / poses.sigma)
    # The reference's own noise is common to all; a bar's patches are few.
    assert 0.2 < np.sqrt(np.mean(np.square(scaled))) < 1.5


def test_a_bar_that_jumped_is_searched_for(tracker: WallTracker) -> None:
    bars = move_bar(2, 31.0, -14.0, 1.0)
    poses = tracker.follow(photograph(bars, 3), [tracker.first()])
    assert np.abs(normal_error(poses.endpoints, bars)).max() < NORMAL_ALLOWED


def test_steady_motion_is_extrapolated(tracker: WallTracker) -> None:
    history = [tracker.first()]
    for k in range(1, 4):
        bars = move_bar(1, -9.0 * k, 2.0 * k, -0.3 * k)
        history.append(tracker.follow(photograph(bars, 40 + k), history))
        assert np.abs(normal_error(history[-1].endpoints, bars)).max() < NORMAL_ALLOWED


def test_an_object_before_a_bar_gets_no_weight(tracker: WallTracker) -> None:
    bars = move_bar(0, 2.0, 0.5, 0.1)
    image = photograph(bars, 4)
    x, y = SCALE.to_pixels(bars[0, 0])
    image[int(y) - 5 :, int(x) + 100 : int(x) + 230] = 90.0
    poses = tracker.follow(image, [tracker.first()])
    assert poses.patches[0] < tracker.patch_count[0]
    assert np.abs(normal_error(poses.endpoints, bars)).max() < NORMAL_ALLOWED


def test_a_missing_bar_has_no_pose(tracker: WallTracker) -> None:
    away = BARS.copy()
    away[1] += 10.0
    poses = tracker.follow(photograph(away, 5), [tracker.first()])
    assert np.isnan(poses.endpoints[1]).all()
    assert np.isfinite(poses.endpoints[[0, 2]]).all()
    again = tracker.follow(photograph(BARS, 6), [tracker.first(), poses])
    assert np.abs(normal_error(again.endpoints, BARS)).max() < NORMAL_ALLOWED


def test_results_do_not_depend_on_the_number_of_workers(tracker: WallTracker) -> None:
    image = photograph(move_bar(0, 1.0, 1.0, 0.1), 7)
    depth = np.full(3, SETTINGS.bar_thickness)
    found: list[WallPoses] = [
        WallTracker(photograph(BARS, 1), BARS, SCALE, depth, workers=n).follow(image, [tracker.first()]) for n in (1, 2)
    ]
    assert found[0].endpoints.tobytes() == found[1].endpoints.tobytes()


def test_depth_of_the_bars_is_seen_in_the_photograph() -> None:
    depth = visible_depth(photograph(BARS, 1), BARS, SCALE, 0.02)
    assert depth == pytest.approx(SETTINGS.bar_thickness, abs=2 * PIXEL_SIZE)


def test_a_bar_like_its_background_gets_the_greatest_depth() -> None:
    assert (visible_depth(np.full((HEIGHT, WIDTH), 80.0, np.float32), BARS, SCALE, 0.01) == 0.01).all()


def test_bar_without_marks_has_no_usable_patch() -> None:
    blank = np.full((HEIGHT, WIDTH), 80.0, np.float32)
    assert not WallTracker(blank, BARS, SCALE, np.full(3, 0.012)).patch_count.any()


def test_rigid_motion_is_that_of_the_majority() -> None:
    generator = np.random.default_rng(1)
    position = generator.uniform(0.0, [0.3, 0.01], (30, 2))
    true = position.mean(axis=0) + np.array([0.01, -0.02]) + rotate(0.3, position - position.mean(axis=0))
    displaced = true.copy()
    displaced[:9] += generator.normal(0.0, 0.01, (9, 2))
    covariance = np.tile(1e-12 * np.eye(2), (30, 1, 1))
    motion, covariance_found, agree = fit_common_motion(
        position, displaced, covariance, middle=position.mean(axis=0), outlier=5.0, tolerance=1e-10
    )
    assert motion == pytest.approx([0.01, -0.02, 0.3], abs=1e-9)
    assert not agree[:9].any()
    assert agree[9:].all()
    assert np.linalg.eigvalsh(covariance_found).min() > 0.0


def test_a_point_with_a_large_variance_along_one_axis_constrains_only_the_other() -> None:
    position = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
    displaced = position + np.array([[0.5, 0.1], [0.1, 0.1], [0.1, 0.1], [0.1, 0.1]])
    covariance = np.tile(np.diag([1e-6, 1e-6]), (4, 1, 1))
    covariance[0] = np.diag([1.0, 1e-6])
    motion, _, agree = fit_common_motion(
        position, displaced, covariance, middle=np.zeros(2), outlier=5.0, tolerance=1e-9
    )
    assert motion == pytest.approx([0.1, 0.1, 0.0], abs=1e-4)
    assert agree.all()


def test_settings_are_checked() -> None:
    from rodsight.tracking.walls.wall_tracker import WallSettings

    with pytest.raises(ValueError, match="patch_radius"):
        replace(WallSettings(), patch_radius=(9.0, 5.0))


@pytest.mark.slow
def test_sample_bars_agree_with_their_table() -> None:
    from rodsight.experiment.experiment import load_experiment
    from rodsight.experiment.walls import read_walls

    experiment = load_experiment(Path(__file__).parents[4] / "sample_data" / "shear")
    photographs = experiment.photographs()
    walls = read_walls(experiment, len(photographs))
    assert walls is not None
    scale = Scale(PIXEL_SIZE, photographs.shape[0])
    depth = visible_depth(photographs[0], walls.endpoints[0], scale, 0.025)
    tracker = WallTracker(photographs[0], walls.endpoints[0], scale, depth)
    history = [tracker.first()]
    for k in range(1, len(photographs)):
        history.append(tracker.follow(photographs[k], history[-8:]))
        assert np.abs(normal_error(history[-1].endpoints, walls.endpoints[k])).max() < NORMAL_ALLOWED


def test_a_thin_bar_shows_a_line_that_does_not_show_the_motion_along_it(tracker: WallTracker) -> None:
    thin = replace(SETTINGS, bar_coverage=0.0, bar_thickness=0.0015)
    image = photograph(BARS, 1, settings=thin)
    lines = WallTracker(image, BARS, SCALE, visible_depth(image, BARS, SCALE, 0.02))
    assert lines.lined.all()
    assert not tracker.lined.any()
