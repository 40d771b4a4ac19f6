from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.posterior.sequence_evidence import (
    FORCE_SD,
    SequenceEvidence,
    _centre_variance,
    gather_position_evidence,
)
from rodsight.solver.posterior.touching_gaps import TouchingGaps

from tests.packings import box

RADIUS = 0.008  # [m]
SIDE = 14  # rods in a row, and rows
FRAMES = 6


def lattice_sequence(noise: float, *, load: float = 50.0) -> tuple[Packing, list[Snapshot]]:
    """Make a close packing of equal rods at rest in a box, photographed with noise [m]."""
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
    return gather_position_evidence(*lattice_sequence(1e-5))


def test_exact_radii_and_centres_have_small_sd(exact: SequenceEvidence) -> None:
    assert not exact.radius_correction.any()
    assert exact.radius_sd < 1e-6
    assert exact.touching.offset == pytest.approx(0.0, abs=2e-6)
    assert not exact.radius_correction.any()
    # Nothing moves: the centres' error is the noise that smoothing leaves.
    assert 0.4e-5 < exact.centre_sd.max() < 1.0e-5


def test_pairs_at_the_plate_sum_to_its_load(exact: SequenceEvidence) -> None:
    given = exact.of_frame(2)
    on_plate = given.contacts.j == exact.packing.grains.count + 2
    np.testing.assert_array_equal(given.known.group, np.where(on_plate, 0, -1))
    np.testing.assert_allclose(given.known.total, 50.0)
    assert given.contacts.count > 2.8 * len(given.radius)


def test_a_common_gap_corrects_radii_that_are_all_too_small() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    found = gather_position_evidence(with_radii(packing, packing.grains.radius - 2e-4), snapshots)
    assert found.radius_correction.any()
    np.testing.assert_allclose(found.radius_correction, 2e-4, rtol=0.05)
    contacts = found.of_frame(0).contacts
    assert abs(np.median(contacts.gap)) < 1e-5
    assert abs(np.median(contacts.gap[contacts.with_wall])) < 2e-5  # a wall has no radius of its own


def test_an_overlap_counts_as_softness_unless_a_shared_error_is_given() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    packing = with_radii(packing, packing.grains.radius + 2e-5)
    assert not gather_position_evidence(packing, snapshots).radius_correction.any()
    corrected = gather_position_evidence(packing, snapshots, shared_error=1e-4)
    np.testing.assert_allclose(corrected.radius_correction, -2e-5, rtol=0.1)


def test_radius_errors_proportional_to_given_radii_are_a_trend() -> None:
    packing, snapshots = lattice_sequence(5e-6)  # of equal rods; the given radii differ
    error = np.random.default_rng(1).normal(0.0, 4e-5, packing.grains.count)
    found = gather_position_evidence(with_radii(packing, packing.grains.radius + error), snapshots, shared_error=1e-4)
    np.testing.assert_allclose(found.radius_correction, -error, atol=2e-6)
    assert found.radius_sd < 1e-6


def test_noisier_positions_widen_the_gap_law() -> None:
    quiet, loud = (gather_position_evidence(*lattice_sequence(noise)).settings for noise in (5e-6, 2e-5))
    assert loud.gap_law_sd == pytest.approx(4.0 * quiet.gap_law_sd, rel=0.3)


def test_a_missing_grain_has_no_balance_and_no_pairs() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    present = np.ones(packing.grains.count, bool)
    present[30] = False
    position = np.where(present[:, None], snapshots[3].position, np.nan)
    snapshots[3] = replace(snapshots[3], present=present, position=position)
    given = gather_position_evidence(packing, snapshots).of_frame(3)
    assert not given.balanced[30]
    assert given.balanced.sum() == packing.grains.count - 1
    assert not np.any((given.contacts.i == 30) | (given.contacts.j == 30))
    assert np.isfinite(given.contacts.gap).all()


def test_without_load_or_weight_the_scale_is_unknown() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    free = replace(packing, pressure=np.full(4, np.nan))
    assert not gather_position_evidence(free, snapshots).of_frame(0).known.scale_known


def test_verdicts_of_reviewers_are_applied() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    gathered = gather_position_evidence(packing, snapshots)
    plain = gathered.of_frame(3)
    forced, forbidden = plain.contacts.key[[4]], plain.contacts.key[[9]]
    reviewed = gathered.of_frame(3, verdicts=Verdicts(forced, forbidden))
    assert reviewed.contacts.count == plain.contacts.count - 1
    assert not np.isin(forbidden, reviewed.contacts.key).any()
    forced_row = reviewed.contacts.key == forced[0]
    assert reviewed.prior[forced_row] == pytest.approx([0.99])
    assert reviewed.prior[~forced_row].max() == plain.prior.max()


def test_the_variance_of_centres_is_that_of_gaps_without_overlap_and_radii() -> None:
    """A gap has two centres and two radii; s² = 2 σ_c² + (0.8 o)² + 2 σ_r²."""
    centre, overlap, radius = 4.0, 1.5, 0.5

    def found(covariance: float) -> float:
        sd = float(np.sqrt(2.0 * centre + (FORCE_SD * overlap) ** 2 + 2.0 * radius))
        return _centre_variance(TouchingGaps(-overlap, np.zeros(6), sd, np.ones(1), 0.0), overlap, radius, covariance)

    assert found(centre) == found(10.0) == pytest.approx(centre)
    uncertainty = 2.0 * radius / (radius + centre)
    assert found(1.0) == pytest.approx((1.0 - uncertainty) * centre + uncertainty)
