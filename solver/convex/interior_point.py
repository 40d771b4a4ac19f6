"""Mehrotra's predictor-corrector interior-point method for the convex program, specialised to its structure.

Every step solves for the grains' velocities v alone. The contacts are eliminated one by one in closed form, which
leaves I/ρ + H E Hᵀ, a matrix of 3 × 3 blocks between neighbours (Nocedal & Wright, Numerical Optimization, 2006,
ch. 16.6). Steps that single contacts keep short get one to three centrality corrections (Gondzio 1996) with the same
factor.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from ..bodies.grains import Array
from ..factor.blocks import TRIPLE, block_size
from ..nlgs.problem import aligned_zeros
from .grain_blocks import PADDED_ROWS, GrainBlocks
from .interior_point_kernels import CONVERGED, RESIDUAL_TOLERANCE, STEP_LIMIT, Iterate, Program, Workspace, iterate

# The previous forces are near the solution but lie on their cones; a start nearer to the boundary takes more steps.
MIN_EDGE_FORCE = 0.4  # [force units] at the start, along an edge of the cone
START_PRODUCT = 0.4  # edge force times multiplier at the start
MAX_STEPS = 60  # a dozen is usual
# Rounding may keep a program from its tolerance; above this gap, forces would be wrong by per cents.
USABLE_GAP = 1e-4  # mean product of edge force and multiplier


class Termination(Enum):
    """How the solve ended, as text for messages."""

    SOLVED = "solved"
    NEARLY = "solved, though not to the tolerance"
    UNFINISHED = f"not solved in {MAX_STEPS} steps"
    BREAKDOWN = "not solved: its numbers overflowed"

    @property
    def usable(self) -> bool:
        return self in (Termination.SOLVED, Termination.NEARLY)


class Solution(NamedTuple):
    """The best iterate of a solve."""

    force: Array  # (c, 2) f_n ≥ 0 and |f_t| ≤ μ f_n
    steps: int
    termination: Termination


def solve_program(grains: GrainBlocks, program: Program, tolerance: float) -> Solution:
    """Solve a program, starting from its centre.

    Parameters
    ----------
    grains : GrainBlocks
        H and b.
    program : Program
        Friction, cost and weights. Friction may be zero.
    tolerance : float
        Stopping level of the mean product of edge force and multiplier. Below 1e-8 rounding prevails.
    """
    current, workspace = _start(grains, program), _make_workspace(grains, len(program.friction))
    code, steps, gap, residual = iterate(grains, program, current, workspace, tolerance, MAX_STEPS)
    if code == CONVERGED:
        termination = Termination.SOLVED
    elif gap <= USABLE_GAP and residual <= RESIDUAL_TOLERANCE:
        termination = Termination.NEARLY
    else:
        termination = Termination.UNFINISHED if code == STEP_LIMIT else Termination.BREAKDOWN
    return Solution(_forces(workspace.best, program.friction), steps, termination)


def _start(grains: GrainBlocks, program: Program) -> Iterate:
    """Move the centre into the interior of the cones."""
    half, friction = 0.5 * program.centre[:, 0], program.friction
    lean = np.divide(0.5 * program.centre[:, 1], friction, out=np.zeros_like(half), where=friction > 0.0)
    edge_force = np.maximum(np.column_stack([half - lean, half + lean]), MIN_EDGE_FORCE)
    return Iterate(edge_force, START_PRODUCT / edge_force, np.zeros(PADDED_ROWS * grains.node_count))


def _forces(edge_force: Array, friction: Array) -> Array:
    fn = edge_force.sum(axis=1)
    return np.column_stack([fn, friction * np.clip(edge_force[:, 1] - edge_force[:, 0], -fn, fn)])


def _make_workspace(grains: GrainBlocks, contacts: int) -> Workspace:
    def pairs(width: int = 2) -> Array:
        return np.zeros((contacts, width))

    def velocity() -> Array:
        return np.zeros(PADDED_ROWS * grains.node_count)

    return Workspace(
        pairs(), velocity(), pairs(), pairs(3), pairs(),
        aligned_zeros((block_size(TRIPLE) * grains.pattern.entry_count,)),
        np.zeros(grains.node_count, np.int64), Iterate(pairs(), pairs(), velocity()),
        Iterate(pairs(), pairs(), velocity()), pairs(),
    )  # fmt: skip
