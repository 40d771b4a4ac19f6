import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.detection.displacement import contact_displacement
from rodsight.solver.detection.refinement import BLOCK, RefinedBlock, block_of, refine
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings

from tests.solver.convex.test_ensemble_members import box

R, SIDE, FRAMES = 0.01, 12, 8
SIGMA = 3e-5  # [m]
SHEAR = 2e-3  # per frame: rows that touch slide
NOISE_LEFT = 0.75  # greatest error of refined coordinates over the noise
COVERAGE = 1.4  # greatest rms of true errors of the sliding over their standard deviations

SETTINGS = ContactProbabilitySettings(overlap=2e-6)


def sheared(sigma: float, missing: int | None = None) -> tuple[Grains, np.ndarray, list[Snapshot]]:
    """A square lattice in simple shear: the true positions (f, n, 2) and the snapshots."""
    rng = np.random.default_rng(2)
    start = R * (1 + 2 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2))
    n, side = SIDE**2, 2 * R * SIDE
    true, snapshots = [], []
    for f in range(FRAMES):
        angle = SHEAR * f
        position = start @ np.array([[1.0, 0.0], [np.sin(angle), np.cos(angle)]])
        true.append(position)
        measured = position + rng.normal(scale=sigma, size=(n, 2))
        present = np.ones(n, bool)
        if missing is not None and f == 3:
            present[missing] = False
            measured[missing] = np.nan
        endpoints = box(side, side * np.cos(angle), np.tan(angle))
        snapshots.append(Snapshot(30.0 * f, measured, np.zeros(n), present, endpoints, sigma))
    return Grains.of_rods(np.full(n, R), density=2700.0, length=0.06), np.array(true), snapshots


def contacts_of(block: RefinedBlock, grains: Grains, snapshots: list[Snapshot], frame: int):  # type: ignore[no-untyped-def]
    from rodsight.solver.bodies.walls import Walls

    snapshot = snapshots[frame]
    walls = Walls(snapshot.endpoints, np.zeros((4, 2, 2)), np.full(4, np.nan))
    return (*block.contacts_at(snapshot, frame, grains, walls, 0.5), walls)


def test_refined_positions_are_closer_to_the_truth():
    grains, true, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots, SETTINGS)
    assert np.sqrt(np.mean((block.position - true) ** 2)) < NOISE_LEFT * SIGMA


def test_standard_deviation_of_the_refined_sliding_is_calibrated():
    grains, true, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots, SETTINGS)
    contacts, _, walls = contacts_of(block, grains, snapshots, 4)
    rotation = (np.zeros(grains.count), np.zeros(grains.count))
    ends = snapshots[3].endpoints, snapshots[4].endpoints

    def slide(position: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return contact_displacement(contacts, grains.radius, position, rotation, walls, ends)[1]

    error = slide((block.position_at(3), block.position_at(4))) - slide((true[3], true[4]))
    raw = slide((snapshots[3].position, snapshots[4].position)) - slide((true[3], true[4]))
    with_rotation = block.sliding_sd(contacts, (3, 4), (SIGMA, SIGMA))
    grain_count = np.where(contacts.with_wall, 1.0, 2.0)
    sliding_sd = np.sqrt(with_rotation**2 - 2.0 * grain_count * SIGMA**2)
    assert np.sqrt(np.mean(error**2)) < np.sqrt(np.mean(raw**2))
    assert np.sqrt(np.mean((error / sliding_sd) ** 2)) < COVERAGE
    assert sliding_sd.max() < 2.0 * SIGMA  # of the photographs alone


def test_precise_positions_are_unchanged():
    grains, true, snapshots = sheared(1e-8)
    block = refine(grains, snapshots, SETTINGS)
    np.testing.assert_allclose(block.position, true, rtol=0, atol=1e-7)


def test_missing_grain_has_no_refined_position():
    grains, _, snapshots = sheared(SIGMA, missing=60)
    block = refine(grains, snapshots, SETTINGS)
    assert np.isnan(block.position[3, 60]).all()
    assert np.isfinite(block.position[[2, 4], 60]).all()
    contacts, _, _ = contacts_of(block, grains, snapshots, 3)
    assert not np.any((contacts.i == 60) | (contacts.j == 60))


@pytest.mark.parametrize("count", [1, 15, 16, 17, 40])
def test_block_contains_the_window_of_every_frame(count: int):
    for k in range(count):
        number, start, end = block_of(k, count)
        assert number == k // BLOCK
        assert start <= max(k - 4, 0)
        assert end >= min(k + 4, count)


def test_block_contains_the_widest_interval_that_is_read():
    for k in range(60):
        _, start, end = block_of(k, 60, 4)
        assert start <= max(k - 8, 0)
        assert end > min(k + 8, 59)


def test_contacts_have_their_own_probability():
    grains, _, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots[:3], SETTINGS, start=5)
    contacts, touch, _ = contacts_of(block, grains, [None] * 5 + snapshots, 6)  # type: ignore[list-item]
    probability = dict(zip(block.key.tolist(), block.touch[1], strict=True))
    assert touch.tolist() == [probability[key] for key in contacts.key.tolist()]
    assert contacts.count == sum(each > 0.5 for each in probability.values())
