from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.convex.program import (
    Balance,
    ConvexForces,
    ConvexSettings,
    LoadScale,
    assemble_balance,
    project_onto_equilibrium,
    soft_slip,
    solve_convex_member,
    torque_weight,
    weigh_rows,
)

UNIT = 20.0  # N
# The force residual is penalised, and the proximal term λ opposes it: λ/ρ = 3e-6 of a force per constraint. Chains of a
# few contacts and the tolerance 1e-6 of the interior point leave this fraction of a force unit.
BALANCED = 2e-4 * UNIT
SAME = 1e-3 * UNIT  # two solves of one program with 1e-6 on its objective


def box(width: float, height: float, top_load: float = np.nan) -> Walls:
    corner = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    endpoints = np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)
    return Walls(endpoints, np.zeros((4, 2, 2)), np.array([np.nan, np.nan, top_load, np.nan]))


def stack(top_load: float = 20.0) -> tuple[Grains, np.ndarray, Walls, Contacts]:
    radius = np.array([0.01, 0.008, 0.011])
    grains = Grains.of_rods(radius, density=2700.0, length=0.06)
    position = np.stack([np.full(3, 0.05), np.cumsum(2 * radius) - radius], axis=1)
    walls = box(0.1, 2 * radius.sum(), top_load)
    return grains, position, walls, detect_contacts(grains, position, np.ones(3, bool), walls, 1e-9)


def lattice() -> tuple[Grains, np.ndarray, Walls, Contacts]:
    """A triangular packing of 41 grains between four walls, the top one a plate under load."""
    r = 0.01
    position = np.array(
        [[r * (2 * q + 1 + row % 2), r * (1 + np.sqrt(3) * row)] for row in range(7) for q in range(6 - row % 2)]
    )
    grains = Grains.of_rods(np.full(len(position), r), density=2700.0, length=0.06)
    walls = box(12 * r, r * (2 + np.sqrt(3) * 6), top_load=60.0)
    return grains, position, walls, detect_contacts(grains, position, np.ones(len(position), bool), walls, 1e-9)


def balance_of(
    grains: Grains,
    walls: Walls,
    contacts: Contacts,
    friction: float = 0.25,
    *,
    force_unit: float = UNIT,
    gravity: tuple[float, float] = (0.0, 0.0),
    wall_normal_total: float | None = None,
) -> Balance:
    return assemble_balance(
        contacts, grains, walls, present=np.ones(grains.count, bool), friction=np.full(contacts.count, friction),
        scale=LoadScale(force_unit, gravity, wall_normal_total),
    )  # fmt: skip


def solve(balance: Balance, slip: np.ndarray | None = None, settings: ConvexSettings | None = None) -> ConvexForces:
    c = balance.contact_count
    return solve_convex_member(
        balance, np.zeros(c) if slip is None else slip, np.ones(c), np.zeros(c), np.zeros(c), settings
    )


def force_residual(balance: Balance, forces: ConvexForces) -> float:
    force = np.concatenate([forces.fn, forces.ft]) / UNIT
    return float(np.abs(balance.matrix @ force - balance.load).max() * UNIT)


def test_a_stack_carries_its_load_and_weight():
    grains, _, walls, contacts = stack()
    forces = solve(balance_of(grains, walls, contacts, gravity=(0.0, -9.81)))
    weight = 9.81 * grains.mass
    above = {1: 20 + weight[1:].sum(), 3: 20 + weight.sum(), 2: 20 + weight[2], 5: 20.0}
    assert forces.converged
    np.testing.assert_allclose(forces.fn, [above[int(j)] for j in contacts.j], atol=BALANCED)
    np.testing.assert_allclose(forces.ft, 0.0, atol=BALANCED)


def test_a_packing_is_in_balance_inside_the_coulomb_cone():
    grains, _, walls, contacts = lattice()
    balance = balance_of(grains, walls, contacts)
    slip = np.random.default_rng(0).normal(size=contacts.count)
    forces = solve(balance, slip)
    assert forces.converged
    assert force_residual(balance, forces) < 5e-3 * UNIT  # a slip of one costs as much as ρ times a residual of 1e-3
    assert forces.fn.min() >= 0
    assert np.all(np.abs(forces.ft) <= 0.25 * forces.fn)
    assert np.any(np.abs(forces.ft) > 0.2 * forces.fn)


def test_friction_opposes_sliding_at_its_limit():
    """One grain squeezed between floor and plate; the plate slides and drags the grain along."""
    grains = Grains.of_rods(np.array([0.01]), density=2700.0, length=0.06)
    walls = box(0.02, 0.02, top_load=20.0)
    contacts = detect_contacts(grains, np.array([[0.01, 0.01]]), np.ones(1, bool), walls, 1e-9)
    # Contacts with floor, right wall, plate, left wall. The plate moves to the right: along −t of its contact.
    assert contacts.j.tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(contacts.tangent[2], [-1.0, 0.0])
    slip = np.array([0.0, -1.0, -1.0, 0.0])
    forces = solve(balance_of(grains, walls, contacts), slip, ConvexSettings(history=1e-6))
    np.testing.assert_allclose(forces.fn[2], 20.0, atol=BALANCED)
    # f_t is what the grain exerts on the plate: it opposes the plate's motion, f_t u_t < 0.
    np.testing.assert_allclose(forces.ft[2], 0.25 * forces.fn[2], rtol=1e-3)


def test_forces_scale_with_load():
    grains, _, walls, contacts = lattice()
    slip = np.random.default_rng(1).normal(size=contacts.count)
    once = solve(balance_of(grains, walls, contacts), slip)
    heavy = Walls(walls.endpoints, walls.velocity, 3 * walls.load)
    thrice = solve(balance_of(grains, heavy, contacts, force_unit=3 * UNIT), slip)
    np.testing.assert_allclose(thrice.fn, 3 * once.fn, atol=3 * SAME)
    np.testing.assert_allclose(thrice.ft, 3 * once.ft, atol=3 * SAME)


def test_relabelling_grains_leaves_the_forces():
    grains, position, walls, contacts = lattice()
    rng = np.random.default_rng(2)
    slip = rng.normal(size=contacts.count)
    forces = solve(balance_of(grains, walls, contacts), slip)

    new_row = rng.permutation(grains.count)  # of each old grain
    old_row = np.argsort(new_row)
    shuffled = Grains(grains.radius[old_row], grains.mass[old_row])
    other = detect_contacts(shuffled, position[old_row], np.ones(grains.count, bool), walls, 1e-9)
    size = grains.count + walls.count
    body = np.concatenate([new_row, np.arange(grains.count, size)])
    a, b = body[contacts.i], body[contacts.j]
    row = np.searchsorted(other.key, np.minimum(a, b) * size + np.maximum(a, b))
    # Exchanging i and j reverses n and t together with the force and the sliding: components stay.
    other_slip = np.empty(other.count)
    other_slip[row] = slip
    again = solve(balance_of(shuffled, walls, other), other_slip)
    np.testing.assert_allclose(again.fn[row], forces.fn, atol=SAME)
    np.testing.assert_allclose(again.ft[row], forces.ft, atol=SAME)


def test_a_mirror_image_has_mirrored_forces():
    grains, position, walls, contacts = lattice()
    slip = np.random.default_rng(3).normal(size=contacts.count)
    forces = solve(balance_of(grains, walls, contacts), slip)

    mirror = np.array([-1.0, 1.0])
    mirrored = Walls(walls.endpoints[:, ::-1] * mirror, walls.velocity[:, ::-1] * mirror, walls.load)
    image = detect_contacts(grains, position * mirror, np.ones(grains.count, bool), mirrored, 1e-9)
    np.testing.assert_array_equal(image.key, contacts.key)
    reflected = solve(balance_of(grains, mirrored, image), -slip)
    np.testing.assert_allclose(reflected.fn, forces.fn, atol=SAME)
    np.testing.assert_allclose(reflected.ft, -forces.ft, atol=SAME)


def test_an_ambiguous_contact_is_unloaded_where_others_can_carry():
    grains, _, walls, contacts = lattice()
    balance = balance_of(grains, walls, contacts)
    c = contacts.count
    sure = solve(balance)
    pair = int(np.flatnonzero(~contacts.with_wall & (sure.fn > 0.1 * UNIT))[0])
    probability = np.ones(c)
    probability[pair] = 1e-3
    ambiguous = solve_convex_member(balance, np.zeros(c), probability, np.zeros(c), np.zeros(c))
    assert ambiguous.fn[pair] < 0.5 * sure.fn[pair]
    assert force_residual(balance, ambiguous) < 5e-3 * UNIT


def test_previous_forces_are_kept_without_slip():
    grains, _, walls, contacts = lattice()
    balance = balance_of(grains, walls, contacts)
    c = contacts.count
    previous = solve(balance, np.random.default_rng(4).normal(size=c))
    again = solve_convex_member(balance, np.zeros(c), np.ones(c), previous.fn, previous.ft)
    # Only the force residual caused by the previous slip changes.
    np.testing.assert_allclose(again.fn, previous.fn, atol=0.02 * UNIT)
    free = solve(balance)
    assert np.abs(free.fn - previous.fn).max() > 0.1 * UNIT


def test_projection_equilibrates_a_noisy_field_with_little_change():
    grains, _, walls, contacts = lattice()
    balance = balance_of(grains, walls, contacts)
    rng = np.random.default_rng(5)
    true = solve(balance)
    noisy_fn = true.fn * (1 + 0.1 * rng.normal(size=contacts.count))
    projected = project_onto_equilibrium(balance, noisy_fn, true.ft)
    before = force_residual(balance, replace(true, fn=noisy_fn))
    assert force_residual(balance, projected) < 0.01 * before
    change = np.linalg.norm(projected.fn - true.fn) / np.linalg.norm(noisy_fn - true.fn)
    assert change < 1.0
    assert np.all(np.abs(projected.ft) <= 0.25 * projected.fn)


def test_without_load_the_given_total_fixes_the_scale():
    grains, _, walls, contacts = stack(top_load=np.nan)
    with pytest.raises(ValueError, match="a total must fix the scale"):
        balance_of(grains, walls, contacts)
    forces = solve(balance_of(grains, walls, contacts, wall_normal_total=60.0))
    np.testing.assert_allclose(forces.fn, 30.0, atol=BALANCED)


def test_a_missing_grain_has_no_equilibrium_equations():
    grains, position, walls, _ = stack()
    present = np.array([True, True, False])
    contacts = detect_contacts(grains, position, present, walls, 1e-9)
    balance = assemble_balance(
        contacts, grains, box(0.1, walls.endpoints[2, 0, 1]), present=present,
        friction=np.full(contacts.count, 0.25), scale=LoadScale(UNIT, total=10.0),
    )  # fmt: skip
    assert balance.matrix.shape == (7, 2 * contacts.count)


def test_no_contacts_is_no_error():
    grains, _, walls, contacts = stack()
    nothing = contacts.select(np.zeros(contacts.count, bool))
    forces = solve(balance_of(grains, walls, nothing))
    assert forces.fn.shape == (0,)
    assert forces.converged


def test_a_slip_within_the_noise_is_none():
    settings = ConvexSettings(slip_noise=4.0)
    slip = soft_slip(np.array([3e-6, -3e-6, 5e-6, -9e-6, np.nan]), 1e-5, 1e-6, settings)
    np.testing.assert_allclose(slip, [0.0, 0.0, 0.1, -0.5, 0.0], atol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.5])
def test_coulomb_law_holds_exactly_at_any_friction(friction: float):
    grains, _, walls, contacts = lattice()
    forces = solve(balance_of(grains, walls, contacts, friction), np.random.default_rng(6).normal(size=contacts.count))
    assert np.all(np.abs(forces.ft) <= friction * forces.fn)


def test_a_contact_of_even_probability_has_no_penalty():
    grains, _, walls, contacts = lattice()
    balance, zero = balance_of(grains, walls, contacts), np.zeros(contacts.count)
    slip = np.random.default_rng(2).normal(0.0, 0.5, contacts.count)
    sure, even, ambiguous = (
        solve_convex_member(balance, slip, np.full(contacts.count, p), zero, zero).fn for p in (1.0, 0.5, 0.45)
    )
    assert np.array_equal(sure, even)
    assert not np.array_equal(sure, ambiguous)


def test_torques_are_balanced_over_the_mean_radius():
    grains, _, walls, contacts = stack()
    matrix = balance_of(grains, walls, contacts).matrix.toarray()
    n, c = grains.count, contacts.count
    for k in range(n):
        own = [c + row for row in range(c) if k in (contacts.i[row], contacts.j[row])]
        assert matrix[2 * n + k, own] == pytest.approx(-grains.radius[k] / grains.radius.mean())
        others = np.delete(matrix[2 * n + k], own)
        assert not others.any()


def test_moments_that_no_contact_exerts_relax_torque_equations():
    settings = ConvexSettings()
    none, small, large = torque_weight(np.array([0.0, 1e-3, 0.1]))
    assert none == 1.0
    assert 0.8 < small < 1.0
    assert large == pytest.approx(np.sqrt(settings.history / settings.balance) / 0.1, rel=0.01)
    grains, _, walls, contacts = lattice()
    moment = np.linspace(0.0, 0.01, grains.count)
    strict = balance_of(grains, walls, contacts)
    relaxed = balance_of(replace(grains, moment_sd=moment), walls, contacts)
    n = grains.count
    weight = np.ones(len(strict.load))
    weight[2 * n : 3 * n] = torque_weight(moment / (UNIT * grains.radius.mean()))
    assert relaxed.matrix.toarray() == pytest.approx(weight[:, None] * strict.matrix.toarray())
    again = weigh_rows(strict, weight, n)
    assert again.matrix.toarray() == pytest.approx(relaxed.matrix.toarray())
    assert again.grains.jacobian == pytest.approx(relaxed.grains.jacobian)


def test_noise_takes_its_share_off_the_power_that_forces_could_dissipate():
    grains, _, walls, contacts = lattice()
    balance = balance_of(grains, walls, contacts)
    rng = np.random.default_rng(4)
    slip, none = rng.normal(size=contacts.count), np.zeros(contacts.count)
    touch, settings = np.ones(contacts.count), ConvexSettings()

    def gap(forces: ConvexForces, share: float) -> float:
        return float(np.sum((1.0 - share) * balance.friction * forces.fn * np.abs(slip) + forces.ft * slip))

    clear = solve_convex_member(balance, slip, touch, none, none)
    noisy = solve_convex_member(balance, slip, touch, none, none, noise=1.0)
    assert noisy.fn.sum() > clear.fn.sum()
    assert gap(noisy, settings.noise_fraction) < gap(clear, settings.noise_fraction)
    assert gap(clear, 0.0) < gap(noisy, 0.0)
