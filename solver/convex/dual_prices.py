"""Missing contacts: pairs that are not among those of a program, but of which its dual prices show that they touch.

The multiplier v = ρ (H f − b) of a grain's equilibrium is a correction of its measured velocity. A contact keeps its
bodies from closing. Where a contact is missing, the multipliers close the pair: on simulated packings by 2.6 to 190
typical displacements where a strong contact was removed, by less than 0.5 elsewhere: column generation. One strong
contact that was not detected distorts all forces around it, without an imbalance of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..bodies.motion import Snapshot
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, detect_contacts
from ..contacts.pairs import Keys, are_among
from .program import Balance, ConvexSettings

REACH = 0.012  # of the mean diameter: gaps beyond which no error of radii and centres explains a contact
REQUIRED_PRICE = 1.5  # price of a touching pair above which it is offered; it grows with the gap …
GAP_SIGMAS = 2.0  # … the price counts half at a gap of so many standard deviations, and falls with this power of it:
GAP_POWER = 1.5  # a centre that a hand has placed may err by ten of them
RELATIVE_PRICE = 0.3  # of the highest price: cheaper pairs are tested again in the next round
MAX_PROBABILITY = 0.95  # P(touch) that a missing pair is offered with at most
ROUNDS = 3  # a second missing contact shows once the first is back


def find_missing_pairs(
    grains: Grains,
    snapshot: Snapshot,
    walls: Walls,
    known: Keys,
    solved: tuple[Balance, Sequence[Array]],
    overlap: float,
    settings: ConvexSettings | None = None,
) -> tuple[Keys, Array]:
    """Find pairs with an outstanding price.

    Parameters
    ----------
    grains, snapshot, walls
        Of the frame.
    known : (k,)
        Keys of pairs that are not considered: those of the program, and forbidden ones.
    solved : tuple of Balance and a sequence of (c, 2)
        Equilibrium equations of the program, and forces [N] of its solutions.
    overlap : float
        Typical overlap of a contact [m].

    Returns
    -------
    key : (m,)
        The pairs, ascending.
    probability : (m,)
        P(touch) to offer each with.
    """
    reach = REACH * 2.0 * float(grains.radius.mean())
    near = detect_contacts(grains, snapshot.position, snapshot.present, walls, reach)
    near = near.select(~are_among(near.key, known))
    if near.count == 0:
        return np.empty(0, np.int64), np.empty(0)
    balance, forces = solved
    price = price_pairs(near, balance, forces, walls, snapshot.present & grains.free, settings)
    sigma = float(np.hypot(2.0**0.5 * snapshot.sigma, overlap))
    reduced = price / (1.0 + (np.maximum(near.gap, 0.0) / (GAP_SIGMAS * sigma)) ** GAP_POWER)
    rows = _highest_prices(near, reduced)
    return near.key[rows], np.minimum(reduced[rows] / (1.0 + reduced[rows]), MAX_PROBABILITY)


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


def _highest_prices(near: Contacts, price: Array) -> NDArray[np.intp]:
    """Rows of the pairs with outstanding prices, one of each grain: a missing contact raises all prices near it."""
    taken = np.zeros(near.body_count, bool)
    least = max(REQUIRED_PRICE, RELATIVE_PRICE * float(price.max()))
    rows = []
    for row in np.argsort(-price, kind="stable"):
        if not price[row] > least:
            break
        i, j = near.i[row], near.j[row]
        if taken[i] or taken[j]:
            continue
        taken[[i, j]] = True
        taken[near.grain_count :] = False  # a wall may lack any number of contacts
        rows.append(row)
    return np.sort(np.array(rows, np.intp))


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
