"""The forces of two circles on rods between them, rod by rod, with vectors."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.dem.contact_law import Law
from rodsight.solver.dem.time_step import DemBodies, DemPairs


def plain_circle_forces(
    bodies: DemBodies, pairs: DemPairs, law: Law, circles: Array, drive: Array
) -> tuple[Array, Array, float]:
    """Forces and torques on the grains (n, 3), f_n, f_t and spring of every pair (p, 3), and the force on the ring."""
    ring, rate, core, *centre, _ = circles
    force, found, push = np.zeros((len(bodies.mass), 3)), [], 0.0
    for i, wall, damping, spring in zip(pairs.i, pairs.j, pairs.damping, pairs.spring, strict=True):
        place, velocity, spin = bodies.state[i, :2], bodies.state[i, 3:5], bodies.state[i, 5]
        middle = np.zeros(2) if wall == 0 else np.array(centre)
        away = place - middle
        outward = away / np.hypot(*away)
        if wall == 0:
            normal, distance, surface = outward, ring - np.hypot(*away), rate * outward
        else:
            normal, distance = -outward, np.hypot(*away) - core
            surface = drive[:2] + drive[2] * core * np.array([-outward[1], outward[0]])
        if distance >= bodies.radius[i]:
            found.append((0.0, 0.0, 0.0))
            continue
        tangent = np.array([-normal[1], normal[0]])
        slide = surface - velocity - spin * bodies.radius[i] * tangent
        fn = max(law.normal_stiffness * (bodies.radius[i] - distance) - damping * float(slide @ normal), 0.0)
        elastic = spring - law.tangential_stiffness * float(slide @ tangent) * law.time_step
        ft = elastic - law.tangential_damping * damping * float(slide @ tangent)
        if abs(ft) > law.wall_friction * fn:
            ft = elastic = law.wall_friction * fn * np.sign(ft)
        found.append((fn, ft, elastic))
        force[i, :2] -= fn * normal + ft * tangent
        force[i, 2] -= bodies.radius[i] * ft
        push += fn if wall == 0 else 0.0
    return force, np.array(found), push
