"""Stress from contact forces (Love–Weber), its principal values, and the two friction angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import IN, OUT
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts

PARALLEL = np.radians(10.0)  # greatest angle between walls of one side, as the halves of a box that is split
CORNERS = 2048  # of the polygon that approximates a circle


def polygon_area(corners: Array) -> float:
    """Return the area of a polygon (m, 2) [m], counter-clockwise positive [m²]."""
    x, y = corners[:, 0], corners[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def packing_area(walls: Walls, fallback: Array) -> float:
    """Return the area of the packing [m²].

    Parameters
    ----------
    walls
        The area is that of the cell, or of the polygon bounded by the lines of the straight walls, in the order of
        their directions. A circle around the packing is cut by these lines; the area of inner circles is subtracted.
    fallback : (n, 2)
        Points [m] whose convex hull is used where the walls do not enclose an area.
    """
    if walls.cell is not None:
        return walls.cell.area
    radius, around = 0.5 * walls.length, np.flatnonzero(walls.sides == IN)
    within = float(np.pi * np.sum(radius[walls.sides == OUT] ** 2))
    if len(around):
        narrowest = int(around[np.argmin(radius[around])])
        return _area_in_circle(walls, narrowest) - within
    return _area_between_lines(walls, np.flatnonzero(~walls.curved), fallback) - within


def _area_in_circle(walls: Walls, circle: int) -> float:
    """Return the area [m²] of a circle cut by all straight walls; the circle is a polygon of equal area."""
    step = 2.0 * np.pi / CORNERS
    radius = 0.5 * walls.length[circle] * np.sqrt(step / np.sin(step))
    angle = step * np.arange(CORNERS)
    corners = walls.centre[circle] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for w in np.flatnonzero(~walls.curved):
        inside = (walls.endpoints[w, 0] - corners) @ walls.outward[w]
        following, further = np.roll(corners, -1, axis=0), np.roll(inside, -1)
        kept: list[Array] = []
        for here, there, a, b in zip(corners, following, inside, further, strict=True):
            kept += [here] if a >= 0.0 else []
            kept += [here + a / (a - b) * (there - here)] if (a >= 0.0) != (b >= 0.0) else []
        if not kept:
            return 0.0
        corners = np.array(kept)
    return polygon_area(corners)


def _area_between_lines(walls: Walls, straight: NDArray[np.intp], fallback: Array) -> float:
    order = _sides(walls, straight)
    if len(order) >= 3:
        start, direction = walls.endpoints[order, 0], walls.direction[order]
        corners = np.empty_like(start)
        for k in range(len(order)):
            previous = k - 1
            cross = direction[previous, 0] * direction[k, 1] - direction[previous, 1] * direction[k, 0]
            if cross < 1e-6:
                break
            step = start[k] - start[previous]
            s = (step[0] * direction[k, 1] - step[1] * direction[k, 0]) / cross
            corners[k] = start[previous] + s * direction[previous]
        else:
            return polygon_area(corners)
    from scipy.spatial import ConvexHull

    return float(ConvexHull(fallback).volume)


def _sides(walls: Walls, straight: NDArray[np.intp]) -> NDArray[np.intp]:
    """Straight walls (s,) in the order of their directions, of nearly parallel ones the longest: halves of one side."""
    angle = np.arctan2(walls.direction[straight, 1], walls.direction[straight, 0])
    kept: list[int] = []
    for k in np.argsort(-walls.length[straight], kind="stable"):
        apart = np.abs((angle[kept] - angle[k] + np.pi) % (2.0 * np.pi) - np.pi)
        if (apart > PARALLEL).all():
            kept.append(int(k))
    return straight[np.array(sorted(kept, key=lambda k: angle[k]), np.intp)]


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
