"""Speed of the tracker per core, and its accuracy on many photographs.

pytest tests/benchmarks/test_tracking_benchmark.py --benchmark-only -s
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.pictures.image import LUMA
from rodsight.experiment.scaling import make_scale
from rodsight.experiment.walls import read_walls
from rodsight.tracking.registration.poses import FramePoses
from rodsight.tracking.tracker import Tracker
from rodsight.tracking.walls.bar_depth import visible_depth
from rodsight.tracking.walls.wall_tracker import WallTracker
from rodsight.tracks import TrackStatus

from tests.app.tracking.real_like import Laboratory, brown_photograph
from tests.app.tracking.speckled import Rods, grid_of_rods
from tests.app.tracking.test_tracker import cover

SAMPLE = Path(__file__).parents[2] / "sample_data" / "shear"
PATCH_RADIUS = 20.0  # [px]
RADIUS = PATCH_RADIUS / 0.85  # [px]
WRONG = 0.5  # [px]
DRAWS = 4  # of paint and noise, 400 grains each

Benchmark = Callable[..., FramePoses]


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(20, 20, radius=RADIUS, pitch=49.0, margin=90.0)


@pytest.fixture(scope="module")
def tracker(rods: Rods) -> Tracker:
    return Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=1)


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(np.square(values))))


def wrong_unflagged(poses: FramePoses, x: np.ndarray, y: np.ndarray) -> int:
    flagged = ~np.isin(poses.status, [TrackStatus.OK, TrackStatus.RESCUED, TrackStatus.ROBUST])
    return int((poses.has_pose & (np.hypot(poses.x - x, poses.y - y) > WRONG) & ~flagged).sum())


def cpu_seconds(tracker: Tracker, image: np.ndarray, rounds: int = 3) -> float:
    """Median processor time of one photograph [s]."""
    spent = []
    for _ in range(rounds):
        since = time.process_time()
        tracker.follow(image, [tracker.first()])
        spent.append(time.process_time() - since)
    return float(np.median(spent))


def report(text: str) -> None:
    print(f"\n    {text}")


def cramer_rao(clean: Tracker, noise: float) -> float:
    """Cramér-Rao bound of the rms error of a displacement component between two photographs [px].

    clean: tracker of a photograph without noise.

    The photographs are s + n₁ and a·s(W⁻¹·) + b + n₂ with unknown x, y, θ, a, b; near the truth their difference is
    J·(x, y, θ, a, b) + n₂ − n₁, J = (∂s/∂x, ∂s/∂y, ∂s/∂θ, s, 1), of variance 2σ² a pixel, so that the covariance is no
    less than 2σ² (JᵀJ)⁻¹: the tracker's inverse Hessian with s and 1 projected out. Rounding to 8 bits adds 1/12 to σ².
    """
    covariance = clean.patches.hessian_inverse
    variance = 2.0 * (noise**2 + 1.0 / 12.0) / clean.patches.norm**2 * 0.5 * (covariance[:, 0, 0] + covariance[:, 1, 1])
    return float(np.sqrt(variance.mean()))


@pytest.mark.benchmark(group="tracking")
def test_bias_and_rms_against_sub_pixel_position(benchmark: Benchmark) -> None:
    def sweep() -> None:
        parts = np.arange(0.0, 1.0, 0.125)
        error, rotation, limit = [], [], []
        for seed in range(DRAWS):
            given = {"radius": RADIUS, "pitch": 49.0, "margin": 90.0, "seed": seed}
            rods, clean = grid_of_rods(20, 20, **given), grid_of_rods(20, 20, noise=0.0, **given)
            grains = (rods.x, rods.y, rods.radius)
            reference = rods.photograph(rods.x, rods.y, np.zeros(rods.count), noise_seed=1000 + seed)
            tracker = Tracker(reference.astype(np.float32), grains, workers=1)
            limit.append(cramer_rao(Tracker(clean.reference(), grains, workers=1), rods.settings.noise))
            for k, part in enumerate(parts):
                image = rods.moved(part, part, 0.0, noise_seed=2000 + 8 * seed + k)
                poses = tracker.follow(image, [tracker.first()])
                error.append(np.stack([poses.x - rods.x - part, poses.y - rods.y - part]))
                rotation.append(rms(poses.rotation))
        drawn = np.array(error).reshape(DRAWS, len(parts), 2, -1)
        bias = np.abs(drawn.mean(axis=(0, 3))).max()
        error_rms = np.sqrt((drawn**2).mean(axis=(0, 2, 3)))
        ratio = error_rms / rms(np.array(limit))
        count = drawn.shape[0] * drawn.shape[3]
        report(
            f"bias {bias:.4f} px, rms {error_rms.max():.4f} px, {ratio.max():.3f} (mean {ratio.mean():.3f}) "
            f"x Cramér-Rao ± {0.5 / np.sqrt(count):.3f}, rotation {max(rotation):.5f} rad "
            f"(r = 20, noise 2.5, {count} grains, worst of 8 positions)"
        )
        assert bias < 0.005
        assert ratio.max() < 1.15

    benchmark.pedantic(sweep, rounds=1)


@pytest.mark.benchmark(group="tracking")
def test_speed_of_predicted_grains(benchmark: Benchmark, rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(0.8, -0.6, 0.02)
    history = [tracker.first()]
    poses = benchmark(tracker.follow, image, history)
    seconds = cpu_seconds(tracker, image)
    report(f"{rods.count / seconds:.0f} grains/s predicted, photograph included (r = 20, one core)")
    assert (poses.status == TrackStatus.OK).all()


@pytest.mark.benchmark(group="tracking")
@pytest.mark.parametrize(("shift", "degrees"), [(8.0, 20.0), (40.0, 60.0)])
def test_speed_of_rescue(benchmark: Benchmark, rods: Rods, tracker: Tracker, shift: float, degrees: float) -> None:
    rotation = np.deg2rad(degrees) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    image = rods.moved(shift, 0.0, rotation)
    poses = benchmark.pedantic(tracker.follow, (image, [tracker.first()]), rounds=3, warmup_rounds=1)
    seconds = cpu_seconds(tracker, image)
    lost = int((~poses.has_pose).sum())
    report(
        f"jump of {shift:.0f} px with {degrees:.0f}°: {rods.count / seconds:.0f} grains/s, "
        f"{lost} of {rods.count} lost, "
        f"rms {rms(poses.x - rods.x - shift):.4f} px, {wrong_unflagged(poses, rods.x + shift, rods.y)} wrong unflagged"
    )
    assert lost == 0


@pytest.mark.benchmark(group="tracking")
def test_speed_of_rescue_with_independent_motions(benchmark: Benchmark) -> None:
    generator = np.random.default_rng(7)
    spaced = grid_of_rods(10, 10, radius=RADIUS, pitch=105.0, margin=90.0)
    alone = Tracker(spaced.reference(), (spaced.x, spaced.y, spaced.radius), workers=1)
    rotation = generator.uniform(-np.pi, np.pi, spaced.count)
    dx, dy = generator.uniform(-27.0, 27.0, (2, spaced.count))
    image = spaced.moved(dx, dy, rotation)
    poses = benchmark.pedantic(alone.follow, (image, [alone.first()]), rounds=3, warmup_rounds=1)
    lost = int((~poses.has_pose).sum())
    report(
        f"independent jumps of up to 38 px and any angle: {spaced.count / cpu_seconds(alone, image):.0f} grains/s, "
        f"{lost} of {spaced.count} lost, {wrong_unflagged(poses, spaced.x + dx, spaced.y + dy)} wrong unflagged"
    )
    assert lost == 0


@pytest.mark.benchmark(group="tracking")
@pytest.mark.parametrize("fraction", [0.3, 0.5])
def test_occlusion_without_a_prediction(benchmark: Benchmark, fraction: float) -> None:
    def run() -> None:
        lost, wrong, flagged, total, squared = 0, 0, 0, 0, []
        for seed in range(DRAWS):
            rods = grid_of_rods(10, 10, radius=RADIUS, pitch=49.0, margin=90.0, seed=20 + seed)
            tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=1)
            rotation = np.random.default_rng(seed).uniform(-np.pi, np.pi, rods.count)
            for grey in (0.0, 255.0):
                image = rods.moved(12.0, 5.0, rotation)
                cover(image, rods.x + 12.0, rods.y + 5.0, fraction, grey)
                poses = tracker.follow(image, [tracker.first()])
                lost += int((~poses.has_pose).sum())
                flagged += int((poses.status == TrackStatus.SUSPECT).sum())
                wrong += wrong_unflagged(poses, rods.x + 12.0, rods.y + 5.0)
                total += rods.count
                squared.append(rms(np.stack([poses.x - rods.x - 12.0, poses.y - rods.y - 5.0])))
        report(
            f"{100 * fraction:.0f} % of every rod covered black or white, moved by 13 px and any angle: "
            f"{lost} of {total} lost, {flagged} suspect, {wrong} wrong unflagged, rms {rms(np.array(squared)):.4f} px"
        )
        assert wrong == 0
        assert fraction > 0.3 or lost == 0

    benchmark.pedantic(run, rounds=1)


@pytest.mark.benchmark(group="tracking")
def test_twenty_megapixels(benchmark: Benchmark) -> None:
    rods = grid_of_rods(34, 34, radius=58.0, pitch=127.0, margin=140.0, noise=2.0)
    tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius), workers=1)
    image = rods.moved(1.8, -0.6, 0.01)
    poses = benchmark.pedantic(tracker.follow, (image, [tracker.first()]), rounds=3, warmup_rounds=1)
    seconds = cpu_seconds(tracker, image)
    report(
        f"{rods.count} rods of radius 58 px in {rods.width * rods.height / 1e6:.1f} Mpx: {seconds:.2f} s on one core, "
        f"rms {rms(poses.x - rods.x - 1.8):.4f} px"
    )
    assert poses.has_pose.all()


@pytest.mark.benchmark(group="tracking")
def test_a_long_path_with_an_avalanche(benchmark: Benchmark) -> None:
    rods = grid_of_rods(34, 34, radius=RADIUS, pitch=49.0, margin=60.0)
    wide = Rods(rods.width + 520, rods.height, rods.x, rods.y, rods.radius, rods.settings)
    generator = np.random.default_rng(1)
    tracker = Tracker(wide.reference(), (wide.x, wide.y, wide.radius), workers=2)
    middle = np.argsort(np.hypot(rods.x - 800.0, rods.y - 800.0))[:40]
    path = np.linspace(0.0, 501.0, 31)[1:]

    def run() -> None:
        history = [tracker.first()]
        x, y, rotation = rods.x.copy(), rods.y.copy(), np.zeros(rods.count)
        lost, wrong, worst = 0, 0, 0.0
        for k, reached in enumerate(path):
            moved = reached - (path[k - 1] if k else 0.0)
            # Shear: the upper rows move farther; every rod rotates a little.
            x = x + moved * (0.4 + 0.6 * rods.y / rods.y.max())
            rotation = rotation + generator.normal(0.0, 0.05, rods.count)
            if k == 15:
                y[middle] += 26.0 / np.sqrt(2.0)
                x[middle] += 26.0 / np.sqrt(2.0)
                rotation[middle] += generator.uniform(-0.9, 0.9, 40)
            poses = tracker.follow(wide.moved(x - rods.x, y - rods.y, rotation, noise_seed=100 + k), history[-3:])
            history.append(poses)
            lost += int((~poses.has_pose).sum())
            wrong += wrong_unflagged(poses, x, y)
            worst = max(worst, rms(np.hypot(poses.x - x, poses.y - y)) / np.sqrt(2.0))
        report(
            f"{rods.count} rods, 30 photographs, 501 px, avalanche of 40 (26 px, ±0.9 rad): {lost} lost, "
            f"{wrong} wrong unflagged, rms at most {worst:.4f} px"
        )
        assert lost == 0
        assert wrong == 0

    benchmark.pedantic(run, rounds=1)


@pytest.mark.benchmark(group="tracking")
def test_walls_of_the_sample(benchmark: Benchmark) -> None:
    experiment = load_experiment(SAMPLE)
    photographs = experiment.photographs()
    walls = read_walls(experiment, len(photographs))
    assert walls is not None
    assert experiment.config.photographs is not None
    scale = make_scale(experiment.config.photographs, photographs.shape[0])
    images = list(photographs)
    depth = visible_depth(images[0], walls.endpoints[0], scale, 0.025)

    def run() -> None:
        tracker = WallTracker(images[0], walls.endpoints[0], scale, depth, workers=1)
        history = [tracker.first()]
        for image in images[1:]:
            history.append(tracker.follow(image, history[-8:]))
        found = np.stack([pose.endpoints for pose in history])
        along = walls.endpoints[:, :, 1] - walls.endpoints[:, :, 0]
        normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
        off = 1e6 * np.einsum("fwek,fwk->fwe", found - walls.endpoints, normal)[1:]
        sigma = 1e6 * np.stack([pose.sigma for pose in history[1:]])
        report(
            f"4 walls, {len(images)} photographs: along the normal rms {rms(off):.2f} µm, at most "
            f"{np.abs(off).max():.2f} µm, σ {np.median(sigma):.2f} µm (pixel 250 µm)"
        )
        assert np.abs(off).max() < 5.0

    benchmark.pedantic(run, rounds=1, warmup_rounds=1)


@pytest.mark.benchmark(group="tracking")
@pytest.mark.parametrize("radius", [12.0, 14.0, 24.0])
def test_search_of_brown_rods_without_speckle(benchmark: Benchmark, radius: float) -> None:
    generator = np.random.default_rng(0)
    rods = grid_of_rods(8, 8, radius=radius, pitch=2.1 * radius, margin=90.0)
    rotation = generator.uniform(-np.pi, np.pi, rods.count)

    def photograph(dx: float, dy: float, rotation: np.ndarray, noise_seed: int) -> np.ndarray:
        image = brown_photograph(
            Laboratory(), rods.width, rods.height, rods.x + dx, rods.y + dy, rods.radius, rotation,
            pattern_seed=1, noise_seed=noise_seed,
        )  # fmt: skip
        return (image @ LUMA).astype(np.float32)

    tracker = Tracker(photograph(0.0, 0.0, 0.0 * rotation, 1), (rods.x, rods.y, rods.radius), workers=1)
    image = photograph(33.3, -24.2, rotation, 2)
    poses = benchmark.pedantic(tracker.follow, (image, [tracker.first()]), rounds=1, warmup_rounds=1)
    seconds = cpu_seconds(tracker, image)
    lost, wrong = int((~poses.has_pose).sum()), wrong_unflagged(poses, rods.x + 33.3, rods.y - 24.2)
    report(
        f"brown rods, R = {radius:.0f} px, jump of 41 px with any rotation: {rods.count / seconds:.0f} grains/s, "
        f"{lost} of {rods.count} lost, {wrong} wrong unflagged"
    )
    assert lost == 0
    assert wrong == 0
