import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.bodies.motion import Snapshot
from solver.detection.displacement import contact_displacement
from solver.detection.refinement import BLOCK, RefinedBlock, block_of, refine
from solver.detection.touch_probability import ContactProbabilitySettings
from tests.solver.convex.test_members import box

R, SIDE, FRAMES = 0.01, 12, 8
SIGMA = 3e-5  # [m]
SHEAR = 2e-3  # per frame: rows that touch slide
CLOSER = 0.75  # of the noise, at most, is left in the coordinates that contacts fix
BOASTING = 1.4  # true error of a sliding over the standard deviation stated for it, rms, at most

SETTINGS = ContactProbabilitySettings(overlap=2e-6)


def sheared(sigma: float, missing: int | None = None) -> tuple[Grains, np.ndarray, list[Snapshot]]:
    """Columns of a square lattice leaning over; the true positions (f, n, 2) and the snapshots."""
    rng = np.random.default_rng(2)
    start = R * (1 + 2 * np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2))
    n, side = SIDE**2, 2 * R * SIDE
    true, snapshots = [], []
    for f in range(FRAMES):
        lean = SHEAR * f
        position = start @ np.array([[1.0, 0.0], [np.sin(lean), np.cos(lean)]])
        true.append(position)
        measured = position + rng.normal(scale=sigma, size=(n, 2))
        present = np.ones(n, bool)
        if missing is not None and f == 3:
            present[missing] = False
            measured[missing] = np.nan
        endpoints = box(side, side * np.cos(lean), np.tan(lean))
        snapshots.append(Snapshot(30.0 * f, measured, np.zeros(n), present, endpoints, sigma))
    return Grains.of_rods(np.full(n, R), density=2700.0, length=0.06), np.array(true), snapshots


def contacts_of(block: RefinedBlock, grains: Grains, snapshots: list[Snapshot], frame: int):  # type: ignore[no-untyped-def]
    from solver.bodies.walls import Walls

    snapshot = snapshots[frame]
    walls = Walls(snapshot.endpoints, np.zeros((4, 2, 2)), np.full(4, np.nan))
    return (*block.contacts_at(snapshot, frame, grains, walls, 0.5), walls)


def test_positions_come_closer_to_the_truth_than_the_photographs():
    grains, true, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots, SETTINGS)
    assert np.sqrt(np.mean((block.position - true) ** 2)) < CLOSER * SIGMA


def test_what_is_left_of_the_noise_of_a_sliding_is_stated():
    grains, true, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots, SETTINGS)
    contacts, _, walls = contacts_of(block, grains, snapshots, 4)
    rotation = (np.zeros(grains.count), np.zeros(grains.count))
    ends = snapshots[3].endpoints, snapshots[4].endpoints

    def slide(position: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return contact_displacement(contacts, grains.radius, position, rotation, walls, ends)[1]

    error = slide((block.position_at(3), block.position_at(4))) - slide((true[3], true[4]))
    raw = slide((snapshots[3].position, snapshots[4].position)) - slide((true[3], true[4]))
    with_rotation = block.slide_deviation(contacts, (3, 4), (SIGMA, SIGMA))
    grain_count = np.where(contacts.with_wall, 1.0, 2.0)
    deviation = np.sqrt(with_rotation**2 - 2.0 * grain_count * SIGMA**2)
    assert np.sqrt(np.mean(error**2)) < np.sqrt(np.mean(raw**2))
    assert np.sqrt(np.mean((error / deviation) ** 2)) < BOASTING
    assert deviation.max() < 2.0 * SIGMA  # of the photographs alone


def test_precise_positions_stay_where_they_are():
    grains, true, snapshots = sheared(1e-8)
    block = refine(grains, snapshots, SETTINGS)
    np.testing.assert_allclose(block.position, true, rtol=0, atol=1e-7)


def test_a_grain_that_is_missing_is_not_made_up():
    grains, _, snapshots = sheared(SIGMA, missing=60)
    block = refine(grains, snapshots, SETTINGS)
    assert np.isnan(block.position[3, 60]).all()
    assert np.isfinite(block.position[[2, 4], 60]).all()
    contacts, _, _ = contacts_of(block, grains, snapshots, 3)
    assert not np.any((contacts.i == 60) | (contacts.j == 60))


@pytest.mark.parametrize("count", [1, 15, 16, 17, 40])
def test_every_frame_lies_in_its_block_with_room_on_both_sides(count: int):
    for k in range(count):
        number, start, end = block_of(k, count)
        assert number == k // BLOCK
        assert start <= max(k - 4, 0)
        assert end >= min(k + 4, count)


def test_contacts_come_with_their_own_probability():
    grains, _, snapshots = sheared(SIGMA)
    block = refine(grains, snapshots[:3], SETTINGS, start=5)
    contacts, touch, _ = contacts_of(block, grains, [None] * 5 + snapshots, 6)  # type: ignore[list-item]
    probability = dict(zip(block.key.tolist(), block.touch[1], strict=True))
    assert touch.tolist() == [probability[key] for key in contacts.key.tolist()]
    assert contacts.count == sum(each > 0.5 for each in probability.values())
