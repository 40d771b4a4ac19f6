"""Force chains: quasi-linear files of grains along which the stress is concentrated.

After Peters, Muthuswamy, Wibowo & Tordesillas 2005, Phys. Rev. E 72, 041307. Definition:

1. The stress of a grain is σ = Σ f ⊗ r / (π R² L) over its contacts, with r from its centre to the contact point,
   symmetric part, compression positive; σ₁ is its greatest principal value, d the direction of it.
2. A grain is highly stressed if σ₁ exceeds the mean of σ₁ over all grains present (those without force included).
3. Two highly stressed grains that touch with force are linked if the line between their centres lies within 45° of d
   at both of them.
4. A chain passes through a grain from a link on one side of it, along d, to a link on the other side, so that it has
   at least three grains. A link with no such grain at either end belongs to no chain. Chains with a common grain are
   branches of one chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..bodies.grains import Array, Grains
from ..contacts.contacts import Contacts

GREATEST_ANGLE = np.deg2rad(45.0)  # between σ₁ of a grain and the line to the next one


@dataclass(frozen=True, slots=True)
class ForceChains:
    """The force chains of one frame."""

    chain: NDArray[np.int32]  # (n,) number of the chain of every grain, from 0; −1: in none
    link: NDArray[np.int64]  # (l,) rows of the contacts that chains run along, ascending
    major: Array  # (n,) [Pa] greatest principal stress of every grain
    direction: Array  # (n,) [rad] of it, in (−π/2, π/2]; 0 without stress

    @property
    def count(self) -> int:
        return int(self.chain.max(initial=-1)) + 1

    @property
    def length(self) -> NDArray[np.int64]:
        """Number of grains of every chain (count,), 3 or more."""
        return np.bincount(self.chain[self.chain >= 0], minlength=self.count)


def symmetric_grain_stresses(
    contacts: Contacts, fn: Array, ft: Array, position: Array, grains: Grains, length: float
) -> Array:
    """Return the symmetric stress of every grain (n, 2, 2) [Pa]; arguments as of `find_force_chains`."""
    force = fn[:, None] * contacts.normal + ft[:, None] * contacts.tangent
    total = np.zeros((contacts.grain_count, 2, 2))
    pair = ~contacts.with_wall
    i, j, centre = contacts.i, contacts.j[pair], contacts.second_centre(position)[pair]
    np.add.at(total, i, np.einsum("ca,cb->cab", force, contacts.point - position[i]))
    np.add.at(total, j, np.einsum("ca,cb->cab", -force[pair], contacts.point[pair] - centre))
    total += total.transpose(0, 2, 1).copy()
    return total / (2.0 * np.pi * grains.radius**2 * length)[:, None, None]


def find_force_chains(
    contacts: Contacts,
    fn: Array,
    ft: Array,
    position: Array,
    present: NDArray[np.bool_],
    grains: Grains,
    length: float,
) -> ForceChains:
    """Find the force chains of a frame, as defined at the head of this file.

    Parameters
    ----------
    contacts
        Contacts of the frame, c in number.
    fn, ft : (c,)
        Forces that i exerts on j [N].
    position : (n, 2)
        Centres [m].
    present : (n,) bool
        Grains seen.
    grains
        Grains with their radii.
    length
        Length of the rods [m].
    """
    n = contacts.grain_count
    major, axis = _principal_axes(symmetric_grain_stresses(contacts, fn, ft, position, grains, length))
    stressed = present & (major > major[present].mean()) if present.any() else np.zeros(n, bool)
    row = np.flatnonzero((fn > 0) & ~contacts.with_wall)
    i, j = contacts.i[row].astype(np.int64), contacts.j[row].astype(np.int64)
    normal = contacts.normal[row]
    at_i, at_j = np.einsum("ca,ca->c", normal, axis[i]), np.einsum("ca,ca->c", normal, axis[j])
    # A tolerance, so that rounding does not decide about links at exactly the greatest angle.
    least = np.cos(GREATEST_ANGLE) - 1e-12
    linked = stressed[i] & stressed[j] & (np.abs(at_i) >= least) & (np.abs(at_j) >= least)
    row, i, j, at_i, at_j = row[linked], i[linked], j[linked], at_i[linked], at_j[linked]

    # Side of a grain on which a link leaves it: 1 along d, 0 against d. The normal points from i to j.
    side_i, side_j = (at_i > 0).astype(np.int64), (at_j < 0).astype(np.int64)
    links = np.zeros((n, 2), np.int64)
    np.add.at(links, (i, side_i), 1)
    np.add.at(links, (j, side_j), 1)
    on_chain = links.min(axis=1) > 0
    kept = on_chain[i] | on_chain[j]
    return ForceChains(
        chain=_number_chains(n, i[kept], j[kept]),
        link=row[kept],
        major=major,
        direction=_angle(axis),
    )


def _number_chains(n: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.int32]:
    """Number the connected components of links i, j (l,) in the order of their first grains (n,); −1 without a link."""
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(n, n))
    _, part = connected_components(graph, directed=False)
    member = np.zeros(n, bool)
    member[i] = member[j] = True
    chain = np.full(n, -1, np.int32)
    values, first, number = np.unique(part[member], return_index=True, return_inverse=True)
    rank = np.empty(len(values), np.int32)
    rank[np.argsort(first)] = np.arange(len(values), dtype=np.int32)
    chain[member] = rank[number]
    return chain


def _principal_axes(stress: Array) -> tuple[Array, Array]:
    """Return the greatest principal value (n,) and its unit vector (n, 2) of symmetric tensors (n, 2, 2)."""
    angle = 0.5 * np.arctan2(2.0 * stress[:, 0, 1], stress[:, 0, 0] - stress[:, 1, 1])
    mean = 0.5 * (stress[:, 0, 0] + stress[:, 1, 1])
    half = np.hypot(0.5 * (stress[:, 0, 0] - stress[:, 1, 1]), stress[:, 0, 1])
    return mean + half, np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _angle(axis: Array) -> Array:
    """Return the angle (n,) [rad] in (−π/2, π/2] of unit vectors with x ≥ 0."""
    return np.arctan2(axis[:, 1], axis[:, 0])
