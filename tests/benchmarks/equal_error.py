"""Convex members beside SCS and Clarabel at equal error, in alternate rounds in one process.

A tolerance means something else to every solver. Each is therefore run with the loosest tolerance whose forces differ
from the exact ones by no more than the forces that it is compared with.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.convex.interior_point import solve_program

from tests.benchmarks.test_convex_benchmark import SETTINGS, member_of, sliding_frame
from tests.benchmarks.timing import Row, duration_ratios, time_alternately
from tests.reference.twins.convex_program import solve_with_clarabel, solve_with_scs

EXACT = 1e-12  # tolerance of the forces that count as exact
TOLERANCES = 10.0 ** -np.arange(1.0, 11.5, 0.5)  # loosest first
OURS = 10.0 ** -np.arange(2.0, 12.5, 0.5)
ERRORS = (None, 1e-6)  # relative, of f: that of a member in a run, and a small one
ROUNDS = 3


def equal_error_rows(sizes: tuple[int, ...]) -> Iterator[Row]:
    """Yield rows of our time over theirs where ‖f − f*‖ / ‖f*‖ is the same."""
    for count in sizes:
        frame = sliding_frame(count)
        balance = frame.balance
        centre = solve_program(balance.grains, member_of(balance, 0.9 * frame.slip), SETTINGS.tolerance).force
        program = member_of(balance, frame.slip, centre)
        stated = balance.matrix, balance.load, program
        exact = solve_with_clarabel(*stated, EXACT)

        def ours(tolerance: float, balance=balance, program=program) -> Array:  # type: ignore[no-untyped-def]
            return solve_program(balance.grains, program, tolerance).force

        others: dict[str, Callable[[float], Array]] = {"Clarabel": partial(solve_with_clarabel, *stated)}
        if importlib.util.find_spec("scs") is not None:
            others["SCS"] = partial(solve_with_scs, *stated)
        for wanted in ERRORS:
            own = SETTINGS.tolerance if wanted is None else _loosest(ours, OURS, exact, wanted)
            if own is None:
                continue
            limit = _error(ours(own), exact)
            for name, solve in others.items():
                found = _loosest(solve, TOLERANCES, exact, limit)
                if found is None:
                    yield Row(f"a convex member, {count} grains, beside {name}", f"{name} does not reach {limit:.1e}")
                    continue
                error = _error(solve(found), exact)
                times = time_alternately({"ours": partial(ours, own), "theirs": partial(solve, found)}, ROUNDS)
                mine, theirs = min(times["ours"]), min(times["theirs"])
                yield Row(
                    f"a convex member, {count} grains, error {limit:.1e}; {name} {error:.1e}",
                    f"**{mine / theirs:.3f}** of {name}: {1e3 * mine:.1f} against {1e3 * theirs:.0f} ms", "",
                    duration_ratios(times["ours"], times["theirs"]), f"of {name}",
                )  # fmt: skip


def _loosest(solve: Callable[[float], Array], tolerances: Array, exact: Array, error: float) -> float | None:
    """Return the loosest tolerance with at most this error; None: none, or the solver gives up before."""
    for tolerance in tolerances.tolist():
        try:
            if _error(solve(tolerance), exact) <= error:
                return tolerance
        except AssertionError:
            return None
    return None


def _error(force: Array, exact: Array) -> float:
    return float(np.linalg.norm(force - exact) / np.linalg.norm(exact))
