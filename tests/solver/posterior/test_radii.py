import numpy as np
import pytest

from solver.posterior.radii import estimate_radii
from tests.solver.posterior.simulated import NOISE, simulate_shear
from tests.solver.posterior.test_sequence_evidence import lattice_sequence, with_radii


def test_exact_radii_stay_exact() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    found = estimate_radii(packing, snapshots, np.random.default_rng(0))
    assert found.prior_deviation < 1e-6
    assert not found.correction.any()
    assert not found.shared


def test_radii_that_are_all_too_small_are_put_right_together() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    small = with_radii(packing, packing.grains.radius - 2e-4)
    found = estimate_radii(small, snapshots, np.random.default_rng(0))
    assert found.shared
    np.testing.assert_allclose(found.correction, 2e-4, rtol=0.05)


@pytest.mark.slow
def test_radii_wrong_by_a_per_cent_are_found_from_all_frames_together() -> None:
    world = simulate_shear(0.5, frames=8)
    exact = estimate_radii(world.packing, world.snapshots, np.random.default_rng(0))
    assert np.abs(exact.correction).max() < 1e-6

    radius = world.packing.grains.radius
    error = np.random.default_rng(4).normal(0.0, 0.01, len(radius)) * radius
    told = with_radii(world.packing, radius + error)
    found = estimate_radii(told, world.snapshots, np.random.default_rng(0))
    left = error + found.correction
    assert found.prior_deviation == pytest.approx(error.std(), rel=0.35)
    assert np.median(np.abs(left)) < 0.15 * np.median(np.abs(error))
    assert np.mean(np.abs(left) < 2.0 * found.deviation) > 0.85
