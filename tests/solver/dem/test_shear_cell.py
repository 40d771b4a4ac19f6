"""The discrete-element simulation against closed forms, and its photographs against an independent assembly."""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts, detect_contacts, measure_contacts
from rodsight.solver.dem.dem_truth import DemSettings, DemTruth, UnbalancedError
from rodsight.solver.dem.shear_cell import FrameSize, ShearCell, shear_photographs
from rodsight.synthetic.dense_packing import prepare_packing

# A packing takes some ten thousand steps to prepare: minutes without compilation.
compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
HELD = DemSettings(pressure=float("nan"), normal_stiffness=1e6)  # plate held; soft, so that collisions take few steps
LEAPFROG = 2e-3  # relative: the first and the last step of a collision of some hundred are cut short
ROUNDING = 1e-11  # relative, of sums over some hundred steps
BALANCE = 5e-3  # worst grain over mean force; the pause ends at a mean of 2e-4
STIFF = 1e-3  # relative: what the dashpots may still add to a force at rest


def collide(settings: DemSettings, velocity: np.ndarray, offset: float = 0.0) -> tuple[ShearCell, np.ndarray]:
    """Collide two rods far from any wall; return the cell and the final velocities."""
    radius = np.array([0.008, 0.011])
    position = np.array([[0.5, 0.5], [0.5 + np.sqrt(0.0191**2 - offset**2), 0.5 + offset]])
    cell = ShearCell(radius, position, FrameSize(1.0, 1.0), settings, velocity=velocity)
    cell.run(np.zeros(3000))
    return cell, cell.velocity


def test_collision_without_dashpot_keeps_energy_and_momentum() -> None:
    before = np.array([[0.5, 0.0, 0.0], [-0.3, 0.0, 0.0]])
    cell, after = collide(replace(HELD, damping_ratio=0.0, friction=0.0, time_step_factor=0.02), before)
    mass = cell.grains.mass[:, None]
    assert after[1, 0] - after[0, 0] == pytest.approx(0.8, rel=LEAPFROG)
    np.testing.assert_allclose((mass * after).sum(0), (mass * before).sum(0), atol=ROUNDING)
    assert (mass * after**2).sum() == pytest.approx((mass * before**2).sum(), rel=LEAPFROG)


@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.5])
def test_restitution_is_that_of_a_linear_dashpot_that_does_not_pull(ratio: float) -> None:
    _, after = collide(
        replace(HELD, damping_ratio=ratio, friction=0.0, time_step_factor=0.02),
        np.array([[0.4, 0.0, 0.0], [-0.4, 0.0, 0.0]]),
    )
    # The contact ends when the force vanishes (Schwager & Pöschel 2007), in units of the undamped frequency.
    damped = np.sqrt(1.0 - ratio**2)
    end = (np.pi - np.arctan(2.0 * ratio * damped / (1.0 - 2.0 * ratio**2))) / damped
    restitution = -np.exp(-ratio * end) * (np.cos(damped * end) - ratio / damped * np.sin(damped * end))
    assert (after[1, 0] - after[0, 0]) / 0.8 == pytest.approx(restitution, rel=2e-2)  # first order in the time step


def test_oblique_collision_keeps_linear_and_angular_momentum() -> None:
    before = np.array([[0.5, 0.1, 30.0], [-0.3, -0.2, 10.0]])
    cell, after = collide(HELD, before, offset=0.006)
    mass, inertia = cell.grains.mass, cell.grains.inertia
    np.testing.assert_allclose(mass @ after[:, :2], mass @ before[:, :2], atol=ROUNDING)
    start = np.array([[0.5, 0.5], [0.5 + np.sqrt(0.0191**2 - 0.006**2), 0.506]])

    def moment(position: np.ndarray, velocity: np.ndarray) -> float:
        arm = position - start[0]
        return float(mass @ (arm[:, 0] * velocity[:, 1] - arm[:, 1] * velocity[:, 0]) + inertia @ velocity[:, 2])

    assert abs(after[0, 2] - before[0, 2]) > 1.0  # friction did act
    # Friction acts at R from the centres, not at R − overlap / 2: a moment of the order of overlap / R is lost.
    assert moment(cell.position, after) == pytest.approx(moment(start, before), rel=3e-2)


@pytest.mark.parametrize(
    ("degrees", "slides"), [(10.0, False), (30.0, False), (50.0, True), (70.0, True)], ids=lambda v: str(v)
)
def test_rod_on_an_incline_rolls_or_slides_as_friction_allows(degrees: float, slides: bool) -> None:
    slope, friction, gravity = np.deg2rad(degrees), 0.25, 9.81
    assert slides == (np.tan(slope) > 3.0 * friction)
    settings = replace(
        HELD, wall_friction=friction, gravity=(gravity * np.sin(slope), -gravity * np.cos(slope)), damping_ratio=0.3
    )
    radius = np.array([0.008])
    weight = settings.density * settings.length * np.pi * radius[0] ** 2 * gravity
    rest = radius[0] - weight * np.cos(slope) / settings.normal_stiffness
    cell = ShearCell(radius, np.array([[0.1, rest]]), FrameSize(1.0, 0.5), settings)
    steps = 4000
    cell.run(np.zeros(steps))
    vx, _, spin = cell.velocity[0]
    if slides:
        acceleration = gravity * (np.sin(slope) - friction * np.cos(slope))
    else:
        acceleration = gravity * np.sin(slope) * 2.0 / 3.0
        assert -spin * radius[0] == pytest.approx(vx, rel=1e-2)  # the tangential spring takes up a little
    assert vx == pytest.approx(acceleration * steps * cell.time_step, rel=1e-2)


@pytest.mark.parametrize("ratio", [0.1, 0.3])
def test_slip_that_friction_holds_decays_with_the_damping_ratio_of_the_normal(ratio: float) -> None:
    gravity = 100.0
    settings = replace(HELD, gravity=(0.0, -gravity), damping_ratio=ratio, time_step_factor=0.02)
    radius = np.array([0.008])
    mass = settings.density * settings.length * np.pi * radius[0] ** 2
    rest = radius[0] - mass * gravity / settings.normal_stiffness
    start = np.array([[1e-3, 0.0, 0.0]])
    cell = ShearCell(radius, np.array([[0.1, rest]]), FrameSize(1.0, 0.5), settings, velocity=start)
    # A third of the mass resists the slip of a solid rod, which also turns.
    frequency = np.sqrt(3.0 * settings.stiffness_ratio * settings.normal_stiffness / mass)
    half = np.pi / (frequency * np.sqrt(1.0 - ratio**2))
    cell.run(np.zeros(round(half / cell.time_step)))
    slip = cell.velocity[0, 0] + radius[0] * cell.velocity[0, 2]
    assert slip / start[0, 0] == pytest.approx(-np.exp(-ratio * frequency * half), rel=2e-2)


def test_rod_that_slides_to_the_right_drags_the_bottom_to_the_right() -> None:
    settings = replace(HELD, gravity=(0.0, -9.81))
    cell = ShearCell(
        np.array([0.008]),
        np.array([[0.1, 0.008]]),
        FrameSize(1.0, 0.5),
        settings,
        velocity=np.array([[0.5, 0.0, 0.0]]),
    )
    cell.run(np.zeros(600))  # 0.03 s: settled on the wall, and rolling only after v / 3μg = 0.07 s
    frame = cell.photograph(0)
    assert (frame.i.tolist(), frame.j.tolist()) == ([0], [1])  # the bottom is the first wall
    assert frame.fn[0] == pytest.approx(cell.grains.mass[0] * 9.81, rel=1e-2)
    # The bottom's normal points down, so its tangent points right: f_t is what the rod does to the wall.
    assert frame.ft[0] == pytest.approx(settings.wall_friction * frame.fn[0], rel=ROUNDING)


def test_rod_squeezed_by_the_plate_rolls_at_half_its_speed() -> None:
    radius, overlap, rate = 0.008, 1e-6, 0.5
    height = 2.0 * (radius - overlap)
    cell = ShearCell(np.array([radius]), np.array([[0.5, height / 2]]), FrameSize(1.0, height), HELD)
    cell.run(np.full(3000, rate))
    vx, vy, spin = cell.velocity[0]
    speed = height * rate / np.cos(cell.shear) ** 2
    assert vx == pytest.approx(speed / 2, rel=STIFF)
    assert spin == pytest.approx(-speed / (2 * radius), rel=STIFF)
    assert abs(vy) < STIFF * vx


def test_rod_between_rotating_sides_stays_midway() -> None:
    """Dashpots use the velocity of the sides; otherwise the rod would lag by damping · speed / stiffness = 40 µm."""
    radius, overlap = 0.008, 5e-6
    width = 2.0 * (radius - overlap)
    settings = replace(HELD, friction=0.0, wall_friction=0.0)
    cell = ShearCell(np.array([radius]), np.array([[width / 2, 0.25]]), FrameSize(width, 0.5), settings)
    cell.run(np.full(1500, 1.0))
    x, y = cell.position[0]
    sideways = (x - width / 2) * np.cos(cell.shear) - y * np.sin(cell.shear)
    assert cell.shear > 0.05
    assert abs(sideways) < 1e-6


def test_pause_stops_only_rods_without_contact() -> None:
    settings = replace(HELD, pause_limit=250, gravity=(0.0, -9.81))
    velocity = np.array([[0.05, 0.02, 3.0], [0.5, 0.0, 0.0]])
    position = np.array([[0.5, 0.5], [0.2, 0.008 - 3e-7]])  # in the air; sliding on the bottom
    cell = ShearCell(np.full(2, 0.008), position, FrameSize(1.0, 1.0), settings, velocity=velocity)
    assert cell.rest() == settings.pause_limit
    assert cell.touching.tolist() == [False, True]
    np.testing.assert_array_equal(cell.velocity[0], 0.0)
    assert cell.velocity[1, 0] > 0.4


@compiled
def test_same_start_gives_the_same_bits() -> None:
    first, second = (shear_little(seed=5, degrees=(0.0, 0.2)) for _ in range(2))
    for name in ("position", "rotation", "fn", "ft", "i", "j"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def shear_little(*, seed: int, degrees: tuple[float, ...]) -> DemTruth:
    cell = prepare_packing(40, np.random.default_rng(seed), DemSettings(inertial_number=3e-4))
    frames = list(shear_photographs(cell, np.deg2rad(degrees)))
    return DemTruth.of_frames(cell.grains.radius, frames, cell.settings)


@pytest.fixture(scope="module")
def truth() -> DemTruth:
    return shear_little(seed=3, degrees=(0.0, 1.0, 2.0, 1.0))


def bodies_of(truth: DemTruth, k: int) -> tuple[Grains, Walls]:
    settings, ends = truth.settings, truth.endpoints[k]
    grains = Grains.of_rods(truth.radius, density=settings.density, length=settings.length)
    return grains, Walls.at_rest(ends)


def contacts_of(truth: DemTruth, k: int) -> tuple[Contacts, np.ndarray, np.ndarray]:
    rows = slice(truth.offset[k], truth.offset[k + 1])
    contacts = measure_contacts(*_grains_position_walls(truth, k), truth.i[rows], truth.j[rows])
    np.testing.assert_array_equal(contacts.i, truth.i[rows])
    np.testing.assert_array_equal(contacts.j, truth.j[rows])
    return contacts, truth.fn[rows], truth.ft[rows]


def _grains_position_walls(truth: DemTruth, k: int) -> tuple[Grains, np.ndarray, Walls]:
    grains, walls = bodies_of(truth, k)
    return grains, truth.position[k], walls


@compiled
@pytest.mark.parametrize("k", range(4))
def test_every_grain_is_in_balance_in_forces_and_moments(truth: DemTruth, k: int) -> None:
    contacts, fn, ft = contacts_of(truth, k)
    n = len(truth.radius)
    resultant, moment = np.zeros((n + 4, 2)), np.zeros(n + 4)
    radius = np.concatenate([truth.radius, np.zeros(4)])
    for i, j, normal, tangent, normal_force, friction_force in zip(
        contacts.i, contacts.j, contacts.normal, contacts.tangent, fn, ft, strict=True
    ):
        force = normal_force * normal + friction_force * tangent  # that i exerts on j
        resultant[j] += force
        resultant[i] -= force
        on_i, on_j = radius[i] * normal, -radius[j] * normal
        moment[j] += on_j[0] * force[1] - on_j[1] * force[0]
        moment[i] -= on_i[0] * force[1] - on_i[1] * force[0]
    grains = np.linalg.norm(resultant[:n], axis=1) / fn.mean()
    assert grains.max() < BALANCE
    assert grains.mean() == pytest.approx(truth.unbalance[k], rel=1e-3)
    assert np.abs(moment[:n] / truth.radius).max() / fn.mean() < BALANCE
    width = np.linalg.norm(truth.endpoints[k, 0, 1] - truth.endpoints[k, 0, 0])
    load = truth.settings.pressure * truth.settings.length * width
    assert resultant[n + 2, 1] == pytest.approx(load, rel=BALANCE)  # the plate carries the load


@compiled
def test_friction_is_mobilised_and_never_beyond_coulomb(truth: DemTruth) -> None:
    assert np.all(truth.fn > 0.0)
    mobilised = np.abs(truth.ft) / (truth.settings.friction * truth.fn)
    assert mobilised.max() <= 1.0 + ROUNDING
    assert np.mean(mobilised[truth.offset[1] :] > 0.9) > 0.05
    np.testing.assert_array_equal(truth.ft[: truth.offset[1]] == 0.0, False)


@compiled
@pytest.mark.parametrize("k", range(4))
def test_forces_are_the_overlaps_times_stiffness(truth: DemTruth, k: int) -> None:
    """A pair missing in the neighbour list would overlap without force."""
    grains, walls = bodies_of(truth, k)
    everywhere = np.ones(grains.count, dtype=bool)
    contacts, fn, _ = contacts_of(truth, k)
    faint = STIFF * fn.mean()  # contribution of the dashpots at rest
    faintest_overlap = faint / truth.settings.normal_stiffness
    overlapping = detect_contacts(grains, truth.position[k], everywhere, walls, -faintest_overlap)
    assert overlapping.count > 0.9 * contacts.count
    assert np.isin(overlapping.key, contacts.key).all()
    np.testing.assert_allclose(fn, -truth.settings.normal_stiffness * contacts.gap, atol=faint)


@compiled
def test_frame_is_a_linkage_around_the_packing(truth: DemTruth) -> None:
    side = truth.endpoints[:, :, 1] - truth.endpoints[:, :, 0]
    length = np.linalg.norm(side, axis=2)
    np.testing.assert_allclose(length, np.broadcast_to(length[0], length.shape), rtol=ROUNDING)
    bottom, right, top, left = np.moveaxis(side, 1, 0)
    np.testing.assert_allclose(top, -bottom, atol=ROUNDING)
    np.testing.assert_allclose(left, -right, atol=ROUNDING)
    np.testing.assert_allclose(np.arctan2(right[:, 0], right[:, 1]), truth.shear, atol=ROUNDING)
    np.testing.assert_allclose(np.rad2deg(truth.shear), [0.0, 1.0, 2.0, 1.0], atol=1e-9)
    for k in range(truth.frame_count):
        _, walls = bodies_of(truth, k)
        offset = truth.position[k][:, None] - walls.endpoints[None, :, 0]
        inside = -np.einsum("nwk,wk->nw", offset, walls.outward)
        assert np.all(inside > 0.99 * truth.radius[:, None])


@compiled
def test_shear_is_resisted(truth: DemTruth) -> None:
    contacts, _, ft = contacts_of(truth, 2)
    n = len(truth.radius)
    assert ft[contacts.j == n].sum() > 0.0  # sheared to the right, the packing drags the bottom to the right


@compiled
def test_moving_packing_is_refused_as_truth() -> None:
    cell = prepare_packing(40, np.random.default_rng(1), DemSettings())
    at_rest = cell.photograph(cell.rest())
    cell.run(np.full(200, 5.0))  # 5 rad/s, thousands of times too fast
    moving = cell.photograph(0)
    DemTruth.of_frames(cell.grains.radius, [at_rest], cell.settings)
    with pytest.raises(UnbalancedError, match="photograph 1"):
        DemTruth.of_frames(cell.grains.radius, [at_rest, moving], cell.settings)


def test_photograph_without_any_contact_is_refused() -> None:
    cell = ShearCell(np.array([0.008]), np.array([[0.5, 0.5]]), FrameSize(1.0, 1.0), HELD)
    with pytest.raises(UnbalancedError, match="photograph 0"):
        DemTruth.of_frames(cell.grains.radius, [cell.photograph(0)], HELD)


@pytest.mark.parametrize(
    "wrong", [{"damping_ratio": 0.9}, {"time_step_factor": 0.5}, {"normal_stiffness": 0.0}, {"friction": -0.1}]
)
def test_unstable_or_invalid_settings_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must|not be stable"):
        replace(DemSettings(), **wrong)
