"""The interior point over grains against Clarabel, where it is used and where a program is out of the ordinary."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.convex import interior_point
from solver.convex.friction_check import _sliding_frame
from solver.convex.interior_point import Ending, solve_program
from solver.convex.interior_point_kernels import Program
from solver.convex.program import Balance, ConvexSettings, assemble_balance
from solver.detection.touch_probability import ContactProbabilitySettings
from tests.golden.forces import packing_of, stored_poses
from tests.reference.twins.convex_program import solve_plainly
from tests.reference.twins.packing import LOST, make_case

SAME = 1e-3  # of the field
UNIT = 20.0  # [N]
SETTINGS = ConvexSettings()
CASE = make_case()
C = CASE.contacts.count
NAN = np.nan


@dataclass(frozen=True)
class Situation:
    """What is told of the packing, and what the motion shows."""

    load: tuple[float, float, float, float] = (NAN, NAN, 50.0, NAN)  # [N] of floor, right, top and left wall
    gravity: tuple[float, float] = (0.0, 0.0)
    wall_total: float | None = None
    friction: float = 0.3
    wall_friction: float = 0.15
    kept: tuple[int, int, int] = (0, C, 1)  # of the contacts: first, end, step
    impossible: float = 0.0  # share of the contacts that cannot touch
    slip: float = 0.5
    former: float = 0.0  # mean of the former forces, in units


SITUATIONS = {
    "a plate": Situation(),
    "a plate, former forces": Situation(former=1.0),
    "a plate, former forces far too great": Situation(former=30.0),
    "weight without a plate": Situation((NAN,) * 4, (0.7, -9.81)),
    "the total of the walls": Situation((NAN,) * 4, wall_total=600.0),
    "two plates": Situation((NAN, 40.0, 50.0, NAN)),
    "four plates, weight and a total": Situation((60.0, 40.0, 50.0, 40.0), (0.0, -9.81), wall_total=500.0),
    "no load on the plate": Situation((NAN, NAN, 0.0, NAN)),
    "a heavy plate": Situation((NAN, NAN, 5e3, NAN)),
    "contacts that cannot touch": Situation(impossible=0.2, former=1.0),
    "no contact can touch": Situation(impossible=1.0),
    "one contact": Situation(kept=(0, 1, 1)),
    "three contacts": Situation(kept=(0, 3, 1)),
    "two rows, weight and a total": Situation(
        (NAN, NAN, 50.0, NAN), (0.7, -9.81), 500.0, kept=(0, 60, 1), impossible=0.1, former=1.0
    ),
    "grains without contacts": Situation(kept=(C // 2, C, 1)),
    "every third contact": Situation(kept=(0, C, 3), former=1.0),
    "smooth walls": Situation(wall_friction=0.0, former=1.0),
    "nearly smooth walls": Situation(wall_friction=1e-3),
    "nothing rubs": Situation(friction=0.0, wall_friction=0.0),
    "much friction": Situation(friction=1.8, wall_friction=0.9),
    "little friction": Situation(friction=0.02, wall_friction=0.01),
    "nothing slides": Situation(slip=0.0),
    "much slides": Situation(slip=10.0),
}


def contacts_of(told: Situation) -> Contacts:
    keep = np.zeros(C, bool)
    keep[slice(*told.kept)] = True
    return CASE.contacts.select(keep)


def balance_of(told: Situation, contacts: Contacts) -> Balance:
    walls = Walls(CASE.walls.endpoints, CASE.walls.velocity, np.array(told.load))
    return assemble_balance(
        contacts, CASE.grains, walls, present=CASE.motion.present, gravity=told.gravity, force_unit=UNIT,
        friction=np.where(contacts.with_wall, told.wall_friction, told.friction), wall_normal_total=told.wall_total,
    )  # fmt: skip


def program_of(told: Situation, balance: Balance) -> Program:
    rng, c = np.random.default_rng(8), balance.contact_count
    slip = told.slip * rng.normal(size=c)
    cost = np.column_stack([balance.friction * np.abs(slip), slip])
    cost[rng.random(c) < told.impossible, 0] += 100.0 * SETTINGS.doubt
    fn = told.former * np.maximum(rng.normal(1.0, 1.0, c), 0.0)
    centre = np.column_stack([fn, balance.friction * rng.uniform(-1.0, 1.0, c) * fn])
    return Program(balance.friction, cost, centre, SETTINGS.history, SETTINGS.balance)


def compare(balance: Balance, program: Program) -> None:
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    expected = solve_plainly(balance.matrix, balance.load, program)
    assert found.ending is Ending.SOLVED
    assert np.all(found.force[:, 0] >= 0.0)
    assert np.all(np.abs(found.force[:, 1]) <= program.friction * found.force[:, 0])
    # A field of nothing is compared with a unit of force.
    size = max(np.linalg.norm(expected), 1.0)
    assert np.linalg.norm(found.force - expected) < SAME * size


def is_small(name: str) -> bool:
    return len(range(*SITUATIONS[name].kept)) <= 60


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.unit) if is_small(name) else name for name in SITUATIONS]
)
def test_forces_are_those_of_a_general_solver(name: str):
    told = SITUATIONS[name]
    balance = balance_of(told, contacts_of(told))
    program = program_of(told, balance)
    compare(balance, program)
    compare(balance, program._replace(cost=np.zeros_like(program.cost), pull=SETTINGS.polish))


def test_the_packing_has_what_makes_programs_difficult():
    """Lost grains, grains without contacts, rows of walls that fill more than one node."""
    balance = balance_of(SITUATIONS["four plates, weight and a total"], CASE.contacts)
    assert balance.grains.node_count == CASE.grains.count - len(LOST) + 2
    few = contacts_of(SITUATIONS["grains without contacts"])
    assert len(np.unique(np.append(few.i, few.j))) < CASE.grains.count - len(LOST) - 10
    assert np.diff(balance.grains.leg_start).max() == 3


@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_forces_are_the_same_at_the_frames_of_a_simulation(k: int, factor: float):
    packing, snapshots = packing_of(stored_poses())
    frame = _sliding_frame(packing, snapshots, k, UNIT, ContactProbabilitySettings(overlap=5e-6))
    balance = replace(frame.balance, friction=factor * frame.balance.friction)
    cost = np.column_stack([balance.friction * np.abs(frame.slip), frame.slip])
    program = Program(balance.friction, cost, np.zeros_like(cost), SETTINGS.history, SETTINGS.balance)
    compare(balance, program)


def small_program() -> tuple[Balance, Program]:
    told = SITUATIONS["two rows, weight and a total"]
    balance = balance_of(told, contacts_of(told))
    return balance, program_of(told, balance)


@pytest.mark.unit
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.filterwarnings("ignore:(overflow|invalid value):RuntimeWarning")  # where nothing is compiled
def test_what_is_no_number_is_not_called_solved(wrong: float):
    balance, program = small_program()
    program.centre[3, 0] = wrong
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.ending is Ending.BROKEN
    assert not found.ending.usable


@pytest.mark.unit
def test_what_takes_too_long_is_not_called_solved(monkeypatch: pytest.MonkeyPatch):
    balance, program = small_program()
    monkeypatch.setattr(interior_point, "STEPS", 0)
    monkeypatch.setattr(interior_point, "PRODUCT", 1e-5)  # so that balance alone is wanting
    found = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.ending is Ending.UNFINISHED
    assert np.isfinite(found.force).all()


@pytest.mark.unit
@pytest.mark.filterwarnings("ignore:(overflow|divide|invalid value):RuntimeWarning")  # where nothing is compiled
def test_beyond_rounding_the_best_is_kept_and_said_to_be_so():
    balance, program = small_program()
    found = solve_program(balance.grains, program, 0.0)
    exact = solve_program(balance.grains, program, SETTINGS.tolerance)
    assert found.ending is Ending.NEARLY
    assert np.linalg.norm(found.force - exact.force) < SAME * np.linalg.norm(exact.force)
