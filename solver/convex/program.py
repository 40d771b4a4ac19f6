"""Forces in equilibrium that spend the least against the measured sliding: a convex program.

Where two bodies slide, Coulomb's law fixes friction: f_t = −μ f_n sign(u_t), and then f_n μ|u_t| + f_t u_t = 0; for
every other admissible force it is positive. Minimising the sum of it over all force sets in equilibrium
reads the forces from the motion of one interval, without any mass or stiffness:

    minimise  Σ f_n [μ|û_t| + doubt · max(0, −ln 2P)] + f_t û_t + λ/2 |f − f_previous|² + ρ/2 |H f − b|²
    where     |f_t| ≤ μ f_n,    û_t = soft(u_t / s, noise)

All forces inside are in units of `force_unit`, torques over the mean radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from solver.bodies.grains import Array, Grains
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.contacts.kinematics import equilibrium_matrix, external_load
from solver.convex.grain_blocks import GrainBlocks, block_balance
from solver.convex.interior_point import solve_program
from solver.convex.interior_point_kernels import Program

SLIP_SIGMAS = 2.8  # noise of u_t in standard deviations of a position: two grains that move and turn, two photographs


@dataclass(frozen=True, slots=True)
class ConvexSettings:
    """Weights of the program, all without dimension."""

    history: float = 3e-3  # λ, pull towards the previous forces
    balance: float = 1e3  # ρ, price of an unbalance
    doubt: float = 0.3  # price of force on a contact that may not exist
    slip_noise: float = 1.5 * SLIP_SIGMAS  # [σ] a slip below this is taken as none
    polish: float = 0.5  # λ of the polish
    tolerance: float = 3e-8  # of the interior point; leaves forces wrong by less than a thousandth


@dataclass(frozen=True, slots=True)
class Balance:
    """The equilibrium H f = b of one frame and its friction, without dimension."""

    matrix: sparse.csr_matrix  # (m, 2c)
    load: Array  # (m,)
    friction: Array  # (c,)
    force_unit: float  # [N]
    grains: GrainBlocks  # the same equilibrium grain by grain; whatever the friction

    @property
    def contact_count(self) -> int:
        return len(self.friction)


@dataclass(frozen=True, slots=True)
class ConvexForces:
    """Forces of one program and how its solve ended."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    iterations: int
    converged: bool
    ending: str  # in words


def assemble_balance(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    *,
    present: NDArray[np.bool_],
    friction: Array,
    force_unit: float,
    gravity: tuple[float, float] = (0.0, 0.0),
    wall_normal_total: float | None = None,
) -> Balance:
    """Assemble the balance of every present grain and of every plate under load.

    present (n,); friction (c,); force_unit [N], a typical contact force. Without a plate under load (and
    without weight) the forces are known up to a factor only, and zero would be the answer: `wall_normal_total` [N] then
    fixes the sum of f_n over all contacts with walls, or over all where there are no walls. Boundary grains are in no
    balance. Errors: ValueError if neither is there.
    """
    n, present = grains.count, present & grains.free
    if not walls.loaded.any() and wall_normal_total is None and not any(gravity):
        raise ValueError("no wall carries a load: wall_normal_total must fix the scale of the forces")
    matrix = equilibrium_matrix(contacts, grains.radius, walls)
    load = external_load(grains.mass, walls, gravity)
    weight = np.full(len(load), 1.0 / force_unit)
    weight[2 * n : 3 * n] /= grains.radius[present].mean() if present.any() else 1.0
    # The matrix acts on forces that are already in force_unit; only b still needs it.
    matrix = sparse.diags_array(weight * force_unit) @ matrix
    load = weight * load
    rows = np.concatenate([np.tile(present, 3), np.ones(len(load) - 3 * n, dtype=bool)])
    matrix, load = matrix[rows], load[rows]
    if wall_normal_total is not None:
        total = np.concatenate([contacts.gauge.astype(np.float64), np.zeros(contacts.count)])
        matrix = sparse.vstack([matrix, sparse.csr_matrix(total[None])])
        load = np.append(load, wall_normal_total / force_unit)
    matrix = sparse.csr_matrix(matrix)
    blocks = block_balance(matrix, load, int(present.sum()), contacts.count)
    return Balance(matrix, load, np.asarray(friction, dtype=np.float64), force_unit, blocks)


def soft_slip(ut: Array, scale: float, sigma: Array | float, settings: ConvexSettings | None = None) -> Array:
    """Give û_t (c,): the measured sliding over `scale` [m], shrunk towards zero by its noise.

    ut (c,) [m], NaN where unknown: such a contact tells nothing; sigma [m], standard deviation of a position component,
    (c,) or one number.
    """
    settings = settings or ConvexSettings()
    slip = np.nan_to_num(np.asarray(ut, dtype=np.float64), nan=0.0)
    return np.sign(slip) * np.maximum(np.abs(slip) - settings.slip_noise * sigma, 0.0) / scale


def solve_member(
    balance: Balance,
    slip: Array,
    probability: Array,
    previous_fn: Array,
    previous_ft: Array,
    settings: ConvexSettings | None = None,
) -> ConvexForces:
    """Solve the program for one interval's motion.

    slip (c,), of `soft_slip`; probability (c,), P(touch), 1 where sure; previous_fn, previous_ft (c,) [N], the former
    forces of this same member on today's contacts, zero where new.
    """
    settings = settings or ConvexSettings()
    with np.errstate(divide="ignore"):
        doubt = np.maximum(0.0, -np.log(2.0 * probability))
    cost = np.concatenate([balance.friction * np.abs(slip) + settings.doubt * np.minimum(doubt, 100.0), slip])
    return _solve(balance, cost, previous_fn, previous_ft, settings.history, settings)


def polish(balance: Balance, mean_fn: Array, mean_ft: Array, settings: ConvexSettings | None = None) -> ConvexForces:
    """Bring a mean of fields (c,) [N] into balance with the least change, inside the Coulomb cone."""
    settings = settings or ConvexSettings()
    cost = np.zeros(2 * balance.contact_count)
    return _solve(balance, cost, mean_fn, mean_ft, settings.polish, settings)


def _solve(
    balance: Balance, cost: Array, centre_fn: Array, centre_ft: Array, pull: float, settings: ConvexSettings
) -> ConvexForces:
    """Minimise cost·f + pull/2 |f − centre|² + ρ/2 |H f − b|² over the Coulomb cones."""
    c = balance.contact_count
    if c == 0:
        return ConvexForces(np.empty(0), np.empty(0), 0, True, "no contacts")
    program = Program(
        balance.friction, np.ascontiguousarray(cost.reshape(2, c).T),
        np.column_stack([centre_fn, centre_ft]) / balance.force_unit, pull, settings.balance,
    )  # fmt: skip
    found = solve_program(balance.grains, program, settings.tolerance)
    force = found.force * balance.force_unit
    return ConvexForces(force[:, 0], force[:, 1], found.steps, found.ending.usable, found.ending.value)
