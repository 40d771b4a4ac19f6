"""Slow, plain Gauss-Seidel sweeps and their residuals, written from the mechanics alone.

Bodies are kept as velocity and spin, with the inertia ½ Z R² that goes with an impedance Z; every contact is looked at
with vectors. Nothing of the compiled kernels' records, groups or signs is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array, GrainMotion, Grains
from solver.bodies.packing import Material
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts

PLATE = 30.0  # impedance of a loaded plate, in mean impedances of the grains that are there


@dataclass
class World:
    """The velocities of all bodies under the present forces."""

    velocity: Array  # (n, 2) [m/s]
    spin: Array  # (n,) [rad/s]
    plate: Array  # (w,) [m/s] of every wall along its outward normal, beyond its measured motion


class PlainSolver:
    """One contact problem, solved contact by contact."""

    def __init__(
        self,
        grains: Grains,
        motion: GrainMotion,
        walls: Walls,
        contacts: Contacts,
        material: Material,
        impedance: Array,
        closing: Array | None = None,
    ) -> None:
        self.grains, self.motion, self.walls, self.contacts = grains, motion, walls, contacts
        self.material = material
        self.closing = np.zeros(contacts.count) if closing is None else closing
        self.plate_impedance = PLATE * float(np.mean([z for z, p in zip(impedance, motion.present, strict=True) if p]))
        # No force moves a grain of the boundary.
        self.impedance = np.where(grains.free, impedance, np.inf)
        self.inertia = 0.5 * self.impedance * grains.radius**2

    def friction(self, c: int) -> float:
        wall = self.contacts.j[c] >= self.grains.count
        return self.material.wall_friction if wall else self.material.friction

    def world(self, force: Array) -> World:
        """The bodies under forces (c, 2) [N] in the order of the contacts."""
        gravity = np.asarray(self.material.gravity)
        world = World(self.motion.velocity.copy(), self.motion.spin.copy(), np.zeros(self.walls.count))
        for k in range(self.grains.count):
            world.velocity[k] += self.grains.mass[k] * gravity / self.impedance[k]
        for w in range(self.walls.count):
            if np.isfinite(self.walls.load[w]):
                world.plate[w] = -self.walls.load[w] / self.plate_impedance
        for c in range(self.contacts.count):
            self._push(world, c, force[c, 0], force[c, 1])
        return world

    def relative_velocity(self, world: World, c: int) -> tuple[float, float]:
        """u_n, u_t [m/s] of j as seen from i; a contact that must close first counts as opening by that much."""
        i, j = self.contacts.i[c], self.contacts.j[c]
        n = self.contacts.normal[c]
        t = np.array([-n[1], n[0]])
        surface_i = world.velocity[i] + world.spin[i] * self.grains.radius[i] * t
        if j < self.grains.count:
            surface_j = world.velocity[j] - world.spin[j] * self.grains.radius[j] * t + self._drift(c)
        else:
            w = j - self.grains.count
            surface_j = self._wall_velocity(w, self.contacts.point[c]) + world.plate[w] * self.walls.outward[w]
        u = surface_j - surface_i
        return float(n @ u) + self.closing[c], float(t @ u)

    def compliance(self, c: int) -> tuple[float, float]:
        """W_nn, W_tt [m/(N s)]."""
        i, j = self.contacts.i[c], self.contacts.j[c]
        normal = 1.0 / self.impedance[i]
        tangential = normal + self.grains.radius[i] ** 2 / self.inertia[i]
        if j < self.grains.count:
            normal += 1.0 / self.impedance[j]
            tangential += 1.0 / self.impedance[j] + self.grains.radius[j] ** 2 / self.inertia[j]
        elif np.isfinite(self.walls.load[j - self.grains.count]):
            normal += 1.0 / self.plate_impedance
        return normal, tangential

    def solve_contact(self, world: World, c: int, force: Array, relaxation: float = 1.0) -> tuple[float, float]:
        """The force that brings the relative velocity to zero with all others frozen, on the Coulomb cone."""
        un, ut = self.relative_velocity(world, c)
        wnn, wtt = self.compliance(c)
        fn = force[c, 0] - relaxation * un / wnn
        ft = force[c, 1] - relaxation * ut / wtt
        if fn < 0.0:
            return 0.0, 0.0
        limit = self.friction(c) * fn
        if abs(ft) > limit:
            ft = limit if ft > 0.0 else -limit
        return fn, ft

    def sweep(self, world: World, force: Array, order: Array, relaxation: float = 1.0) -> None:
        """Visit every contact once, in place."""
        for c in order:
            fn, ft = self.solve_contact(world, c, force, relaxation)
            self._push(world, c, fn - force[c, 0], ft - force[c, 1])
            force[c] = fn, ft

    def natural_map(self, force: Array) -> float:
        """‖f − P(f − D⁻¹ u)‖ / ‖f‖."""
        world = self.world(force)
        miss = [force[c] - self.solve_contact(world, c, force) for c in range(self.contacts.count)]
        return float(np.linalg.norm(miss) / np.linalg.norm(force))

    def unbalance(self, force: Array) -> tuple[float, float]:
        """Worst and mean |ΣF| [N] on a grain that is there, weight included."""
        total = [self.grains.mass[k] * np.asarray(self.material.gravity) for k in range(self.grains.count)]
        for c in range(self.contacts.count):
            i, j = self.contacts.i[c], self.contacts.j[c]
            vector = self._vector(c, force[c, 0], force[c, 1])
            total[i] = total[i] - vector
            if j < self.grains.count:
                total[j] = total[j] + vector
        there = self.motion.present & self.grains.free
        size = [float(np.hypot(*total[k])) for k in range(self.grains.count) if there[k]]
        return max(size), sum(size) / len(size)

    def _push(self, world: World, c: int, fn: float, ft: float) -> None:
        i, j = self.contacts.i[c], self.contacts.j[c]
        vector = self._vector(c, fn, ft)
        world.velocity[i] -= vector / self.impedance[i]
        world.spin[i] -= self.grains.radius[i] * ft / self.inertia[i]  # lever R n, force −f
        if j < self.grains.count:
            world.velocity[j] += vector / self.impedance[j]
            world.spin[j] -= self.grains.radius[j] * ft / self.inertia[j]  # lever −R n, force f
        elif np.isfinite(self.walls.load[j - self.grains.count]):
            world.plate[j - self.grains.count] += fn / self.plate_impedance

    def _drift(self, c: int) -> Array:
        """Velocity of the image of j that i touches, beyond that of j: as often that of a and b as it lies beyond."""
        if self.walls.cell is None or self.contacts.shift is None:
            return np.zeros(2)
        a, b = np.linalg.solve(self.walls.cell.vectors.T, self.contacts.shift[c])
        return round(a) * self.walls.cell.velocity[0] + round(b) * self.walls.cell.velocity[1]

    def _vector(self, c: int, fn: float, ft: float) -> Array:
        n = self.contacts.normal[c]
        return fn * n + ft * np.array([-n[1], n[0]])

    def _wall_velocity(self, w: int, point: Array) -> Array:
        """The velocity of a wall's line at a point: that of its ends, in proportion to the way along it."""
        (start, end), (v0, v1) = self.walls.endpoints[w], self.walls.velocity[w]
        share = float((point - start) @ (end - start)) / float((end - start) @ (end - start))
        return (1.0 - share) * v0 + share * v1


def greatest_change(force: Array, before: Array) -> float:
    """The paper's ε_f: greatest |Δf| / |f|; 1 where a contact has lost its whole force."""
    greatest = 0.0
    for new, old in zip(force, before, strict=True):
        change, size = float(np.hypot(*(new - old))), float(np.hypot(*new))
        if size > 0.0:
            greatest = max(greatest, change / size)
        elif change > 0.0:
            greatest = max(greatest, 1.0)
    return greatest


def mean_normal(force: Array) -> float:
    """Mean f_n [N] of the contacts that bear force."""
    bearing = [fn for fn, _ in force if fn > 0.0]
    return sum(bearing) / len(bearing)


def plain_sweeps(grains, state, walls, contacts, material, impedance, order, count):
    """Forces (c, 2) after `count` sweeps from zero, visiting contacts in `order`."""
    solver = PlainSolver(grains, state, walls, contacts, material, impedance)
    force = np.zeros((contacts.count, 2))
    world = solver.world(force)
    for _ in range(count):
        solver.sweep(world, force, order)
    return force
