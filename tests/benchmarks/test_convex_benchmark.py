"""A convex member, a refinement and a friction check beside Clarabel and banded matrices, in processor time.

pytest tests/benchmarks/test_convex_benchmark.py -o addopts= -s

The functions run in alternate rounds in one process; the fastest round of each counts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.convex.friction_estimate import FACTORS, SlidingFrame, estimate_friction
from rodsight.solver.convex.interior_point import solve_program
from rodsight.solver.convex.interior_point_kernels import Program
from rodsight.solver.convex.program import Balance, ConvexSettings, LoadScale, assemble_balance
from rodsight.solver.detection.position_network import PositionNetwork
from rodsight.solver.detection.touch_probability import TouchCandidates

from tests.benchmarks.band_network import BandNetwork
from tests.benchmarks.static_problems import FRICTION, StaticPacking, jammed_packing
from tests.reference.twins.convex_program import solve_with_clarabel

SIZES = (1000, 5000)
ROUNDS = 3
FRAMES = 2  # of a friction check
SETTINGS = ConvexSettings()
SLIP = 0.5  # [scale of the motion] of a contact at its limit
SAME = 1e-3  # relative difference of the fields
MAX_RATIO = {"member": 0.15, "refinement": 0.25, "friction check": 0.08}  # of the reference's time


@pytest.fixture(scope="module")
def table() -> Iterator[list[str]]:
    lines: list[str] = []
    yield lines
    print("\n\n" + "\n".join(sorted(lines)))


@cache
def packing(count: int) -> StaticPacking:
    return jammed_packing(count)


@cache
def sliding_frame(count: int) -> SlidingFrame:
    """The packing in equilibrium, with contacts at the Coulomb limit sliding."""
    case = packing(count)
    contacts = case.contacts
    balance = assemble_balance(
        contacts, case.grains, case.walls, present=np.ones(case.grains.count, bool),
        friction=np.full(contacts.count, FRICTION), scale=LoadScale(case.mean_force),
    )  # fmt: skip
    some = 0.3 * np.random.default_rng(1).normal(size=contacts.count)
    force = solve_program(balance.grains, member_of(balance, some), SETTINGS.tolerance).force
    at_limit = np.abs(force[:, 1]) > 0.999 * FRICTION * force[:, 0]
    slip = np.where(at_limit, -SLIP * np.sign(force[:, 1]), 0.0)
    return SlidingFrame(balance, contacts, slip, np.ones(contacts.count))


def member_of(balance: Balance, slip: Array, centre: Array | None = None) -> Program:
    cost = np.column_stack([balance.friction * np.abs(slip), slip])
    centre = np.zeros_like(cost) if centre is None else centre
    return Program(balance.friction, cost, centre, SETTINGS.history, SETTINGS.balance)


def seconds(*functions: Callable[[], object]) -> list[float]:
    """Processor time of the fastest round of each function."""
    best = [np.inf] * len(functions)
    functions[0]()  # compiled
    for _ in range(ROUNDS):
        for k, function in enumerate(functions):
            since = time.process_time()
            function()
            best[k] = min(best[k], time.process_time() - since)
    return best


def format_row(label: str, count: int, ours: float, theirs: float) -> str:
    return (
        f"{label:15s}{count:6d} grains: {1e3 * ours:8.2f} ms, reference {1e3 * theirs:9.2f} ms: "
        f"ratio {ours / theirs:.3f} (aim {MAX_RATIO[label]})"
    )


@pytest.mark.benchmark(group="member")
@pytest.mark.parametrize("count", SIZES)
def test_a_member_takes_a_fraction_of_clarabels_time(
    benchmark: Callable[..., object], table: list[str], count: int
) -> None:
    frame = sliding_frame(count)
    balance = frame.balance
    centre = solve_program(balance.grains, member_of(balance, 0.9 * frame.slip), SETTINGS.tolerance).force
    program = member_of(balance, frame.slip, centre)

    def ours() -> Array:
        return solve_program(balance.grains, program, SETTINGS.tolerance).force

    expected = solve_with_clarabel(balance.matrix, balance.load, program)
    assert np.linalg.norm(ours() - expected) < SAME * np.linalg.norm(expected)
    mine, theirs = seconds(ours, lambda: solve_with_clarabel(balance.matrix, balance.load, program, SETTINGS.tolerance))
    benchmark(ours)
    table.append(format_row("member", count, mine, theirs))
    assert mine < MAX_RATIO["member"] * theirs


@pytest.mark.benchmark(group="refinement")
@pytest.mark.parametrize("count", SIZES)
def test_a_refinement_takes_a_fraction_of_a_banded_ones_time(
    benchmark: Callable[..., object], table: list[str], count: int
) -> None:
    case = packing(count)
    contacts = case.contacts.select(~case.contacts.with_wall)
    sigma, gap = np.full(count, 1e-5), 1e-5 * np.random.default_rng(2).normal(size=contacts.count)
    weight, pull = np.full(contacts.count, 1e10), np.zeros(contacts.count)
    sparse = PositionNetwork.of(case.grains, TouchCandidates(contacts.i, contacts.j, gap[None], np.ones((1, len(gap)))))
    band = BandNetwork(count, contacts.i.astype(np.int64), contacts.j.astype(np.int64))
    found = sparse.refine(contacts.normal, gap, weight, pull, sigma)
    moved, variance = band.refine(contacts.normal, pull - weight * gap, weight, sigma)
    assert found.displacement == pytest.approx(moved, abs=1e-9 * np.abs(moved).max())
    assert found.gap_variance == pytest.approx(variance, rel=1e-9)
    mine, theirs = seconds(
        lambda: sparse.refine(contacts.normal, gap, weight, pull, sigma),
        lambda: band.refine(contacts.normal, pull - weight * gap, weight, sigma),
    )
    benchmark(sparse.refine, contacts.normal, gap, weight, pull, sigma)
    table.append(format_row("refinement", count, mine, theirs))
    assert mine < MAX_RATIO["refinement"] * theirs


@pytest.mark.benchmark(group="friction check")
def test_a_friction_check_takes_a_fraction_of_all_trials_by_clarabel(
    benchmark: Callable[..., object], table: list[str]
) -> None:
    frames = [sliding_frame(1000)] * FRAMES

    def by_clarabel() -> None:
        for factor in FACTORS:
            centre = None
            for frame in frames:
                balance = replace(frame.balance, friction=factor * frame.balance.friction)
                centre = solve_with_clarabel(
                    balance.matrix, balance.load, member_of(balance, frame.slip, centre), SETTINGS.tolerance
                )

    assert estimate_friction(frames).factor == pytest.approx(1.0, abs=0.2)
    mine, theirs = seconds(lambda: estimate_friction(frames), by_clarabel)
    benchmark(estimate_friction, frames)
    table.append(format_row("friction check", 1000, mine, theirs))
    assert mine < MAX_RATIO["friction check"] * theirs
