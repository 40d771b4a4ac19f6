from dataclasses import replace

import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Material, Packing
from solver.contacts.verdicts import Verdicts
from solver.posterior.sequence_evidence import SequenceEvidence, gather_evidence
from tests.packings import box

RADIUS = 0.008  # [m]
SIDE = 14  # rods in a row, and rows
FRAMES = 6


def lattice_sequence(noise: float, *, load: float = 50.0) -> tuple[Packing, list[Snapshot]]:
    """Equal rods packed close in a box that fits them, photographed with noise [m] while nothing moves."""
    rng, pitch = np.random.default_rng(7), 2.0 * RADIUS
    position = np.array([
        (RADIUS + pitch * column + RADIUS * (row % 2), RADIUS + np.sqrt(0.75) * pitch * row)
        for row in range(SIDE) for column in range(SIDE - row % 2)
    ])  # fmt: skip
    walls = box(pitch * SIDE, pitch * (1.0 + np.sqrt(0.75) * (SIDE - 1)))
    n, pressure = len(position), np.array([np.nan, np.nan, load / (pitch * SIDE * 0.06), np.nan])
    here, ends = np.ones(n, bool), walls.endpoints
    grains = Grains.of_rods(np.full(n, RADIUS), density=2700.0, length=0.06)
    snapshots = [
        Snapshot(float(k), position + rng.normal(0.0, noise, (n, 2)), np.zeros(n), here, ends, noise)
        for k in range(FRAMES)
    ]  # fmt: skip
    return Packing(grains, 0.06, Material(0.25, 0.25), pressure), snapshots


def with_radii(packing: Packing, radius: np.ndarray) -> Packing:
    return replace(packing, grains=replace(packing.grains, radius=radius))


@pytest.fixture(scope="module")
def exact() -> SequenceEvidence:
    return gather_evidence(*lattice_sequence(1e-5))


def test_exact_radii_and_centres_are_found_exact(exact: SequenceEvidence) -> None:
    assert not exact.corrected
    assert exact.radius_deviation < 1e-6
    assert exact.touching.offset == pytest.approx(0.0, abs=2e-6)
    assert not exact.radius_correction.any()
    # Nothing moves: the noise is smoothed, and what is left of it is all that the centres are wrong by.
    assert 0.4e-5 < exact.centre_deviation.max() < 1.0e-5


def test_the_load_of_the_plate_is_what_its_pairs_add_up_to(exact: SequenceEvidence) -> None:
    given = exact.of_frame(2)
    on_plate = given.contacts.j == exact.packing.grains.count + 2
    np.testing.assert_array_equal(given.known.group, np.where(on_plate, 0, -1))
    np.testing.assert_allclose(given.known.total, 50.0)
    assert given.contacts.count > 2.8 * len(given.radius)


def test_radii_that_are_all_too_small_are_seen_by_gaps_that_nothing_else_explains() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    found = gather_evidence(with_radii(packing, packing.grains.radius - 2e-4), snapshots)
    assert found.corrected
    np.testing.assert_allclose(found.radius_correction, 2e-4, rtol=0.05)
    contacts = found.of_frame(0).contacts
    assert abs(np.median(contacts.gap)) < 1e-5
    assert abs(np.median(contacts.gap[contacts.with_wall])) < 2e-5  # a wall has no radius of its own


def test_an_overlap_is_taken_for_softness_unless_the_gaps_are_said_to_share_an_error() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    packing = with_radii(packing, packing.grains.radius + 2e-5)
    assert not gather_evidence(packing, snapshots).corrected
    told = gather_evidence(packing, snapshots, shared_error=1e-4)
    np.testing.assert_allclose(told.radius_correction, -2e-5, rtol=0.1)


def test_told_sizes_that_touching_gaps_contradict_are_no_scatter_but_a_trend() -> None:
    packing, snapshots = lattice_sequence(5e-6)  # of equal rods; the told radii differ
    error = np.random.default_rng(1).normal(0.0, 4e-5, packing.grains.count)
    found = gather_evidence(with_radii(packing, packing.grains.radius + error), snapshots, shared_error=1e-4)
    np.testing.assert_allclose(found.radius_correction, -error, atol=2e-6)
    assert found.radius_deviation < 1e-6


def test_noisier_positions_loosen_the_law_of_the_overlap() -> None:
    quiet, loud = (gather_evidence(*lattice_sequence(noise)).settings for noise in (5e-6, 2e-5))
    assert loud.width == pytest.approx(4.0 * quiet.width, rel=0.3)


def test_a_missing_grain_is_not_held_to_its_balance_and_has_no_pairs() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    present = np.ones(packing.grains.count, bool)
    present[30] = False
    position = np.where(present[:, None], snapshots[3].position, np.nan)
    snapshots[3] = replace(snapshots[3], present=present, position=position)
    given = gather_evidence(packing, snapshots).of_frame(3)
    assert not given.balanced[30]
    assert given.balanced.sum() == packing.grains.count - 1
    assert not np.any((given.contacts.i == 30) | (given.contacts.j == 30))
    assert np.isfinite(given.contacts.gap).all()


def test_without_a_plate_or_weight_the_walls_total_sets_the_scale() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    free = replace(packing, pressure=np.full(4, np.nan))
    evidence = gather_evidence(free, snapshots)
    assert not evidence.of_frame(0).known.fix_the_scale
    told = evidence.of_frame(0, wall_normal_total=200.0)
    assert told.known.fix_the_scale
    np.testing.assert_array_equal(told.known.group >= 0, told.contacts.with_wall)


def test_what_people_saw_of_pairs_is_obeyed() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    gathered = gather_evidence(packing, snapshots)
    plain = gathered.of_frame(3)
    forced, forbidden = plain.contacts.key[[4]], plain.contacts.key[[9]]
    told = gathered.of_frame(3, verdicts=Verdicts(forced, forbidden))
    assert told.contacts.count == plain.contacts.count - 1
    assert not np.isin(forbidden, told.contacts.key).any()
    sure = told.contacts.key == forced[0]
    assert told.prior[sure] == pytest.approx([0.99])
    assert told.prior[~sure].max() == plain.prior.max()
