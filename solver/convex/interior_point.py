"""Mehrotra's predictor and corrector for a convex program, written for its structure.

Every step solves for the grains' velocities v alone: contacts are eliminated one by one, in closed form, which leaves
I/ρ + H E Hᵀ, a matrix of 3 × 3 blocks between neighbours (Nocedal & Wright, Numerical Optimization, 2006, ch. 16.6).
Steps that single contacts keep short are corrected once to three times (Gondzio 1996), with the same factor.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from solver.bodies.grains import Array
from solver.convex.grain_blocks import FILLED, GrainBlocks
from solver.convex.interior_point_kernels import ENOUGH, REACHED, RESIDUAL, Iterate, Program, Room, iterate
from solver.factor.blocks import TRIPLE, area_of
from solver.nlgs.problem import aligned_zeros

# The former forces lead near the solution but lie on their cones: from nearer to the surface it takes more steps.
LEAST_PART = 0.4  # [force units] of a force along an edge of its cone
PRODUCT = 0.4  # of part and multiplier at the start
STEPS = 60  # a dozen is usual
# Rounding may keep a program from the tolerance; above this, its forces would be wrong by per cents.
USABLE = 1e-4  # mean product of part and multiplier


class Ending(Enum):
    """How a program ended, in words."""

    SOLVED = "solved"
    NEARLY = "solved, though not to the tolerance"
    UNFINISHED = f"not solved in {STEPS} steps"
    BROKEN = "not solved: its numbers overflowed"

    @property
    def usable(self) -> bool:
        return self in (Ending.SOLVED, Ending.NEARLY)


class Solution(NamedTuple):
    """The best forces that were met."""

    force: Array  # (c, 2) f_n ≥ 0 and |f_t| ≤ μ f_n
    steps: int
    ending: Ending


def solve_program(grains: GrainBlocks, program: Program, tolerance: float) -> Solution:
    """Solve from the program's centre until the mean product of part and multiplier is below the tolerance.

    Friction may be zero. The tolerance should not be below 1e-8, where rounding prevails.
    """
    at, room = _start(grains, program), _make_room(grains, len(program.friction))
    code, steps, gap, residual = iterate(grains, program, at, room, tolerance, STEPS)
    if code == REACHED:
        ending = Ending.SOLVED
    elif gap <= USABLE and residual <= RESIDUAL:
        ending = Ending.NEARLY
    else:
        ending = Ending.UNFINISHED if code == ENOUGH else Ending.BROKEN
    return Solution(_forces(room.best, program.friction), steps, ending)


def _start(grains: GrainBlocks, program: Program) -> Iterate:
    """The centre, brought inside the cones."""
    half, friction = 0.5 * program.centre[:, 0], program.friction
    lean = np.divide(0.5 * program.centre[:, 1], friction, out=np.zeros_like(half), where=friction > 0.0)
    part = np.maximum(np.column_stack([half - lean, half + lean]), LEAST_PART)
    return Iterate(part, PRODUCT / part, np.zeros(FILLED * grains.node_count))


def _forces(part: Array, friction: Array) -> Array:
    fn = part.sum(axis=1)
    return np.column_stack([fn, friction * np.clip(part[:, 1] - part[:, 0], -fn, fn)])


def _make_room(grains: GrainBlocks, contacts: int) -> Room:
    def pairs(width: int = 2) -> Array:
        return np.zeros((contacts, width))

    def velocity() -> Array:
        return np.zeros(FILLED * grains.node_count)

    return Room(
        pairs(), velocity(), pairs(), pairs(3), pairs(), aligned_zeros((area_of(TRIPLE) * grains.pattern.entry_count,)),
        np.zeros(grains.node_count, np.int64), Iterate(pairs(), pairs(), velocity()),
        Iterate(pairs(), pairs(), velocity()), pairs(),
    )  # fmt: skip
