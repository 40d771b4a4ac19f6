"""What resists sliding is found by the power gap, and named only where it clearly explains the motion."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.convex import resistance
from rodsight.solver.convex.resistance import base_drag_of, find_resistance, find_unstated, model_of, resisted_frames
from rodsight.solver.convex.sliding_model import FittedModel, SlidingModel, fit_model, power_gap
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.solver.nlgs.chain import ChainSettings, force_scale

from tests.solver.sequence.test_frames import sheared_frames

GIVEN = SlidingModel(0.25, 0.25)


@pytest.fixture(scope="module")
def frames():
    packing, snapshots = sheared_frames(6)
    unit = force_scale(packing, ChainSettings())
    return packing, unit, resisted_frames(packing, snapshots, range(1, 4), unit, ContactProbabilitySettings(1e-6))


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


def test_the_base_drags_against_the_motion(frames):
    packing, unit, (frame, *_) = frames
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
    assert base_drag_of(packing, model_of(replace(packing, material=material), unit), unit) == pytest.approx(3.0)


def test_a_reversed_motion_has_another_gap(frames):
    rng = np.random.default_rng(2)
    some = [replace(each, slip=rng.normal(size=len(each.slip))) for each in frames[2]]
    there, back = power_gap(some, GIVEN), power_gap([each.reversed() for each in some], GIVEN)
    assert there != pytest.approx(back)
    assert power_gap([each.reversed().reversed() for each in some], GIVEN) == there


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


GAPS = {"friction": 0.4, "wall_friction": 0.4, "base_friction": 0.4, "adhesion": 0.4}


@pytest.mark.parametrize(
    ("gaps", "cause"),
    [
        ({}, ""),
        ({"friction": 0.1, "wall_friction": 0.1, "base_friction": 0.1, "adhesion": 0.1}, "friction"),
        ({"wall_friction": 0.1}, "wall_friction"),
        ({"wall_friction": 0.1, "adhesion": 0.11}, ""),
        ({"base_friction": 0.3}, ""),  # a rival that leaves so much does not explain the sliding
        ({"adhesion": 0.15, "friction": 0.2}, "friction"),
    ],
)
def test_only_a_clear_winner_is_named(frames, monkeypatch, gaps, cause):
    fitted = GAPS | gaps
    monkeypatch.setattr(resistance, "power_gap", lambda *_: 0.45)
    monkeypatch.setattr(
        resistance,
        "compare_models",
        lambda frames, given, rivals, workers: [
            FittedModel(given, gap, True) for name, gap in fitted.items() if resistance.RIVALS[name] in rivals
        ],
    )
    monkeypatch.setattr(resistance, "LEAST_WALLS", 0)
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == cause


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


def test_a_motion_that_fits_in_reverse_order_is_named_first(frames, monkeypatch):
    gaps = iter([1.2, 0.1])
    monkeypatch.setattr(resistance, "power_gap", lambda *_: next(gaps))
    found = find_resistance(frames[2], GIVEN)
    assert found is not None
    assert found.cause == "photographs_reversed"
