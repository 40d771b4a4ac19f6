"""The interior-point method against Clarabel, on ordinary and on extreme programs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.convex import interior_point
from rodsight.solver.convex.friction_check import sliding_frame
from rodsight.solver.convex.interior_point import Termination, solve_program
from rodsight.solver.convex.interior_point_kernels import Program
from rodsight.solver.convex.program import Balance, ConvexSettings, LoadScale, assemble_balance
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings

from tests.golden.forces import packing_of, stored_poses
from tests.reference.twins.convex_program import solve_with_clarabel
from tests.reference.twins.packing import LOST, make_case

SAME = 1e-3  # of the field
UNIT = 20.0  # [N]
SETTINGS = ConvexSettings()
CASE = make_case()
C = CASE.contacts.count
NAN = np.nan


@dataclass(frozen=True)
class Situation:
    """Loads, friction, contacts and slip of a test program."""

    load: tuple[float, float, float, float] = (NAN, NAN, 50.0, NAN)  # [N] of floor, right, top and left wall
    gravity: tuple[float, float] = (0.0, 0.0)
    wall_total: float | None = None
    friction: float = 0.3
    wall_friction: float = 0.15
    kept: tuple[int, int, int] = (0, C, 1)  # contacts: first, end, step
    impossible: float = 0.0  # fraction of the contacts that cannot touch
    slip: float = 0.5
    previous: float = 0.0  # mean of the previous forces, in units


SITUATIONS = {
    "a plate": Situation(),
    "a plate, previous forces": Situation(previous=1.0),
    "a plate, previous forces far too great": Situation(previous=30.0),
    "weight without a plate": Situation((NAN,) * 4, (0.7, -9.81)),
    "the total of the walls": Situation((NAN,) * 4, wall_total=600.0),
    "two plates": Situation((NAN, 40.0, 50.0, NAN)),
    "four plates, weight and a total": Situation((60.0, 40.0, 50.0, 40.0), (0.0, -9.81), wall_total=500.0),
    "no load on the plate": Situation((NAN, NAN, 0.0, NAN)),
    "a heavy plate": Situation((NAN, NAN, 5e3, NAN)),
    "contacts that cannot touch": Situation(impossible=0.2, previous=1.0),
    "no contact can touch": Situation(impossible=1.0),
    "one contact": Situation(kept=(0, 1, 1)),
    "three contacts": Situation(kept=(0, 3, 1)),
    "two rows, weight and a total": Situation(
        (NAN, NAN, 50.0, NAN), (0.7, -9.81), 500.0, kept=(0, 60, 1), impossible=0.1, previous=1.0
    ),
    "grains without contacts": Situation(kept=(C // 2, C, 1)),
    "every third contact": Situation(kept=(0, C, 3), previous=1.0),
    "smooth walls": Situation(wall_friction=0.0, previous=1.0),
    "nearly smooth walls": Situation(wall_friction=1e-3),
    "no friction": Situation(friction=0.0, wall_friction=0.0),
    "much friction": Situation(friction=1.8, wall_friction=0.9),
    "little friction": Situation(friction=0.02, wall_friction=0.01),
    "no slip": Situation(slip=0.0),
    "large slip": Situation(slip=10.0),
}


def contacts_of(situation: Situation) -> Contacts:
    keep = np.zeros(C, bool)
    keep[slice(*situation.kept)] = True
    return CASE.contacts.select(keep)


def balance_of(situation: Situation, contacts: Contacts) -> Balance:
    plate = CASE.walls.plate if np.isfinite(situation.load[2]) else None  # a disc is fixed to the wall on top
    walls = replace(CASE.walls, load=np.append(situation.load, NAN), plate=plate)
    return assemble_balance(
        contacts, CASE.grains, walls, present=CASE.motion.present,
        scale=LoadScale(UNIT, situation.gravity, situation.wall_total),
        friction=np.where(contacts.with_wall, situation.wall_friction, situation.friction),
    )  # fmt: skip


def program_of(situation: Situation, balance: Balance) -> Program:
    rng, c = np.random.default_rng(8), balance.contact_count
    slip = situation.slip * rng.normal(size=c)
    cost = np.column_stack([balance.friction * np.abs(slip), slip])
    cost[rng.random(c) < situation.impossible, 0] += 100.0 * SETTINGS.ambiguity_penalty
    fn = situation.previous * np.maximum(rng.normal(1.0, 1.0, c), 0.0)
    centre = np.column_stack([fn, balance.friction * rng.uniform(-1.0, 1.0, c) * fn])
    return Program(balance.friction, cost, centre, SETTINGS.history, SETTINGS.balance)


def compare(balance: Balance, program: Program) -> None:
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    expected = solve_with_clarabel(balance.matrix, balance.load, program)
    assert found.termination is Termination.SOLVED
    assert np.all(found.force[:, 0] >= 0.0)
    assert np.all(np.abs(found.force[:, 1]) <= program.friction * found.force[:, 0])
    # A zero field is compared with a unit of force.
    size = max(np.linalg.norm(expected), 1.0)
    assert np.linalg.norm(found.force - expected) < SAME * size


def is_small(name: str) -> bool:
    return len(range(*SITUATIONS[name].kept)) <= 60


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.unit) if is_small(name) else name for name in SITUATIONS]
)
def test_forces_are_those_of_a_general_solver(name: str):
    situation = SITUATIONS[name]
    balance = balance_of(situation, contacts_of(situation))
    program = program_of(situation, balance)
    compare(balance, program)
    compare(balance, program._replace(cost=np.zeros_like(program.cost), proximal_weight=SETTINGS.projection_weight))


def test_the_packing_has_what_makes_programs_difficult():
    """Lost grains, grains without contacts, rows of walls in more than one node."""
    balance = balance_of(SITUATIONS["four plates, weight and a total"], CASE.contacts)
    assert balance.grains.node_count == CASE.grains.count - len(LOST) + 2
    few = contacts_of(SITUATIONS["grains without contacts"])
    assert len(np.unique(np.append(few.i, few.j))) < CASE.grains.count - len(LOST) - 10
    assert np.diff(balance.grains.jacobian_start).max() == 3


@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_forces_are_the_same_at_the_frames_of_a_simulation(k: int, factor: float):
    packing, snapshots = packing_of(stored_poses())
    frame = sliding_frame(packing.at_frame(snapshots, k), snapshots, k, ContactProbabilitySettings(overlap=5e-6))
    balance = replace(frame.balance, friction=factor * frame.balance.friction)
    cost = np.column_stack([balance.friction * np.abs(frame.slip), frame.slip])
    program = Program(balance.friction, cost, np.zeros_like(cost), SETTINGS.history, SETTINGS.balance)
    compare(balance, program)


def small_program() -> tuple[Balance, Program]:
    situation = SITUATIONS["two rows, weight and a total"]
    balance = balance_of(situation, contacts_of(situation))
    return balance, program_of(situation, balance)


@pytest.mark.unit
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:(overflow|invalid value):RuntimeWarning")  # without compilation
def test_nan_is_not_reported_as_solved(wrong: float):
    balance, program = small_program()
    program.centre[3, 0] = wrong
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.termination is Termination.BREAKDOWN
    assert not found.termination.usable


@pytest.mark.unit
def test_too_many_steps_are_not_reported_as_solved(monkeypatch: pytest.MonkeyPatch):
    balance, program = small_program()
    monkeypatch.setattr(interior_point, "MAX_STEPS", 0)
    monkeypatch.setattr(interior_point, "START_PRODUCT", 1e-5)  # so that only equilibrium is violated
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.termination is Termination.UNFINISHED
    assert np.isfinite(found.force).all()


@pytest.mark.unit
@pytest.mark.filterwarnings("ignore:(overflow|divide|invalid value):RuntimeWarning")  # without compilation
def test_beyond_rounding_the_best_iterate_is_kept_and_reported():
    balance, program = small_program()
    found = solve_program(balance.grains, program, 0.0)
    exact = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.termination is Termination.NEARLY
    assert np.linalg.norm(found.force - exact.force) < SAME * np.linalg.norm(exact.force)
