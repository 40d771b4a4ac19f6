"""The solver beside what it is measured against: ratios of processor times, taken by turns in one process."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from solver.convex.interior_point import solve_program
from solver.nlgs.problem import ContactProblem
from solver.nlgs.solve import NlgsSettings, Sweep, solve
from tests.benchmarks.static_problems import StaticPacking, jammed_packing, static_problem
from tests.benchmarks.test_convex_benchmark import SETTINGS, member_of, sliding_frame
from tests.benchmarks.test_solver_benchmark import LOOSE, plain_turn, solver_turn
from tests.benchmarks.timing import Row, by_turns, in_processor_time, several, shares
from tests.reference.twins.convex_program import solve_plainly

JAMMED = 10_000  # grains; beyond, only sweeps are timed
WORK = 2e6  # contacts times sweeps of a turn
HEARD = 1000  # sweeps


def sweep_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    for count in sizes:
        case = jammed_packing(count) if count <= JAMMED else jammed_packing(count, rest=LOOSE)
        problem = static_problem(case)
        yield _sweeps(case, problem)
        if count <= JAMMED:
            yield _residuals(case, problem)


def load_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    aims = {1000: "≤ 10 ms", 10_000: "≤ .3 s"}
    settings = NlgsSettings(sweeps=100_000, natural_map=1e-8, acceleration=8)
    for count in sizes:
        took = several(partial(solve, static_problem(jammed_packing(count)), settings, every=20), 3)
        yield in_processor_time(f"static load to a natural map of 1e-8, {count} grains", took, aims.get(count, ""))


def member_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    aims = {1000: "≤ 6 ms", 5000: "≤ 70 ms"}
    for count in sizes:
        frame = sliding_frame(count)
        balance = frame.balance
        centre = solve_program(balance.grains, member_of(balance, 0.9 * frame.slip), SETTINGS.tolerance).force
        program = member_of(balance, frame.slip, centre)
        ways = {
            "ours": partial(solve_program, balance.grains, program, SETTINGS.tolerance),
            "clarabel": partial(solve_plainly, balance.matrix, balance.load, program, SETTINGS.tolerance),
        }
        found = by_turns(ways, 3)
        ours, theirs = min(found["ours"]), min(found["clarabel"])
        yield Row(
            f"a convex member, {count} grains",
            f"**{ours / theirs:.3f}** of Clarabel: {1e3 * ours:.1f} against {1e3 * theirs:.0f} ms",
            aims.get(count, ""), shares(found["ours"], found["clarabel"]), "of Clarabel",
        )  # fmt: skip


def _sweeps(case: StaticPacking, problem: ContactProblem) -> Row:
    count, contacts = case.grains.count, case.contacts.count
    sweeps = max(1, round(WORK / contacts))
    ways = {"ours": solver_turn(problem), "plain": plain_turn(case, np.arange(contacts))}
    found = by_turns({name: partial(way, sweeps) for name, way in ways.items()}, 9)
    ours, plain = (1e9 * min(found[name]) / sweeps / contacts for name in ways)
    told = f"**{ours / plain:.2f}** of a plain numba kernel: {ours:.1f} against {plain:.1f} ns per contact and sweep"
    share = shares(found["ours"], found["plain"])
    return Row(f"Gauss-Seidel, {count} grains, {contacts} contacts", told, "≤ .25", share, "of a plain kernel")


def _residuals(case: StaticPacking, problem: ContactProblem) -> Row:
    settings = NlgsSettings(sweeps=HEARD)
    ways = {
        "silent": partial(solve, problem, settings),
        "heard": partial(solve, problem, settings, observer=_hear, every=HEARD, measured=True),
    }
    found = by_turns(ways)
    told = f"**{min(found['heard']) / min(found['silent']) - 1.0:+.0%}** of the sweeps themselves"
    more = tuple(share - 1.0 for share in shares(found["heard"], found["silent"]))
    return Row(f"exact residuals of every sweep, {case.grains.count} grains", told, "≤ +30 %", more, "of the sweeps")


def _hear(sweep: Sweep) -> None:
    """Nobody does anything with it."""
