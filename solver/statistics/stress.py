"""Stress from contact forces (Love–Weber), its principal values, and the two friction angles."""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts


def contact_force_vectors(contacts: Contacts, fn: Array, ft: Array) -> Array:
    """Return the force that i exerts on j (c, 2) [N]."""
    return fn[:, None] * contacts.normal + ft[:, None] * contacts.tangent


def branch_vectors(contacts: Contacts, position: Array) -> Array:
    """Return the vector from the centre of i to the centre of j, or to the contact point on a wall (c, 2) [m]."""
    end = contacts.point.copy()
    pair = ~contacts.with_wall
    end[pair] = contacts.second_centre(position)[pair]
    return end - position[contacts.i]


def love_weber_stress(contacts: Contacts, fn: Array, ft: Array, position: Array, area: float, length: float) -> Array:
    """Compute the Love–Weber stress of the packing (2, 2) [Pa], compression positive.

    Parameters
    ----------
    contacts
        Contacts of the frame, c in number.
    fn, ft : (c,)
        Forces that i exerts on j [N].
    position : (n, 2)
        Centres [m].
    area
        Area A of the packing [m²].
    length
        Length L of the rods [m].

    Notes
    -----
    σ = Σ f ⊗ ℓ / (A L) with branch vectors ℓ.
    """
    force, branch = contact_force_vectors(contacts, fn, ft), branch_vectors(contacts, position)
    return np.einsum("ca,cb->ab", force, branch) / (area * length)


def grain_stresses(contacts: Contacts, fn: Array, ft: Array, radius: Array, length: float) -> Array:
    """Compute the stress of every grain over its own volume (n, 2, 2) [Pa], compression positive.

    Parameters
    ----------
    contacts
        Contacts of the frame, c in number.
    fn, ft : (c,)
        Forces that i exerts on j [N].
    radius : (n,)
        Radii R [m].
    length
        Length of the rods [m].

    Notes
    -----
    σ = Σ f ⊗ R n / V. The sum weighted with the volumes V is the stress of the packing.
    """
    dyad = contact_force_vectors(contacts, fn, ft)[:, :, None] * contacts.normal[:, None, :]
    total = np.zeros((len(radius), 2, 2))
    np.add.at(total, contacts.i, radius[contacts.i, None, None] * dyad)
    pair = ~contacts.with_wall
    np.add.at(total, contacts.j[pair], radius[contacts.j[pair], None, None] * dyad[pair])  # force and arm both reversed
    return total / (np.pi * radius**2 * length)[:, None, None]


def principal_stresses(stress: Array) -> tuple[float, float, float]:
    """Return σ₁ ≥ σ₂ [Pa] and the direction of σ₁ [rad] in (−π/2, π/2], of the symmetric part."""
    symmetric = 0.5 * (stress + stress.T)
    values, vectors = np.linalg.eigh(symmetric)
    x, y = vectors[:, 1]
    angle = float(np.arctan2(y, x))
    if angle <= -np.pi / 2:
        angle += np.pi
    elif angle > np.pi / 2:
        angle -= np.pi
    return float(values[1]), float(values[0]), angle


def friction_angle(stress: Array) -> float:
    """Return the macroscopic friction angle asin((σ₁ − σ₂) / (σ₁ + σ₂)) [rad]; 0 without stress."""
    major, minor, _ = principal_stresses(stress)
    return float(np.arcsin(np.clip((major - minor) / (major + minor), -1.0, 1.0))) if major + minor > 0 else 0.0


def wall_forces(contacts: Contacts, fn: Array, ft: Array) -> Array:
    """Return the force that the packing exerts on every wall (w, 2) [N]."""
    on_wall = contacts.with_wall
    total = np.zeros((contacts.wall_count, 2))
    np.add.at(total, contacts.j[on_wall] - contacts.grain_count, contact_force_vectors(contacts, fn, ft)[on_wall])
    return total


def sums_on_walls(contacts: Contacts, fn: Array, ft: Array) -> Array:
    """Return the sums of the normal and of the tangential forces on every wall (w, 2) [N], for circles, too."""
    on_wall = contacts.with_wall
    total = np.zeros((contacts.wall_count, 2))
    np.add.at(total, contacts.j[on_wall] - contacts.grain_count, np.column_stack([fn, ft])[on_wall])
    return total


def wall_ratio_angle(walls: Walls, force: Array) -> float:
    """Return atan(|T| / N) [rad] of the first loaded wall; NaN without one, or where N ≤ 0.

    force (w, 2) [N]: sums N and T of the normal and tangential forces on every wall.
    """
    if not walls.loaded.any():
        return float("nan")
    normal, tangential = force[int(np.argmax(walls.loaded))].tolist()
    return float(np.arctan2(abs(tangential), normal)) if normal > 0 else float("nan")
