"""The sampler against numerical integrals, and on packings with known forces."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.contacts.contacts import detect_contacts, measure_contacts
from rodsight.solver.contacts.pairs import match_values
from rodsight.solver.posterior.frame_evidence import FrameEvidence, KnownForces
from rodsight.solver.posterior.frame_posterior import COVERAGE_FACTOR, infer_frame
from rodsight.solver.posterior.posterior_settings import PosteriorSettings
from rodsight.solver.posterior.radius_posterior import stack_frames
from rodsight.solver.posterior.sampler.chain import make_sampler_grains, make_sampler_pairs, make_schedule, run_chain
from rodsight.solver.statistics.balance import resultant_norms
from scipy.stats import norm

from tests.packings import box, heap_at_rest

SETTINGS = PosteriorSettings(
    balance_sd=0.3, gap_law_sd=0.02, start_balance_sd=0.3, start_gap_law_sd=0.02, compliance=0.05, compliance_sd=1e-7,
    offset_sd=1e-9, force_rate=0.0, annealing=0, burn_in=100, kept=20_000, chains=1,
)  # fmt: skip
SEED = 3
SAMPLING_ERROR = 0.02  # of 20 000 correlated draws


def rod_in_corner(
    x: float, y: float, walls: list[int], *, friction: float, weight: tuple[float, float], prior: float = 0.5
) -> FrameEvidence:
    """One rod of unit diameter near some walls of a box of 1.1 × 1.1: bottom 0, right 1, top 2, left 3."""
    grains, position, bodies = Grains(np.array([0.5]), np.ones(1)), np.array([[x, y]]), box(1.1, 1.1)
    contacts = measure_contacts(grains, position, bodies, np.zeros(len(walls), int), 1 + np.array(walls))
    c = contacts.count
    return FrameEvidence(
        contacts, np.full(c, prior), np.full(c, friction), grains.radius, np.full(1, 0.03), np.zeros(1),
        np.ones(1, bool), KnownForces(1.0, np.array([weight]), np.full(c, -1), np.empty(0)),
    )  # fmt: skip


def log_open(h: np.ndarray, settings: PosteriorSettings) -> np.ndarray:
    b, l = settings.gap_law_sd, settings.mean_open_gap
    return np.log(np.sqrt(2 * np.pi) * b / l) - h / l + 0.5 * (b / l) ** 2 + norm.logcdf(h / b - b / l)


def test_rod_between_two_walls_matches_the_integral() -> None:
    settings = replace(SETTINGS, gauge=2.0, mean_open_gap=0.05, force_rate=0.7)
    given = rod_in_corner(0.53, 0.5, [1, 3], friction=0.0, weight=(0.4, 0.0), prior=0.6)
    error = np.linspace(-0.16, 0.16, 161)[:, None, None]  # of the centre
    force = np.linspace(0.0, 3.0, 121)
    height = {"right": 0.07 + error, "left": 0.03 - error}  # true place is the measured one less its error
    mass, right_force = {}, {}
    for left in (False, True):
        for right in (False, True):
            fl = force[None, :, None] if left else np.zeros((1, 1, 1))
            fr = force[None, None, :] if right else np.zeros((1, 1, 1))
            level = -0.5 * (error / 0.03) ** 2 - 0.5 * ((0.4 + fl - fr) / settings.balance_sd) ** 2
            for bears, h, f in ((left, height["left"], fl), (right, height["right"], fr)):
                bearing = (
                    np.log(0.6)
                    - 0.5 * ((h + settings.compliance * f) / settings.gap_law_sd) ** 2
                    - settings.force_rate * f
                )
                level = level + (bearing if bears else np.log(0.4) + log_open(h, settings))
            level = level - 0.5 * settings.gauge / 2 * (left + right - 1.2) ** 2
            weight = np.exp(level) * force[1] ** (left + right)
            mass[left, right], right_force[left, right] = weight.sum(), (weight * fr).sum()
    total = sum(mass.values())

    found = infer_frame(given, settings, np.random.default_rng(SEED))
    assert list(found.contacts.j) == [2, 4]
    assert found.bearing_probability[0] == pytest.approx(
        (mass[False, True] + mass[True, True]) / total, abs=SAMPLING_ERROR
    )
    assert found.bearing_probability[1] == pytest.approx(
        (mass[True, False] + mass[True, True]) / total, abs=SAMPLING_ERROR
    )
    assert found.fn[0] == pytest.approx(sum(right_force.values()) / total, abs=SAMPLING_ERROR)


@pytest.mark.parametrize("across", [0.1, 0.6])
def test_obliquely_loaded_rod_matches_the_integral_over_the_coulomb_cone(across: float) -> None:
    given = rod_in_corner(0.5, 0.49, [0], friction=0.4, weight=(across, -1.0), prior=0.999)
    f = np.linspace(0.0, 3.0, 301)[:, None]
    t = np.linspace(-1.2, 1.2, 241)[None, :]
    # The normal points down, the tangent to the right: on the rod act −f along y upward, −t along x, and the torque −t.
    resultant = (across - t) ** 2 + (f - 1.0) ** 2 + t**2
    width = np.hypot(SETTINGS.gap_law_sd, 0.03)  # with the error of the centre integrated out
    level = -0.5 * resultant / SETTINGS.balance_sd**2 - 0.5 * (t / SETTINGS.tangential_sd) ** 2
    level = level - 0.5 * ((-0.01 + SETTINGS.compliance * f) / width) ** 2
    weight = np.exp(level) * (np.abs(t) <= 0.4 * f)

    found = infer_frame(given, SETTINGS, np.random.default_rng(SEED))
    bears = found.bearing_probability[0]
    assert bears > 0.99
    assert found.fn[0] / bears == pytest.approx((weight * f).sum() / weight.sum(), abs=SAMPLING_ERROR)
    assert found.ft[0] / bears == pytest.approx((weight * t).sum() / weight.sum(), abs=SAMPLING_ERROR)
    sd = np.sqrt((weight * t**2).sum() / weight.sum() - (found.ft[0] / bears) ** 2)
    assert found.ft_sd[0] == pytest.approx(COVERAGE_FACTOR * sd, rel=0.1)
    sd = np.sqrt((weight * f**2).sum() / weight.sum() - (found.fn[0] / bears) ** 2)
    assert found.fn_sd[0] == pytest.approx(COVERAGE_FACTOR * sd, rel=0.1)


def test_radius_error_is_separated_from_centre_error() -> None:
    # Equal gaps on four sides: an error of the radius explains them, one of the centre does not.
    given = rod_in_corner(0.55, 0.55, [0, 1, 2, 3], friction=0.0, weight=(0.0, 0.0), prior=0.999)
    settings = replace(SETTINGS, compliance=0.0, gauge=100.0)
    exact = infer_frame(given, settings, np.random.default_rng(SEED))
    free = infer_frame(replace(given, radius_sd=np.full(1, 0.1)), settings, np.random.default_rng(SEED))
    assert abs(exact.radius_error[0]) < 1e-5
    # Four gaps of 0.05 with standard deviation .02 against a prior of 0.1.
    assert free.radius_error[0] == pytest.approx(0.05 / (1 + (0.02 / 0.1) ** 2 / 4), abs=5e-3)
    assert np.abs(free.centre_error).max() < 5e-3


def test_radius_shared_by_two_frames_matches_the_gaussian_posterior() -> None:
    # Three contacts in one frame, four in the other, where the centre is displaced: the posterior is Gaussian.
    gaps = [np.array([0.05, 0.05, 0.06]), np.array([0.07, 0.10, 0.07, 0.04])]
    frames = []
    for gap in gaps:
        walls = list(range(len(gap)))
        rod = rod_in_corner(0.55, 0.55, walls, friction=0.0, weight=(0.0, 0.0), prior=0.9999)
        frames.append(replace(rod, radius_sd=np.full(1, 0.1), contacts=replace(rod.contacts, gap=gap)))
    pairs, grains = stack_frames(
        [make_sampler_pairs(each) for each in frames], [make_sampler_grains(each) for each in frames]
    )
    settings = replace(SETTINGS, compliance=0.0, gauge=1000.0)
    chain = run_chain(
        pairs, grains, make_schedule(settings, 7.0, scale_known=False), settings, np.random.default_rng(SEED)
    )
    assert chain.pair[:, 0].min() > 0.99

    design = np.zeros((7, 5))  # of δ, then ε of either frame: h = gap + n·ε − δ
    design[:, 0] = 1.0
    design[:3, 1:3], design[3:, 3:5] = -frames[0].contacts.normal, -frames[1].contacts.normal
    precision = design.T @ design / settings.gap_law_sd**2 + np.diag(np.array([0.1, 0.03, 0.03, 0.03, 0.03]) ** -2.0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ design.T @ np.concatenate(gaps) / settings.gap_law_sd**2
    np.testing.assert_array_equal(chain.error[0, 2], chain.error[1, 2])
    assert chain.error[0, 2] == pytest.approx(mean[0], abs=2e-3)
    np.testing.assert_allclose(chain.error[:, :2], mean[1:].reshape(2, 2), atol=2e-3)
    assert chain.error[0, 3] - chain.error[0, 2] ** 2 == pytest.approx(covariance[0, 0], rel=0.15)


def test_rod_at_two_walls_with_friction_matches_the_integral_over_both_cones() -> None:
    """Under an oblique load both torques must cancel, and both cones change the bearing probability."""
    given = rod_in_corner(0.6, 0.5, [0, 1], friction=0.6, weight=(0.8, -1.0), prior=0.3)
    settings = replace(SETTINGS, balance_sd=0.2, tangential_sd=0.8, mean_open_gap=0.05, gauge=1e-9)
    f, t = np.linspace(0.0, 2.0, 26), np.linspace(-1.2, 1.2, 25)
    width = np.hypot(settings.gap_law_sd, 0.03)
    cell = (f[1] - f[0]) * (t[1] - t[0])
    one, two = np.meshgrid(f, t, indexing="ij")
    inside = np.abs(two) <= 0.6 * one + 1e-9
    cone = np.column_stack([one[inside], two[inside]])
    none = np.zeros((1, 2))
    # Against the ground n = (0, −1), tangent (1, 0); against the right wall n = (1, 0), tangent (0, 1).
    total, ground, ground_t, right = 0.0, 0.0, 0.0, 0.0
    for ground_bears in (False, True):
        for right_bears in (False, True):
            g = (cone if ground_bears else none)[:, None, :]
            r = (cone if right_bears else none)[None, :, :]
            level = (
                -0.5
                / settings.balance_sd**2
                * (
                    (0.8 - g[..., 1] - r[..., 0]) ** 2
                    + (-1.0 + g[..., 0] - r[..., 1]) ** 2
                    + (g[..., 1] + r[..., 1]) ** 2
                )
            )
            for bears, force in ((ground_bears, g), (right_bears, r)):
                if bears:
                    level = level - 0.5 * (settings.compliance * force[..., 0] / width) ** 2 - np.log(width)
                    level = (
                        level
                        - 0.5 * (force[..., 1] / settings.tangential_sd) ** 2
                        - 0.5 * np.log(2 * np.pi)
                        - np.log(settings.tangential_sd)
                    )
                    level = level + np.log(0.3 * cell / np.sqrt(2 * np.pi))
                else:
                    level = level + np.log(0.7) + log_open(np.zeros(1), replace(settings, gap_law_sd=float(width)))
                    level = level - np.log(width) - 0.5 * np.log(2 * np.pi)
            weight = np.exp(level)
            total += weight.sum()
            ground += (weight * g[..., 0]).sum()
            ground_t += (weight * g[..., 1]).sum()
            right += (weight * right_bears).sum()

    found = infer_frame(given, settings, np.random.default_rng(SEED))
    assert found.fn[0] == pytest.approx(ground / total, abs=2 * SAMPLING_ERROR)
    assert found.ft[0] == pytest.approx(ground_t / total, abs=SAMPLING_ERROR)
    assert found.bearing_probability[1] == pytest.approx(right / total, abs=2 * SAMPLING_ERROR)


def heap_evidence(noise: float) -> tuple[FrameEvidence, np.ndarray]:
    """A heap at rest under its weight, its centres measured with noise [m], and the forces [N] on the pairs."""
    heap = heap_at_rest()
    n, radius = heap.packing.grains.count, heap.packing.grains.radius
    position = heap.state.position + np.random.default_rng(1).normal(0.0, noise, (n, 2))
    near = detect_contacts(heap.packing.grains, position, heap.state.present, heap.walls, 0.02 * 2 * radius[0])
    c = near.count
    truth = match_values(near.key, heap.contacts.key, np.column_stack([heap.fn, heap.ft]))
    unit = float(np.linalg.norm(heap.packing.weight, axis=1).mean())
    given = FrameEvidence(
        near, np.full(c, 0.9), np.full(c, 0.3), radius, np.full(n, max(noise, 1e-6)), np.zeros(n), np.ones(n, bool),
        KnownForces(unit, heap.packing.weight, np.full(c, -1), np.empty(0)),
    )  # fmt: skip
    return given, truth


QUICK = PosteriorSettings(compliance_sd=1e-5, annealing=200, burn_in=100, kept=200)


def test_heap_is_in_balance_and_the_ground_carries_its_weight() -> None:
    given, _ = heap_evidence(1e-5)
    found = infer_frame(given, QUICK, np.random.default_rng(SEED))
    weight = given.known.weight
    unbalance = resultant_norms(found.contacts, found.fn, found.ft, weight)
    assert unbalance.mean() < 0.3 * np.linalg.norm(weight, axis=1).mean()
    on_ground = found.contacts.j == len(weight)
    assert found.fn[on_ground].sum() == pytest.approx(-weight[:, 1].sum(), rel=0.03)
    assert 0.8 < found.trust < 1.0


def test_same_generator_gives_same_bits_in_parallel() -> None:
    given, _ = heap_evidence(1e-5)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: infer_frame(given, QUICK, np.random.default_rng(SEED)), range(4)))
    other = infer_frame(given, QUICK, np.random.default_rng(SEED + 1))
    for each in found[1:]:
        np.testing.assert_array_equal(each.fn, found[0].fn)
        np.testing.assert_array_equal(each.bearing_probability, found[0].bearing_probability)
    assert not np.array_equal(other.fn, found[0].fn)
    assert 0.0 < found[0].agreement < 1.0


def plate_evidence(load: float, gap: float = 0.0) -> FrameEvidence:
    """Four rods in two columns under a plate; the columns stand `gap` apart, unit diameters."""
    grains = Grains(np.full(4, 0.5), np.ones(4))
    position = np.array([[0.5, 0.5], [1.5 + gap, 0.5], [0.5, 1.5], [1.5 + gap, 1.5]])
    walls = box(2.0 + gap, 2.0, top_load=load)
    near = detect_contacts(grains, position, np.ones(4, bool), walls, 0.1)
    group = np.where(near.j == 6, 0, -1)
    return FrameEvidence(
        near, np.full(near.count, 0.7), np.full(near.count, 0.3), grains.radius, np.full(4, 1e-3), np.zeros(4),
        np.ones(4, bool), KnownForces(10.0, np.zeros((4, 2)), group, np.array([load])),
    )  # fmt: skip


@pytest.mark.parametrize("load", [20.0, 40.0])
def test_forces_on_a_plate_sum_to_its_load(load: float) -> None:
    found = infer_frame(plate_evidence(load), QUICK, np.random.default_rng(SEED))
    assert found.fn[found.contacts.j == 6].sum() == pytest.approx(load, rel=0.03)
    assert found.fn[found.contacts.j == 4].sum() == pytest.approx(load, rel=0.1)  # reaction of the ground


def test_without_known_forces_the_mean_force_is_the_unit() -> None:
    given = plate_evidence(20.0)
    free = replace(given, known=KnownForces(10.0, np.zeros((4, 2)), np.full(given.contacts.count, -1), np.empty(0)))
    found = infer_frame(free, QUICK, np.random.default_rng(SEED))
    assert found.fn.sum() / found.bearing_probability.sum() == pytest.approx(10.0, rel=0.15)


def test_open_pair_does_not_bear() -> None:
    found = infer_frame(plate_evidence(20.0, gap=0.03), QUICK, np.random.default_rng(SEED))
    between_columns = found.contacts.gap > 0.02
    assert found.bearing_probability[between_columns].max() < 0.05
    assert found.bearing_probability[~between_columns & (np.abs(found.contacts.normal[:, 1]) > 0.9)].min() > 0.9


def test_overlap_per_force_is_found_from_precise_positions() -> None:
    given = plate_evidence(20.0)
    force = np.where(
        np.abs(given.contacts.normal[:, 1]) > 0.9, np.where(given.contacts.normal[:, 1] != 0, 1.0, 0.0), 0.0
    )
    contacts = replace(given.contacts, gap=-5e-3 * force)
    soft = replace(given, contacts=contacts, centre_sd=np.full(4, 1e-5))
    settings = replace(QUICK, compliance_sd=1e-2, gap_law_sd=2e-4)
    found = infer_frame(soft, settings, np.random.default_rng(SEED))
    assert found.overlap == pytest.approx(5e-3 * found.fn.sum() / found.bearing_probability.sum() / 10.0, rel=0.05)


def test_grain_with_unknown_neighbours_need_not_be_in_balance() -> None:
    given = rod_in_corner(0.5, 0.49, [0], friction=0.4, weight=(0.0, 1.0), prior=0.9)  # pulled away from its only wall
    held = infer_frame(given, SETTINGS, np.random.default_rng(SEED))
    free = infer_frame(replace(given, balanced=np.zeros(1, bool)), SETTINGS, np.random.default_rng(SEED))
    assert held.fn[0] < 0.2
    assert free.fn[0] > 0.4


def test_outside_forces_on_edge_grains_are_of_the_mean_force() -> None:
    given = rod_in_corner(0.5, 0.49, [0], friction=0.4, weight=(0.0, 1.0), prior=0.9)  # pulled away from its only wall
    edge = replace(given, balanced=np.zeros(1, bool), edge=np.ones(1, bool))
    hard = replace(edge, known=replace(given.known, weight=np.array([[0.0, 40.0]])))
    held, mild, strong = (
        infer_frame(each, SETTINGS, np.random.default_rng(SEED)).fn[0] for each in (given, edge, hard)
    )
    assert mild > held + 0.2
    assert mild > strong + 0.2


def test_invalid_settings_are_rejected() -> None:
    with pytest.raises(ValueError, match="gap_law_sd of the posterior must be positive"):
        PosteriorSettings(gap_law_sd=0.0)
    with pytest.raises(ValueError, match="at least one chain"):
        PosteriorSettings(chains=0)
