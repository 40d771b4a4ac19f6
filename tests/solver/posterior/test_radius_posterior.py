import numpy as np
import pytest
from rodsight.solver.posterior import radius_posterior
from rodsight.solver.posterior.radius_posterior import RADIUS_COVERAGE_FACTOR, estimate_radii
from rodsight.solver.posterior.sampler.chain import ChainMeans

from tests.solver.posterior.simulated import NOISE, simulate_shear
from tests.solver.posterior.test_sequence_evidence import lattice_sequence, with_radii


def test_exact_radii_stay_exact() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    found = estimate_radii(packing, snapshots, np.random.default_rng(0))
    assert found.prior_sd < 1e-6
    assert not found.correction.any()
    assert not found.includes_shared


def test_a_common_radius_error_is_corrected() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    small = with_radii(packing, packing.grains.radius - 2e-4)
    found = estimate_radii(small, snapshots, np.random.default_rng(0))
    assert found.includes_shared
    np.testing.assert_allclose(found.correction, 2e-4, rtol=0.05)


def test_means_and_variances_of_the_draws_become_corrections_in_metres(monkeypatch: pytest.MonkeyPatch) -> None:
    packing, snapshots = lattice_sequence(NOISE)
    n, diameter = packing.grains.count, 2.0 * packing.grains.radius.mean()
    mean, variance = np.linspace(-2e-3, 2e-3, n), 1e-8  # of δ in mean diameters
    error = np.tile(np.column_stack([np.zeros((n, 2)), mean, mean**2 + variance]), (3, 1))
    chain = ChainMeans(np.zeros((1, 5)), error, np.zeros(4))
    monkeypatch.setattr(radius_posterior, "_is_detectable", lambda _: True)
    monkeypatch.setattr(radius_posterior, "_run_joint_chain", lambda *_: chain)
    found = estimate_radii(packing, snapshots, np.random.default_rng(0))
    np.testing.assert_allclose(found.correction, diameter * mean)
    np.testing.assert_allclose(found.correction_sd, RADIUS_COVERAGE_FACTOR * diameter * 1e-4)
    assert found.prior_sd == pytest.approx(diameter * np.sqrt(np.mean(mean**2) + variance))


@pytest.mark.slow
def test_radius_errors_of_one_per_cent_are_found_from_all_frames() -> None:
    world = simulate_shear(0.5, frames=8)
    exact = estimate_radii(world.packing, world.snapshots, np.random.default_rng(0))
    assert np.abs(exact.correction).max() < 1e-6

    radius = world.packing.grains.radius
    error = np.random.default_rng(4).normal(0.0, 0.01, len(radius)) * radius
    measured = with_radii(world.packing, radius + error)
    found = estimate_radii(measured, world.snapshots, np.random.default_rng(0))
    left = error + found.correction
    assert found.prior_sd == pytest.approx(error.std(), rel=0.35)
    assert np.median(np.abs(left)) < 0.15 * np.median(np.abs(error))
    assert np.mean(np.abs(left) < 2.0 * found.correction_sd) > 0.85
