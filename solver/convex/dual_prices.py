"""Dual prices of pairs that are not among the contacts of a program: column generation with its multipliers.

The multiplier v = ρ (H f − b) of a grain's equilibrium is a correction of its measured velocity. A contact keeps its
bodies from closing. Where a contact is missing, the multipliers close the pair: on simulated packings by 2.6 to 190
typical displacements where a strong contact was removed, by less than 0.5 elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from .program import Balance, ConvexSettings


def price_pairs(
    pairs: Contacts,
    balance: Balance,
    forces: Sequence[Float[Array, "c 2"]],
    walls: Walls,
    balanced: Bool[np.ndarray, " n"],
    settings: ConvexSettings | None = None,
) -> Float[Array, " p"]:
    """Compute the closing velocity of every pair under the mean multipliers of the convex members.

    Parameters
    ----------
    balance : Balance
        Equilibrium equations that the members were solved with.
    forces : sequence of (c, 2)
        Forces (f_n, f_t) of each member [N].
    balanced : (n,)
        Grains with equilibrium equations.

    Returns
    -------
    (p,)
        n · (v_i − v_j) [displacement scales]; positive where the pair closes.

    Notes
    -----
    v = ρ (H f − b), averaged over the members.
    """
    settings = settings or ConvexSettings()
    velocity = np.mean([_velocities(balance, each, walls, balanced, settings.balance) for each in forces], axis=0)
    return np.einsum("ij,ij->i", pairs.normal, velocity[pairs.i] - velocity[pairs.j])


def _velocities(balance: Balance, force: Array, walls: Walls, balanced: NDArray[np.bool_], weight: float) -> Array:
    """Multipliers of all bodies (n + w, 2); zero for fixed bodies and tangentially to loaded walls."""
    n, here = len(balanced), int(balanced.sum())
    multiplier = weight * (balance.matrix @ (force.T.ravel() / balance.force_unit) - balance.load)
    velocity = np.zeros((n + walls.count, 2))
    velocity[:n][balanced] = multiplier[: 2 * here].reshape(2, here).T
    plates = np.flatnonzero(walls.loaded)
    outward = multiplier[3 * here : 3 * here + len(plates)]
    velocity[n + plates] = walls.outward[plates] * outward[:, None]
    fixed = np.flatnonzero((walls.carrier >= 0) & ~walls.loaded)
    velocity[n + fixed] = velocity[n + walls.carrier[fixed]]
    return velocity
