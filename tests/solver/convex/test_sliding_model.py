"""What resists sliding is found by the power gap, and named only where it clearly explains the motion."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.convex import resistance
from rodsight.solver.convex.ensemble_members import measured_slip
from rodsight.solver.convex.friction_estimate import relative_power_gap
from rodsight.solver.convex.grain_blocks import block_balance
from rodsight.solver.convex.program import LoadScale, assemble_balance, solve_convex_member
from rodsight.solver.convex.resistance import (
    TORQUE_WEIGHT,
    base_drag_of,
    find_in_sequence,
    find_resistance,
    find_unstated,
    model_of,
    resisted_frames,
)
from rodsight.solver.convex.sliding_model import FittedModel, SlidingModel, fit_model, power_gap
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.solver.nlgs.chain import ChainSettings, force_scale

from tests.solver.sequence.test_frames import sheared_frames

GIVEN = SlidingModel(0.25, 0.25)


@pytest.fixture(scope="module")
def frames():
    packing, snapshots = sheared_frames(6)
    unit = force_scale(packing, ChainSettings())
    return packing, unit, resisted_frames(packing, snapshots, range(1, 4), ContactProbabilitySettings(1e-6))


def test_an_attraction_is_a_shift_of_the_normal_forces(frames):
    _, _, (frame, *_) = frames
    attracted = frame.balance_of(replace(GIVEN, attraction=0.3))
    c = frame.balance.contact_count
    rng = np.random.default_rng(1)
    force = rng.normal(size=2 * c)
    shifted = force.copy()
    shifted[:c] += np.where(frame.contacts.with_wall, 0.0, 0.3 * frame.probability)
    before = frame.balance.matrix @ force - frame.balance.load
    assert attracted.matrix @ shifted - attracted.load == pytest.approx(before, abs=1e-12)


def test_contacts_that_resist_rolling_turn_both_grains_against_their_relative_rotation(frames):
    packing, _, (frame, *_) = frames
    _, snapshots = sheared_frames(6)
    turned = (snapshots[2].rotation - snapshots[0].rotation)[snapshots[1].present & packing.grains.free]
    c, n = frame.balance.contact_count, frame.grain_count
    fn = np.linspace(1.0, 2.0, c)
    added = frame.balance_of(replace(GIVEN, rolling=0.1)).matrix - frame.balance.matrix
    assert abs(added[:, c:]).sum() == 0.0  # by f_n alone
    moment = added[2 * n : 3 * n] @ np.concatenate([fn, np.zeros(c)])
    assert np.abs(added @ np.concatenate([fn, np.zeros(c)])).sum() == pytest.approx(np.abs(moment).sum())
    assert np.abs(moment).max() > 0.0
    assert float(moment @ turned) < 0.0  # the moments take power from the rotation
    assert frame.reversed().roll.toarray() == pytest.approx(-frame.roll.toarray())


def test_the_base_drags_against_the_motion(frames):
    packing, _, (frame, *_) = frames
    _, snapshots = sheared_frames(6)
    moved = (snapshots[2].position - snapshots[0].position)[snapshots[1].present & packing.grains.free]
    for axis, load in enumerate(frame.drag[: 2 * frame.grain_count].reshape(2, -1)):  # b is minus the force
        assert (load * moved[:, axis] >= 0.0).all()
    drag = frame.balance_of(replace(GIVEN, base_drag=0.2)).load - frame.balance.load
    assert drag == pytest.approx(0.2 * frame.drag)
    size = np.hypot(*frame.drag[: 2 * frame.grain_count].reshape(2, -1))
    share = packing.grains.mass / packing.grains.mass.mean()
    assert (size <= share * (1.0 + 1e-9)).all()
    assert size.max() > 0.5
    material = replace(packing.material, base_drag=3.0)
    assert base_drag_of(packing, model_of(replace(packing, material=material))) == pytest.approx(3.0)


def test_a_drag_grows_with_the_mass_and_fades_where_the_motion_is_noise(frames):
    packing, _, _ = frames
    _, snapshots = sheared_frames(6)
    mass = packing.grains.mass * np.linspace(0.5, 1.5, packing.grains.count)
    heavy = replace(packing, grains=replace(packing.grains, mass=mass))
    noisy = [replace(each, sigma=3e-5) for each in snapshots]
    (frame,) = resisted_frames(heavy, noisy, [2], ContactProbabilitySettings(1e-6))
    moved = noisy[3].position - noisy[1].position
    expected = (mass / mass.mean() / np.sqrt((moved**2).sum(axis=1) + 4.0 * 3e-5**2))[:, None] * moved
    np.testing.assert_allclose(frame.drag[: 2 * frame.grain_count].reshape(2, -1).T, expected)


def test_a_frame_has_light_torques_no_stated_drag_and_the_sliding_around_it(frames):
    packing, unit, _ = frames
    _, snapshots = sheared_frames(6)
    drag = np.ones((packing.grains.count, 2))
    based = replace(packing, grains=replace(packing.grains, drag=drag))
    (frame,) = resisted_frames(based, snapshots, [2], ContactProbabilitySettings(1e-6))
    walls = packing.walls_of(snapshots[2])
    plain = assemble_balance(
        frame.contacts, packing.grains, walls, present=snapshots[2].present, friction=frame.balance.friction,
        scale=LoadScale(unit, packing.material.gravity),
    )  # fmt: skip
    weight = np.ones(len(plain.load))
    weight[2 * frame.grain_count : 3 * frame.grain_count] = TORQUE_WEIGHT
    assert frame.balance.matrix.toarray() == pytest.approx(weight[:, None] * plain.matrix.toarray())
    assert frame.balance.load == pytest.approx(weight * plain.load)
    around = measured_slip(frame.contacts, packing.grains, walls, (snapshots[1], snapshots[3]))
    np.testing.assert_array_equal(frame.slip, around)


def test_the_power_gap_is_that_of_forces_under_the_model(frames):
    _, _, (frame, *_) = frames
    frame = replace(frame, slip=np.random.default_rng(4).normal(size=len(frame.slip)))
    model = SlidingModel(0.4, 0.1, 0.1, 0.2)
    balance, c = frame.balance_of(model), frame.balance.contact_count
    np.testing.assert_array_equal(balance.friction, np.where(frame.contacts.with_wall, 0.1, 0.4))
    blocks = block_balance(balance.matrix, balance.load, frame.grain_count, c)
    for name in ("load", "jacobian"):
        np.testing.assert_array_equal(getattr(balance.grains, name), getattr(blocks, name))
    found = solve_convex_member(balance, frame.slip, frame.probability, np.zeros(c), np.zeros(c))
    expected = relative_power_gap(frame.slip, balance.friction, found.fn, found.ft)
    assert power_gap([frame], model) == pytest.approx(expected)
    assert expected != pytest.approx(relative_power_gap(frame.slip, frame.balance.friction, found.fn, found.ft))


def test_later_frames_remember_the_forces_of_earlier_ones(frames):
    _, _, (frame, *_) = frames
    rng = np.random.default_rng(3)
    some = [replace(frame, slip=rng.normal(size=len(frame.slip))) for _ in range(2)]
    alone = [power_gap([each], GIVEN) for each in some]
    assert power_gap(some, GIVEN) != pytest.approx(np.mean(alone), rel=1e-9)


def test_a_reversed_motion_has_another_gap(frames):
    rng = np.random.default_rng(2)
    some = [replace(each, slip=rng.normal(size=len(each.slip))) for each in frames[2]]
    there, back = power_gap(some, GIVEN), power_gap([each.reversed() for each in some], GIVEN)
    assert there != pytest.approx(back)
    assert power_gap([each.reversed().reversed() for each in some], GIVEN) == there
    np.testing.assert_array_equal(some[0].reversed().drag, -some[0].drag)


def test_the_fit_ends_where_the_gap_rises_on_both_sides(frames, monkeypatch):
    best = SlidingModel(0.31, 0.12, 0.07)

    def bowl(_, model, settings=None):
        return 0.05 + sum(
            (model.value(name) / best.value(name) - 1.0) ** 2 for name in ("friction", "wall_friction", "base_drag")
        )

    monkeypatch.setattr("rodsight.solver.convex.sliding_model.power_gap", bowl)
    found = fit_model([], GIVEN, ("base_drag", "wall_friction", "friction"))
    assert found.enclosed
    for name in ("friction", "wall_friction", "base_drag"):
        assert found.model.value(name) == pytest.approx(best.value(name), rel=0.02)
    monkeypatch.setattr("rodsight.solver.convex.sliding_model.power_gap", lambda _, model, __=None: 1 / model.friction)
    assert not fit_model([], GIVEN, ("friction",)).enclosed


def test_parameters_that_shift_one_another_are_fitted_in_rounds(monkeypatch):
    def valley(_, model, settings=None):
        x, y = model.friction - 0.3, model.base_drag - 0.1
        return 0.05 + (x + y) ** 2 + 0.3 * (x - y) ** 2

    monkeypatch.setattr("rodsight.solver.convex.sliding_model.power_gap", valley)
    with monkeypatch.context() as patch:
        patch.setattr("rodsight.solver.convex.sliding_model.ROUNDS", 1)
        first = fit_model([], GIVEN, ("friction", "base_drag"))
    found = fit_model([], GIVEN, ("friction", "base_drag"))
    assert found.gap < first.gap
    assert found.model.value("friction") == pytest.approx(0.3, rel=0.1)


def test_the_friction_of_walls_follows_that_of_grains_in_proportion():
    model = SlidingModel(0.2, 0.1, 0.05)
    assert model.with_value("all_friction", 0.3) == SlidingModel(0.3, pytest.approx(0.15), 0.05)
    assert model.with_value("friction", 0.3) == SlidingModel(0.3, 0.1, 0.05)


GAPS = {"friction": 0.4, "wall_friction": 0.4, "base_friction": 0.4, "adhesion": 0.4, "rolling": 0.4}


@pytest.mark.parametrize(
    ("gaps", "cause"),
    [
        ({}, ""),
        ({"friction": 0.1, "wall_friction": 0.1, "base_friction": 0.1, "adhesion": 0.1}, "friction"),
        ({"wall_friction": 0.1}, "wall_friction"),
        ({"wall_friction": 0.1, "adhesion": 0.11}, ""),
        ({"base_friction": 0.3}, ""),  # a rival that leaves so much does not explain the sliding
        ({"adhesion": 0.15, "friction": 0.2}, "friction"),
        ({"rolling": 0.2}, "rolling_resistance"),
        ({"rolling": 0.2, "friction": 0.24}, "friction"),  # another friction explains nearly as much
        ({"rolling": 0.3}, ""),
        ({"rolling": 0.1, "wall_friction": 0.2}, "wall_friction"),
    ],
)
def test_only_a_clear_winner_is_named(frames, monkeypatch, gaps, cause):
    fitted = GAPS | gaps
    monkeypatch.setattr(resistance, "power_gap", lambda *_: 0.45)
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda frames, given, rivals, workers: [
            FittedModel(replace(given, wall_friction=0.25), gap, True)
            for name, gap in fitted.items()
            if resistance.RIVALS.get(name, (name,)) in rivals
        ],
    )
    monkeypatch.setattr(resistance, "LEAST_WALLS", 0)
    found = find_resistance(frames[2], replace(GIVEN, wall_friction=0.5))
    assert found is not None
    assert found.cause == cause


def test_walls_with_the_friction_that_is_given_are_not_blamed(frames, monkeypatch):
    """The rods' friction is wrong then; fitted for both alike it would shift that of the walls."""
    fitted = GAPS | {"wall_friction": 0.1}
    other = replace(GIVEN, friction=0.5 * GIVEN.friction, wall_friction=1.1 * GIVEN.wall_friction)
    monkeypatch.setattr(resistance, "power_gap", lambda *_: 0.45)
    monkeypatch.setattr(resistance, "LEAST_WALLS", 0)
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda frames, given, rivals, workers: [
            FittedModel(other, fitted[name], True) for name in fitted if resistance.RIVALS.get(name) in rivals
        ],
    )
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert (found.cause, found.found, found.found_gap) == ("friction", other, 0.1)


@pytest.mark.parametrize(
    ("gaps", "wall_friction", "base_drag"),
    [
        ({}, 0.25, 0.0),
        ({"wall_friction": 0.1}, 0.01, 0.0),
        ({"base_drag": 0.1}, 0.25, 0.1),
        ({"wall_friction": 0.1, "base_drag": 0.105}, 0.25, 0.0),  # one of two, and neither is clear
        ({"wall_friction": 0.3}, 0.25, 0.0),
        ({"wall_friction": 0.2, "both": 0.05}, 0.01, 0.1),
    ],
)
def test_what_the_input_does_not_state_is_used_where_it_is_clear(frames, monkeypatch, gaps, wall_friction, base_drag):
    found = {"wall_friction": replace(GIVEN, wall_friction=0.01), "base_drag": replace(GIVEN, base_drag=0.1)}
    both = replace(found["wall_friction"], base_drag=0.1)
    gap = (
        {GIVEN: 0.45} | {model: gaps.get(name, 0.44) for name, model in found.items()} | {both: gaps.get("both", 0.19)}
    )

    def fitted(_, model, rivals, workers):
        rows = []
        for (name,) in rivals:
            other = found[name] if model == GIVEN else both
            rows.append(FittedModel(other, gap[other], True))
        return rows

    forwards = {id(each) for each in frames[2]}
    monkeypatch.setattr(resistance, "power_gap", lambda some, model: gap[model] if id(some[0]) in forwards else 1.0)
    monkeypatch.setattr(resistance, "compare_models", fitted)
    model = find_unstated(frames[2], GIVEN, ("wall_friction", "base_friction"))
    assert (model.wall_friction, model.base_drag, model.friction) == (wall_friction, base_drag, 0.25)


def test_a_resistance_is_looked_for_only_where_the_sliding_contradicts_and_is_in_order(frames, monkeypatch):
    sure = FittedModel(replace(GIVEN, base_drag=0.1), 0.01, True)
    monkeypatch.setattr(resistance, "compare_models", lambda _, __, rivals, ___: [sure] * len(rivals))
    for before, back, used in ((0.45, 1.0, True), (0.09, 1.0, False), (0.45, 0.2, False)):
        gaps = iter([before, back, 0.01])
        monkeypatch.setattr(resistance, "power_gap", lambda *_, gaps=gaps: next(gaps))
        assert (find_unstated(frames[2], GIVEN, ["base_friction"]) != GIVEN) == used


def test_a_rival_at_the_edge_of_its_trials_counts_as_the_given_model(frames, monkeypatch):
    edge = FittedModel(replace(GIVEN, base_drag=0.4), 0.01, False)
    monkeypatch.setattr(resistance, "power_gap", lambda *_: 0.45)
    monkeypatch.setattr(resistance, "compare_models", lambda _, __, rivals, ___: [edge] * len(rivals))
    assert find_unstated(frames[2], GIVEN, ["base_friction"]) == GIVEN
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == ""


@pytest.mark.parametrize(
    ("before", "gap", "named"), [(0.45, 0.1, True), (0.05, 0.029, False), (0.9, 0.3, False), (0.45, 0.3, False)]
)
def test_a_gap_must_fall_by_enough_and_to_little(frames, monkeypatch, before, gap, named):
    found = FittedModel(replace(GIVEN, friction=0.5), gap, True)
    monkeypatch.setattr(resistance, "power_gap", lambda *_: before)
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda _, given, rivals, __: [
            found if each == resistance.RIVALS["friction"] else FittedModel(given, before, True) for each in rivals
        ],
    )
    named_now = find_resistance(frames[2], GIVEN)
    assert named_now is not None
    assert named_now.cause == ("friction" if named else "")


def test_walls_need_contacts_and_a_friction_limits(frames, monkeypatch):
    monkeypatch.setattr(resistance, "power_gap", lambda *_: 0.45)
    compared_sets = []

    def fitted(_, given, rivals, __):
        compared_sets.append(set(rivals))
        return [FittedModel(replace(given, friction=0.8), 0.1, True)] * len(rivals)

    monkeypatch.setattr(resistance, "compare_models", fitted)
    walls = np.mean([each.contacts.with_wall.sum() for each in frames[2]])
    for least, compared in ((walls, True), (walls + 1.0, False)):
        monkeypatch.setattr(resistance, "LEAST_WALLS", least)
        find_resistance(frames[2], GIVEN)
        assert (resistance.RIVALS["wall_friction"] in compared_sets[-1]) == compared
    only = {"friction": 0.1}
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda _, given, rivals, __: [
            FittedModel(replace(given, friction=0.8), only.get(name, 0.45), True)
            for name, free in (*resistance.RIVALS.items(), ("rolling", ("rolling",)))
            if free in rivals
        ],
    )
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == ""  # more than three times the given friction explains any sliding


def test_nothing_is_compared_without_friction_or_with_too_few_photographs():
    packing, snapshots = sheared_frames(6)
    settings = ContactProbabilitySettings(1e-6)
    smooth = replace(packing, material=replace(packing.material, wall_friction=0.0))
    assert find_in_sequence(smooth, snapshots, 1, settings) is None
    assert find_in_sequence(packing, snapshots, 4, settings) is None


def test_a_motion_that_fits_in_reverse_order_is_named_first(frames, monkeypatch):
    gaps = iter([1.2, 0.1])
    monkeypatch.setattr(resistance, "power_gap", lambda *_: next(gaps))
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == "photographs_reversed"


@pytest.mark.parametrize(("friction", "cause"), [(1.1, "photographs_reversed"), (0.6, "friction")])
def test_no_rods_have_the_friction_that_a_reversed_motion_shows(frames, monkeypatch, friction, cause):
    gaps = iter([0.6, 0.28])  # of the given motion, and of the reversed one: too much to be named by itself
    monkeypatch.setattr(resistance, "power_gap", lambda *_: next(gaps))
    rough = FittedModel(replace(GIVEN, friction=friction), 0.06, True)
    none = FittedModel(GIVEN, 0.6, False)
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda frames, given, rivals, workers: [rough if each == ("all_friction",) else none for each in rivals],
    )
    found = find_resistance(frames[2], replace(GIVEN, friction=0.4))
    assert found is not None
    assert found.cause == cause


@pytest.mark.parametrize(("turned", "cause"), [(0.3, "photographs_reversed"), (0.4, "")])
def test_a_reversed_motion_that_leaves_much_of_the_gap_explains_nothing(frames, monkeypatch, turned, cause):
    gaps = iter([1.0, turned])
    monkeypatch.setattr(resistance, "power_gap", lambda *_: next(gaps))
    none = FittedModel(GIVEN, 1.0, False)
    monkeypatch.setattr(resistance, "compare_models", lambda frames, given, rivals, workers: [none] * len(rivals))
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == cause


def test_a_gap_that_is_nothing_in_either_order_names_no_order(frames, monkeypatch):
    gaps = iter([0.004, 0.001])
    monkeypatch.setattr(resistance, "power_gap", lambda *_: next(gaps))
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda frames, given, rivals, workers: [FittedModel(given, 0.004, True)] * len(rivals),
    )
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == ""


@pytest.mark.parametrize("material", [{"friction": 0.0}, {"wall_friction": 0.0}])
def test_without_friction_nothing_is_compared(material, monkeypatch):
    packing, snapshots = sheared_frames(8)
    monkeypatch.setattr(resistance, "resisted_frames", lambda *_: pytest.fail("it was compared"))
    smooth = replace(packing, material=replace(packing.material, **material))
    assert find_in_sequence(smooth, snapshots, 1, ContactProbabilitySettings(1e-6)) is None
