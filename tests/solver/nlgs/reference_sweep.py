"""A slow, plain Gauss-Seidel sweep written from the mechanics alone, to check the compiled one against."""

from __future__ import annotations

import numpy as np


def plain_sweeps(grains, state, walls, contacts, material, impedance, order, count):
    """Forces (c, 2) after `count` sweeps from zero, visiting contacts in `order`."""
    n = grains.count
    inertia = 0.5 * impedance * grains.radius**2
    velocity = state.velocity + np.asarray(material.gravity) * grains.mass[:, None] / impedance[:, None]
    spin = state.spin.copy()
    plate_impedance = 30.0 * impedance.mean()
    plate = np.where(walls.loaded, -np.nan_to_num(walls.load) / plate_impedance, 0.0)
    force = np.zeros((contacts.count, 2))
    for _ in range(count):
        for c in order:
            i, j = contacts.i[c], contacts.j[c]
            normal, tangent = contacts.normal[c], contacts.tangent[c]
            wall = j - n if j >= n else None
            mu = material.friction if wall is None else material.wall_friction
            w_nn = 1 / impedance[i]
            w_tt = 1 / impedance[i] + grains.radius[i] ** 2 / inertia[i]
            u = -velocity[i]
            u_t = -grains.radius[i] * spin[i]
            if wall is None:
                w_nn += 1 / impedance[j]
                w_tt += 1 / impedance[j] + grains.radius[j] ** 2 / inertia[j]
                u = u + velocity[j]
                u_t -= grains.radius[j] * spin[j]
            else:
                at = walls.velocity_at(np.array([wall]), contacts.point[c : c + 1])[0]
                u = u + at + plate[wall] * walls.outward[wall]
                if walls.loaded[wall]:
                    w_nn += 1 / plate_impedance
            fn = max(force[c, 0] - float(normal @ u) / w_nn, 0.0)
            ft = float(np.clip(force[c, 1] - (float(tangent @ u) + u_t) / w_tt, -mu * fn, mu * fn))
            change = (fn - force[c, 0]) * normal + (ft - force[c, 1]) * tangent
            velocity[i] -= change / impedance[i]
            spin[i] -= grains.radius[i] * (ft - force[c, 1]) / inertia[i]
            if wall is None:
                velocity[j] += change / impedance[j]
                spin[j] -= grains.radius[j] * (ft - force[c, 1]) / inertia[j]
            elif walls.loaded[wall]:
                plate[wall] += (fn - force[c, 0]) / plate_impedance
            force[c] = fn, ft
    return force
