from dataclasses import fields

import numpy as np
import pytest
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.statistics.force_statistics import (
    FORCE_BINS,
    FORCE_EDGES,
    MOBILISATION_BINS,
    MOBILISATION_EDGES,
    force_density,
    mobilisation,
    mobilisation_density,
    plateau_ratio,
    strong_network,
    tail_exponent,
)
from rodsight.solver.statistics.frame_statistics import ContactProbabilities, frame_statistics
from rodsight.solver.statistics.stress import branch_vectors, contact_force_vectors

from tests.packings import LENGTH, box, rods
from tests.solver.statistics.test_stress import square_of_four

EXACT = 1e-12
QUANTILES = 2e-3  # 20 000 evenly spaced quantiles represent a distribution


def plateau_and_tail(fraction, beta):
    """Forces of mean 1 at quantiles (c,): uniform below the mean, exp(−β f) above it."""
    tail = beta / (beta + 2.0)  # fraction above 1 for which the mean is 1
    above = 1.0 - np.log(np.maximum(1.0 - fraction, 1e-300) / tail) / beta
    return np.where(fraction < 1.0 - tail, fraction / (1.0 - tail), above)


def quantiles(count=20_000):
    return (np.arange(count) + 0.5) / count


@pytest.mark.parametrize("beta", [0.8, 1.3, 2.5])
def test_tail_exponent_of_exponential_tails_is_found(beta):
    force = plateau_and_tail(quantiles(), beta)
    assert force.mean() == pytest.approx(1.0, abs=QUANTILES)
    assert tail_exponent(37.0 * force).value == pytest.approx(beta, rel=QUANTILES)


def test_exponential_forces_have_a_tail_exponent_of_one():
    assert tail_exponent(-np.log(1.0 - quantiles())).value == pytest.approx(1.0, rel=QUANTILES)


@pytest.mark.parametrize("law", ["exponential", "plateau"])
def test_standard_error_is_the_standard_deviation_of_the_estimate(law):
    rng = np.random.default_rng(7)
    # The plateau meets the tail without a jump at β = √2, so that the tail is exponential about the mean.
    draw = {"exponential": lambda u: -np.log(1.0 - u), "plateau": lambda u: plateau_and_tail(u, np.sqrt(2.0))}[law]
    found = [tail_exponent(draw(rng.random(1500))) for _ in range(600)]
    scatter = np.std([each.value for each in found])
    # The standard deviation of 600 estimates is known to 1/√1200 = 2.9 %: three of these. β/√m is 23 % too large.
    assert np.mean([each.standard_error for each in found]) == pytest.approx(scatter, rel=0.09)


def test_equal_forces_have_neither_tail_nor_weak_forces():
    for force in (np.empty(0), np.full(9, 0.1), np.zeros(4)):
        assert np.isnan(tail_exponent(force).value)
        assert np.isnan(tail_exponent(force).standard_error)
    assert np.isnan(plateau_ratio(np.empty(0)).value)
    assert np.isnan(plateau_ratio(np.full(4, 2.0)).value)


def test_plateau_ratio_has_a_deviation_where_all_weak_forces_are_below_half_the_mean():
    rng = np.random.default_rng(0)
    for _ in range(50):  # the sum of weights and their product with ones differ by rounding
        found = plateau_ratio(np.append(np.full(8, 0.1), 100.0), np.append(rng.random(8), 1.0))
        assert found.value == pytest.approx(2.0)
        assert found.standard_error == pytest.approx(0.0, abs=1e-6)


def test_plateau_ratio_distinguishes_plateau_rise_and_fall():
    fraction = quantiles()
    assert plateau_ratio(plateau_and_tail(fraction, 1.4)).value == pytest.approx(1.0, rel=QUANTILES)
    falling = (1.0 - np.exp(-0.5)) / (1.0 - np.exp(-1.0))
    assert plateau_ratio(-np.log(1.0 - fraction)).value == pytest.approx(2.0 * falling, rel=QUANTILES)
    # P(f) ∝ f^α from zero to beyond the mean.
    for alpha in (-0.3, 0.5):
        force = fraction ** (1.0 / (1.0 + alpha))
        assert plateau_ratio(force).value == pytest.approx(2.0**-alpha, rel=QUANTILES)


def test_density_of_forces_is_that_of_their_distribution():
    force = -np.log(1.0 - quantiles())
    width = np.diff(FORCE_EDGES)
    expected = -np.diff(np.exp(-FORCE_EDGES)) / width
    assert force_density(250.0 * force) == pytest.approx(expected, abs=QUANTILES)
    assert (force_density(force) * width).sum() == pytest.approx(1.0 - np.exp(-FORCE_EDGES[-1]), abs=1e-4)
    assert not force_density(np.empty(0)).any()
    assert not force_density(np.zeros(3)).any()


def test_mobilisation_is_the_mobilised_fraction_of_friction():
    fn, ft = np.array([10.0, 10.0, 20.0, 5.0]), np.array([1.0, -2.5, 0.0, 0.0])
    used = mobilisation(fn, ft, np.array([0.25, 0.25, 0.5, 0.0]))
    assert used == pytest.approx([0.4, 1.0, 0.0, 1.0])
    density = mobilisation_density(used)
    assert density.sum() / MOBILISATION_BINS == pytest.approx(1.0)
    assert density[-1] == pytest.approx(0.5 * MOBILISATION_BINS)
    even = mobilisation_density((np.arange(MOBILISATION_BINS) + 0.5) / MOBILISATION_BINS)
    assert even == pytest.approx(np.ones(len(MOBILISATION_EDGES) - 1))
    assert mobilisation_density(np.array([1.0 + 1e-9, 1.3])) == pytest.approx(
        np.eye(MOBILISATION_BINS)[-1] * MOBILISATION_BINS
    )
    assert not mobilisation_density(np.empty(0)).any()


def test_strong_network_carries_its_fraction_of_the_stress():
    # Vertical contacts carry 50 kPa, horizontal ones 20 kPa: the strong half has 5/7 of the pressure, and 5 of the
    # 5 − 2 of the deviator, which the weak half opposes.
    contacts, fn, position, _ = square_of_four(2e4, 5e4)
    force, branch = contact_force_vectors(contacts, fn, np.zeros_like(fn)), branch_vectors(contacts, position)
    strong = strong_network(fn, force, branch)
    assert strong.contact_fraction == pytest.approx(0.5)
    assert strong.pressure_fraction == pytest.approx(5 / 7)
    assert strong.deviator_fraction == pytest.approx(5 / 3)


def test_isotropic_state_has_zero_deviator_fraction():
    contacts, fn, position, _ = square_of_four(2e4, 2e4 * (1.0 + 1e-13))
    force, branch = contact_force_vectors(contacts, fn, np.zeros_like(fn)), branch_vectors(contacts, position)
    assert strong_network(fn, force, branch).deviator_fraction == 0.0


def statistics_of(contacts, fn, ft, position, walls, probabilities=None):
    n = len(position)
    if probabilities is None:
        probabilities = ContactProbabilities.of_known(fn, ft, np.where(contacts.with_wall, 0.5, 0.25))
    snapshot = Snapshot(0.0, position, np.zeros(n), np.ones(n, bool), walls.endpoints, 1e-6, load=walls.load)
    packing = Packing(rods(*[0.01] * n), LENGTH, Material(0.25, 0.5), np.full(walls.count, np.nan))
    return frame_statistics(contacts, fn, ft, probabilities, snapshot, packing)


def own_fields(found) -> list[str]:
    """Names of the fields computed from one frame; standard deviations are set later from its trust."""
    return [each.name for each in fields(found) if not each.name.endswith("_sd")]


def test_statistics_of_a_known_packing():
    contacts, fn, position, walls = square_of_four(2e4, 5e4)
    ft = np.where(contacts.with_wall, 0.1 * fn, 0.05 * fn)
    found = statistics_of(contacts, fn, np.zeros_like(fn), position, walls)
    assert (found.sigma_1, found.sigma_2) == (pytest.approx(5e4), pytest.approx(2e4))
    assert found.wall_force == pytest.approx(np.array([[0, -120], [48, 0], [0, 120], [-48, 0]]), abs=1e-9)
    # Forces of f₀ (1 ± a_n) with a_n = 3/7, contacts and branches alike in both directions.
    assert found.contact_anisotropy == pytest.approx(0.0, abs=EXACT)
    assert found.branch_anisotropy == pytest.approx(0.0, abs=EXACT)
    assert found.normal_force_anisotropy == pytest.approx(3 / 7)
    assert abs(found.anisotropy_direction[2]) == pytest.approx(np.pi / 2)
    assert found.strong_pressure_fraction == pytest.approx(5 / 7)
    # μ is 0.25 between grains and 0.5 on walls: every contact uses a fifth of it.
    assert statistics_of(contacts, fn, ft, position, walls).mobilisation == pytest.approx(0.2)
    for name in own_fields(found):
        assert np.all(np.isfinite(getattr(found, name))), name


def test_packing_without_contacts_has_statistics():
    none = Contacts(np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0), np.empty((0, 2)), np.empty((0, 2)), 3, 4)
    position = np.array([[0.1, 0.1], [0.2, 0.1], [0.1, 0.3]])
    found = statistics_of(none, np.empty(0), np.empty(0), position, box(0.5, 0.5))
    undefined = {name for name in own_fields(found) if not np.all(np.isfinite(getattr(found, name)))}
    assert undefined == {"wall_ratio_angle", "tail_exponent", "plateau_ratio"}
    assert (found.chain_count, found.chain_grain_fraction, found.strong_fraction) == (0, 0.0, 0.0)
    assert found.fn_density.shape == (FORCE_BINS,)
    assert found.wall_force.shape == (4, 2)


def test_statistics_are_over_bearing_contacts():
    contacts, fn, position, walls = square_of_four(2e4, 5e4)
    pair = np.flatnonzero(~contacts.with_wall)
    open_rows = [pair[0], np.flatnonzero(contacts.with_wall)[0]]
    fn = fn.copy()
    fn[open_rows] = 0.0
    sliding = np.zeros_like(fn)
    sliding[np.flatnonzero(fn > 0)[:3]] = 1.0
    probabilities = ContactProbabilities(np.where(fn > 0, 1.0, 0.3), sliding)  # without force none is a bearing one
    found = statistics_of(contacts, fn, np.zeros_like(fn), position, walls, probabilities)
    bearing = fn > 0
    assert found.contact_count == bearing.sum() == len(fn) - 2
    assert found.mean_fn == pytest.approx(fn[bearing].mean())
    assert found.max_fn == fn.max()
    assert found.sliding_fraction == pytest.approx(3 / bearing.sum())
    assert found.pressure == pytest.approx(0.5 * (found.sigma_1 + found.sigma_2))
    normal = contacts.normal[bearing & ~contacts.with_wall]
    assert found.fabric == pytest.approx(normal.T @ normal / len(normal))
    # Anisotropies are over pairs of grains: one of the horizontal or vertical ones is open.
    pairs = contacts.normal[bearing & ~contacts.with_wall]
    cosine = pairs[:, 0] ** 2 - pairs[:, 1] ** 2
    assert found.contact_anisotropy == pytest.approx(abs(2.0 * cosine.mean()), abs=EXACT)
    assert found.contact_anisotropy > 0.5


def test_contacts_are_weighted_with_their_probability():
    contacts, fn, position, walls = square_of_four(2e4, 5e4)
    pair, n = ~contacts.with_wall, 4
    bears = np.where(pair, 0.75, 1.0)
    sliding = np.where(pair, 0.4, 0.0)
    found = statistics_of(contacts, fn, np.zeros_like(fn), position, walls, ContactProbabilities(bears, sliding))
    assert found.contact_count == round(bears.sum())
    assert found.coordination_number == pytest.approx((2 * 0.75 * pair.sum() + (~pair).sum()) / n)
    assert found.mean_fn == pytest.approx(np.average(fn, weights=bears))
    assert found.sliding_fraction == pytest.approx(np.average(sliding, weights=bears))
    assert found.mobilisation == pytest.approx(found.sliding_fraction)  # no other contact mobilises friction
    assert found.mobilisation_density[-1] / MOBILISATION_BINS == pytest.approx(found.sliding_fraction)
    strong = fn > found.mean_fn
    assert found.strong_fraction == pytest.approx(np.average(strong, weights=bears))
    # The stress includes all forces, whatever their probabilities.
    assert (found.sigma_1, found.sigma_2) == (pytest.approx(5e4), pytest.approx(2e4))


def test_weights_count_like_repetitions():
    rng = np.random.default_rng(3)
    force, times = rng.exponential(size=400), rng.integers(1, 4, 400)
    repeated = np.repeat(force, times)
    weight = times.astype(float)
    assert force_density(force, weight) == pytest.approx(force_density(repeated))
    for estimator in (tail_exponent, plateau_ratio):
        assert estimator(force, weight).value == pytest.approx(estimator(repeated).value)
        assert estimator(force, weight).standard_error == pytest.approx(estimator(repeated).standard_error)


def test_strong_contacts_exceed_the_mean_not_the_median():
    fn = np.array([1.0, 1.0, 1.2, 1.3, 10.5])  # mean 3, median 1.2
    normal = np.tile([1.0, 0.0], (5, 1))
    strong = strong_network(fn, fn[:, None] * normal, 0.02 * normal)
    assert strong.contact_fraction == pytest.approx(1 / 5)
    assert strong.pressure_fraction == pytest.approx(10.5 / 15.0)
