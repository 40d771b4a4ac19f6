"""The convex program: forces in equilibrium of least power gap against the measured sliding.

Where two bodies slide, Coulomb's law fixes friction: f_t = −μ f_n sign(u_t). Then f_n μ|u_t| + f_t u_t = 0; this term
is positive for every other admissible force. The program minimises its sum over all force sets in equilibrium and so
estimates the forces from the motion of one interval, without any mass or stiffness:

    minimise  Σ f_n [μ (1 − ν) |û_t| + ambiguity_penalty · max(0, −ln 2P)] + f_t û_t
              + λ/2 |f − f_previous|² + ρ/2 |H f − b|²
    where     |f_t| ≤ μ f_n,    û_t = soft(u_t / s, noise)

Noise makes contacts slide that stick, and others slide in the wrong direction: even the true forces then have a power
gap, and the least sum belongs to smaller forces. ν, which grows with the noise, takes that fraction of it off.

Inside, forces are in units of `force_unit` and torques are divided by the mean radius.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..bodies.grains import Array, Grains
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..contacts.kinematics import equilibrium_matrix, external_load
from ..part_settings import ConvexSettings
from .grain_blocks import GrainBlocks, block_balance
from .interior_point import solve_program
from .interior_point_kernels import Program


@dataclass(frozen=True, slots=True)
class Balance:
    """Dimensionless equilibrium H f = b of one frame, and the friction coefficients."""

    matrix: sparse.csr_matrix  # (m, 2c)
    load: Array  # (m,)
    friction: Array  # (c,)
    force_unit: float  # [N]
    grains: GrainBlocks  # H and b in blocks of three rows per grain; independent of friction

    @property
    def contact_count(self) -> int:
        return len(self.friction)


@dataclass(frozen=True, slots=True)
class ConvexForces:
    """Solution of one program, and how the solve ended."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    iterations: int
    converged: bool
    termination: str  # sentence for messages


class LoadScale(NamedTuple):
    """What sets the scale of the forces beside loaded plates."""

    force_unit: float  # [N] a typical contact force
    gravity: tuple[float, float] = (0.0, 0.0)  # [m/s²]
    # [N] Sum of f_n over all contacts with walls, or over all contacts if there are no walls. Required without a loaded
    # plate and without weight, where the forces are determined only up to a factor.
    total: float | None = None


def assemble_balance(
    contacts: Contacts,
    grains: Grains,
    walls: Walls,
    *,
    present: NDArray[np.bool_],
    friction: Array,
    scale: LoadScale,
) -> Balance:
    """Assemble the equilibrium equations of every present free grain and every loaded plate.

    Parameters
    ----------
    present : (n,)
        Grains found in the photograph.
    friction : (c,)
        Coefficient of friction of each contact.
    scale : LoadScale
        What sets the scale of the forces beside loaded plates.

    Raises
    ------
    ValueError
        If neither a load, nor gravity, nor a total fixes the scale of the forces.

    Notes
    -----
    Grains of the boundary have no equilibrium equations. Torque equations of grains on which unknown moments act are
    multiplied by `torque_weight`.
    """
    n, present = grains.count, present & grains.free
    force_unit, gravity, total = scale
    if not walls.loaded.any() and total is None and not any(gravity):
        raise ValueError("no wall carries a load: a total must fix the scale of the forces")
    matrix = equilibrium_matrix(contacts, grains.radius, walls)
    load = external_load(grains.weight(gravity), walls, grains.moment)
    weight = np.full(len(load), 1.0 / force_unit)
    lever = grains.radius[present].mean() if present.any() else 1.0
    weight[2 * n : 3 * n] /= lever
    if grains.moment_sd is not None:
        weight[2 * n : 3 * n] *= torque_weight(grains.moment_sd / (force_unit * lever))
    # The matrix acts on forces in units of force_unit; only b is converted.
    matrix = sparse.diags_array(weight * force_unit) @ matrix
    load = weight * load
    rows = np.concatenate([np.tile(present, 3), np.ones(len(load) - 3 * n, dtype=bool)])
    matrix, load = matrix[rows], load[rows]
    if total is not None:
        summed = np.concatenate([contacts.gauge.astype(np.float64), np.zeros(contacts.count)])
        matrix = sparse.vstack([matrix, sparse.csr_matrix(summed[None])])
        load = np.append(load, total / force_unit)
    matrix = sparse.csr_matrix(matrix)
    blocks = block_balance(matrix, load, int(present.sum()), contacts.count)
    return Balance(matrix, load, np.asarray(friction, dtype=np.float64), force_unit, blocks)


def weigh_rows(balance: Balance, weight: Array, grain_count: int) -> Balance:
    """Multiply the equations of a balance of so many grains by weights (m,)."""
    matrix = sparse.csr_matrix(sparse.diags_array(weight) @ balance.matrix)
    load = weight * balance.load
    blocks = block_balance(matrix, load, grain_count, balance.contact_count)
    return replace(balance, matrix=matrix, load=load, grains=blocks)


def torque_weight(moment_sd: Array) -> Array:
    """Weight of torque equations of grains on which unknown moments act.

    Parameters
    ----------
    moment_sd : (n,)
        Standard deviation of the moments, over force unit and mean radius.

    Notes
    -----
    An unknown moment M at the price λ/2 (M/s)², as a departure from previous forces has, leaves λ'/2 r² of the price
    ρ/2 r² of a torque residual r, 1/λ' = 1/ρ + s²/λ: the weight is 1/√(1 + ρ s²/λ).
    """
    settings = ConvexSettings()
    return 1.0 / np.sqrt(1.0 + settings.balance / settings.history * moment_sd**2)


def soft_slip(ut: Array, scale: float, sigma: Array | float, settings: ConvexSettings | None = None) -> Array:
    """Compute the dimensionless sliding û_t by soft thresholding.

    Parameters
    ----------
    ut : (c,)
        Measured sliding [m]; NaN where unknown.
    scale : float
        Displacement scale s [m].
    sigma : (c,) or float
        Standard deviation of a position component [m].

    Returns
    -------
    (c,)
        û_t; zero where the sliding is unknown or below the noise.

    Notes
    -----
    û_t = sign(u_t) max(|u_t| − k σ, 0) / s with k = `settings.slip_noise`.
    """
    settings = settings or ConvexSettings()
    slip = np.nan_to_num(np.asarray(ut, dtype=np.float64), nan=0.0)
    return np.sign(slip) * np.maximum(np.abs(slip) - settings.slip_noise * sigma, 0.0) / scale


def solve_convex_member(
    balance: Balance,
    slip: Array,
    probability: Array,
    previous_fn: Array,
    previous_ft: Array,
    settings: ConvexSettings | None = None,
    noise: float = 0.0,
) -> ConvexForces:
    """Solve the program of this module for the motion of one interval.

    Parameters
    ----------
    slip : (c,)
        û_t of `soft_slip`.
    probability : (c,)
        P(touch), 1 for certain contacts.
    previous_fn, previous_ft : (c,)
        Previous forces of the same ensemble member on the present contacts [N]; zero on new contacts.
    noise : float
        Fraction of noise in the variance of the sliding, 0 … 1.
    """
    settings = settings or ConvexSettings()
    possible = (1.0 - settings.noise_fraction * noise) * balance.friction * np.abs(slip)
    with np.errstate(divide="ignore"):
        ambiguity = np.maximum(0.0, -np.log(2.0 * probability))
    cost = np.concatenate([possible + settings.ambiguity_penalty * np.minimum(ambiguity, 100.0), slip])
    return _solve(balance, cost, previous_fn, previous_ft, settings.history, settings)


def project_onto_equilibrium(
    balance: Balance, mean_fn: Array, mean_ft: Array, settings: ConvexSettings | None = None
) -> ConvexForces:
    """Project a mean force field onto equilibrium inside the Coulomb cone.

    Parameters
    ----------
    mean_fn, mean_ft : (c,)
        Mean forces [N].

    Notes
    -----
    Minimises λ/2 |f − f_mean|² + ρ/2 |H f − b|² over the Coulomb cones, with λ = `settings.projection_weight`.
    """
    settings = settings or ConvexSettings()
    cost = np.zeros(2 * balance.contact_count)
    return _solve(balance, cost, mean_fn, mean_ft, settings.projection_weight, settings)


def _solve(
    balance: Balance, cost: Array, centre_fn: Array, centre_ft: Array, proximal_weight: float, settings: ConvexSettings
) -> ConvexForces:
    """Minimise cost·f + λ/2 |f − centre|² + ρ/2 |H f − b|² over the Coulomb cones."""
    c = balance.contact_count
    if c == 0:
        return ConvexForces(np.empty(0), np.empty(0), 0, True, "no contacts")
    program = Program(
        balance.friction, np.ascontiguousarray(cost.reshape(2, c).T),
        np.column_stack([centre_fn, centre_ft]) / balance.force_unit, proximal_weight, settings.balance,
    )  # fmt: skip
    found = solve_program(balance.grains, program, settings.tolerance)
    force = found.force * balance.force_unit
    return ConvexForces(force[:, 0], force[:, 1], found.steps, found.termination.usable, found.termination.value)
