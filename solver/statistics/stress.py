"""Stress from contact forces (Love-Weber), its principal values, and the two friction angles."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts


def polygon_area(corners: Array) -> float:
    """Area of a polygon (m, 2) [m], counter-clockwise positive [m²]."""
    x, y = corners[:, 0], corners[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def packing_area(walls: Walls, fallback: Array) -> float:
    """Area between the walls [m²]: the polygon their lines bound, taken in the order of their directions.

    fallback (n, 2) [m]: points whose convex hull counts where the walls do not close a polygon.
    """
    if walls.count >= 3:
        order = np.argsort(np.arctan2(walls.direction[:, 1], walls.direction[:, 0]))
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


def contact_force_vectors(contacts: Contacts, fn: Array, ft: Array) -> Array:
    """Force that i exerts on j (c, 2) [N]."""
    return fn[:, None] * contacts.normal + ft[:, None] * contacts.tangent


def branch_vectors(contacts: Contacts, position: Array) -> Array:
    """From the centre of i to the centre of j, or to the contact point on a wall (c, 2) [m]."""
    end = contacts.point.copy()
    pair = ~contacts.with_wall
    end[pair] = position[contacts.j[pair]]
    return end - position[contacts.i]


def love_weber_stress(contacts: Contacts, fn: Array, ft: Array, position: Array, area: float, length: float) -> Array:
    """σ = Σ f ⊗ ℓ / (A L) (2, 2) [Pa], compression positive.

    position (n, 2) [m]; area of the packing [m²]; length of the rods [m].
    """
    force, branch = contact_force_vectors(contacts, fn, ft), branch_vectors(contacts, position)
    return np.einsum("ca,cb->ab", force, branch) / (area * length)


def principal_stresses(stress: Array) -> tuple[float, float, float]:
    """σ₁ ≥ σ₂ [Pa] and the direction of σ₁ [rad] in (−π/2, π/2], of the symmetric part."""
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
    """Macroscopic friction angle asin((σ₁ − σ₂) / (σ₁ + σ₂)) [rad]; 0 without stress."""
    major, minor, _ = principal_stresses(stress)
    return float(np.arcsin(np.clip((major - minor) / (major + minor), -1.0, 1.0))) if major + minor > 0 else 0.0


def wall_forces(contacts: Contacts, fn: Array, ft: Array) -> Array:
    """Force that the packing exerts on every wall (w, 2) [N]."""
    on_wall = contacts.with_wall
    total = np.zeros((contacts.wall_count, 2))
    np.add.at(total, contacts.j[on_wall] - contacts.grain_count, contact_force_vectors(contacts, fn, ft)[on_wall])
    return total


def wall_ratio_angle(walls: Walls, force: Array) -> float:
    """atan(|T| / N) [rad] of the force (w, 2) [N] on the first loaded wall; NaN without one, or without load on it."""
    if not walls.loaded.any():
        return float("nan")
    w = int(np.argmax(walls.loaded))
    normal, tangential = float(force[w] @ walls.outward[w]), float(force[w] @ walls.direction[w])
    return float(np.arctan2(abs(tangential), normal)) if normal > 0 else float("nan")
