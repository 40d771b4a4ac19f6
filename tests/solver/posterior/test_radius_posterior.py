import numpy as np
import pytest
from rodsight.solver.posterior import radius_posterior
from rodsight.solver.posterior.radius_posterior import (
    RADIUS_COVERAGE_FACTOR,
    RadiusPosterior,
    estimate_radii,
    share_errors,
)
from rodsight.solver.posterior.sampler.chain import ChainMeans

from tests.solver.posterior.simulated import NOISE, simulate_shear
from tests.solver.posterior.test_sequence_evidence import lattice_sequence, with_radii


def test_exact_radii_stay_exact() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    found = estimate_radii(packing, snapshots, np.random.default_rng(0))
    assert found.prior_sd < 1e-6
    assert not found.correction.any()


def test_a_common_radius_error_is_corrected() -> None:
    packing, snapshots = lattice_sequence(NOISE)
    small = with_radii(packing, packing.grains.radius - 2e-4)
    found = estimate_radii(small, snapshots, np.random.default_rng(0))
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


def posterior(correction: np.ndarray, sd: float, prior: float) -> RadiusPosterior:
    return RadiusPosterior(correction, np.full(len(correction), sd), prior)


def test_an_error_that_all_grains_of_a_size_have_is_shared() -> None:
    rng, prior, noise = np.random.default_rng(1), 1e-4, 2e-5
    sizes = np.repeat([0, 1, 2], [60, 40, 4])
    true = np.where(sizes == 1, -1.6e-4, 0.0)
    true[5] = 4e-4  # an error of its own
    shown = 1.0 / (1.0 + (noise / prior) ** 2)
    sd = noise * np.sqrt(shown)
    given = posterior(shown * (true + noise * rng.standard_normal(len(true))), sd, prior)
    found = share_errors(given, sizes)
    few, own = sizes == 2, np.arange(len(true)) == 5
    assert np.array_equal(found.correction[few | own], given.correction[few | own])
    assert np.array_equal(found.correction_sd[few | own], given.correction_sd[few | own])
    error, before = (found.correction - true)[~few & ~own], (given.correction - true)[~few & ~own]
    assert error.std() < 0.4 * before.std()
    assert np.abs(error.mean()) < 0.2 * noise
    stated = np.sqrt(np.mean(found.correction_sd[~few & ~own] ** 2))
    assert 0.1 * stated < np.sqrt(np.mean(error**2)) < 2.0 * stated < noise


def test_true_differences_within_a_size_stay_beside_a_common_error() -> None:
    rng, prior, noise = np.random.default_rng(2), 1e-4, 1e-5
    true = -4e-4 + 5e-5 * rng.standard_normal(400)
    shown = 1.0 / (1.0 + (noise / prior) ** 2)
    given = posterior(shown * (true + noise * rng.standard_normal(400)), noise * np.sqrt(shown), prior)
    found = share_errors(given, np.zeros(400, np.int64))
    assert np.corrcoef(found.correction, true)[0, 1] > 0.95
    assert found.correction_sd.mean() == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize("spread", [0.0, 5e-5])
def test_without_a_common_error_all_corrections_stay(spread) -> None:
    rng = np.random.default_rng(3)
    given = posterior(rng.normal(1e-5, 2e-5 + spread, 100), 2e-5, 1e-4)
    assert share_errors(given, np.repeat([0, 1], 50)) is given
    exact = posterior(np.zeros(100), 0.0, 0.0)
    assert share_errors(exact, np.zeros(100, np.int64)) is exact
