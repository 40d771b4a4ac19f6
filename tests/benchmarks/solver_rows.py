"""Ratios of the solver's processor time to references, in alternate rounds in one process."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from rodsight.solver.convex.interior_point import solve_program
from rodsight.solver.nlgs.problem import ContactProblem
from rodsight.solver.nlgs.solve import NlgsSettings, Sweep, solve
from rodsight.solver.nlgs.sweep_record import MEASURED

from tests.benchmarks.static_problems import StaticPacking, jammed_packing, static_problem
from tests.benchmarks.test_convex_benchmark import SETTINGS, member_of, sliding_frame
from tests.benchmarks.test_solver_benchmark import LOOSE, plain_sweeps_of, solver_sweeps
from tests.benchmarks.timing import Row, duration_ratios, in_processor_time, time_alternately, time_rounds
from tests.reference.twins.convex_program import solve_with_clarabel

JAMMED = 10_000  # grains; beyond, sweeps alone are timed
WORK = 2e6  # contacts times sweeps of a round
MEASURED_SWEEPS = 1000


def sweep_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    for count in sizes:
        case = jammed_packing(count) if count <= JAMMED else jammed_packing(count, rest=LOOSE)
        problem = static_problem(case)
        yield _sweeps(case, problem)
        if count <= JAMMED:
            yield from _residuals(case, problem)


def load_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    aims = {1000: "≤ 10 ms", 10_000: "≤ .3 s"}
    settings = NlgsSettings(sweeps=100_000, natural_map=1e-8, acceleration=8)
    for count in sizes:
        durations = time_rounds(partial(solve, static_problem(jammed_packing(count)), settings, every=20), 3)
        yield in_processor_time(f"static load to a natural map of 1e-8, {count} grains", durations, aims.get(count, ""))


def member_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    aims = {1000: "≤ 6 ms", 5000: "≤ 70 ms"}
    for count in sizes:
        frame = sliding_frame(count)
        balance = frame.balance
        centre = solve_program(balance.grains, member_of(balance, 0.9 * frame.slip), SETTINGS.tolerance).force
        program = member_of(balance, frame.slip, centre)
        functions = {
            "ours": partial(solve_program, balance.grains, program, SETTINGS.tolerance),
            "clarabel": partial(solve_with_clarabel, balance.matrix, balance.load, program, SETTINGS.tolerance),
        }
        times = time_alternately(functions, 3)
        ours, theirs = min(times["ours"]), min(times["clarabel"])
        yield Row(
            f"a convex member, {count} grains",
            f"**{ours / theirs:.3f}** of Clarabel: {1e3 * ours:.1f} against {1e3 * theirs:.0f} ms",
            aims.get(count, ""), duration_ratios(times["ours"], times["clarabel"]), "of Clarabel",
        )  # fmt: skip


def _sweeps(case: StaticPacking, problem: ContactProblem) -> Row:
    count, contacts = case.grains.count, case.contacts.count
    sweeps = max(1, round(WORK / contacts))
    functions = {"ours": solver_sweeps(problem), "plain": plain_sweeps_of(case, np.arange(contacts))}
    times = time_alternately({name: partial(function, sweeps) for name, function in functions.items()}, 9)
    ours, plain = (1e9 * min(times[name]) / sweeps / contacts for name in functions)
    text = f"**{ours / plain:.2f}** of a plain numba kernel: {ours:.1f} against {plain:.1f} ns per contact and sweep"
    ratio = duration_ratios(times["ours"], times["plain"])
    return Row(f"Gauss-Seidel, {count} grains, {contacts} contacts", text, "≤ .25", ratio, "of a plain kernel")


def _residuals(case: StaticPacking, problem: ContactProblem) -> Iterator[Row]:
    settings = NlgsSettings(sweeps=MEASURED_SWEEPS)
    whole = partial(solve, problem, settings, observer=_ignore, every=MEASURED_SWEEPS)
    functions = {
        "plain": partial(solve, problem, settings),
        "every": partial(whole, measured=MEASURED["all"]),
        "log": partial(whole, measured=MEASURED["log"]),
    }
    times = time_alternately(functions)
    for name, words in (
        ("every", "exact residuals of every sweep"),
        ("log", f"exact residuals of one sweep in {MEASURED['log']}, as a run stores them"),
    ):
        text = f"**{min(times[name]) / min(times['plain']) - 1.0:+.0%}** of the sweeps themselves"
        more = tuple(ratio - 1.0 for ratio in duration_ratios(times[name], times["plain"]))
        yield Row(f"{words}, {case.grains.count} grains", text, "≤ +30 %", more, "of the sweeps")


def _ignore(sweep: Sweep) -> None:
    """Observe a sweep without any work."""
