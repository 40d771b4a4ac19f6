"""Plain Gauss-Seidel sweeps and their residuals, implemented from the mechanics alone.

Bodies have velocity and spin, with the inertia ½ Z R² of an impedance Z. Every contact is computed with vectors,
without the records, groups or sign conventions of the compiled kernels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rodsight.solver.bodies.grains import Array, GrainMotion, Grains
from rodsight.solver.bodies.packing import Material
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts

PLATE = 30.0  # impedance of a loaded plate, in mean impedances of the free grains


@dataclass
class BodyVelocities:
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
        self.free = motion.present & grains.free  # the others have no weight, and need no equilibrium
        self.plate_impedance = PLATE * float(np.mean([z for z, f in zip(impedance, self.free, strict=True) if f]))
        self.impedance = impedance
        self.inertia = 0.5 * self.impedance * grains.radius**2

    def friction(self, c: int) -> float:
        wall = self.contacts.j[c] >= self.grains.count
        return self.material.wall_friction if wall else self.material.friction

    def body_velocities(self, force: Array) -> BodyVelocities:
        """Compute the velocities under forces (c, 2) [N] in the order of the contacts."""
        gravity = np.asarray(self.material.gravity)
        bodies = BodyVelocities(self.motion.velocity.copy(), self.motion.spin.copy(), np.zeros(self.walls.count))
        for k in range(self.grains.count):
            if self.free[k]:
                bodies.velocity[k] += self.grains.mass[k] * gravity / self.impedance[k]
        for w in range(self.walls.count):
            if np.isfinite(self.walls.load[w]):
                bodies.plate[w] = -self.walls.load[w] / self.plate_impedance
        for c in range(self.contacts.count):
            self._apply(bodies, c, force[c, 0], force[c, 1])
        return bodies

    def relative_velocity(self, bodies: BodyVelocities, c: int) -> tuple[float, float]:
        """Compute u_n, u_t [m/s] of j relative to i; u_n includes the closing velocity of the contact."""
        i, j = self.contacts.i[c], self.contacts.j[c]
        n = self.contacts.normal[c]
        t = np.array([-n[1], n[0]])
        surface_i = bodies.velocity[i] + bodies.spin[i] * self.grains.radius[i] * t
        if j < self.grains.count:
            surface_j = bodies.velocity[j] - bodies.spin[j] * self.grains.radius[j] * t + self._drift(c)
        else:
            w = j - self.grains.count
            surface_j = self._wall_velocity(w, self.contacts.point[c])
            plate = self._plate(w)
            if plate >= 0:
                surface_j = surface_j + bodies.plate[plate] * self._outward(plate)
        u = surface_j - surface_i
        return float(n @ u) + self.closing[c], float(t @ u)

    def compliance(self, c: int) -> tuple[float, float]:
        """Compute W_nn, W_tt [m/(N s)]."""
        i, j = self.contacts.i[c], self.contacts.j[c]
        normal = 1.0 / self.impedance[i]
        tangential = normal + self.grains.radius[i] ** 2 / self.inertia[i]
        if j < self.grains.count:
            normal += 1.0 / self.impedance[j]
            tangential += 1.0 / self.impedance[j] + self.grains.radius[j] ** 2 / self.inertia[j]
        elif self._plate(j - self.grains.count) >= 0:
            along, across = self._along(c)
            normal += along**2 / self.plate_impedance
            tangential += across**2 / self.plate_impedance
        return normal, tangential

    def solve_contact(
        self, bodies: BodyVelocities, c: int, force: Array, relaxation: float = 1.0
    ) -> tuple[float, float]:
        """Force that makes the relative velocity zero with all others fixed, projected onto the Coulomb cone."""
        un, ut = self.relative_velocity(bodies, c)
        wnn, wtt = self.compliance(c)
        fn = force[c, 0] - relaxation * un / wnn
        ft = force[c, 1] - relaxation * ut / wtt
        if fn < 0.0:
            return 0.0, 0.0
        limit = self.friction(c) * fn
        if abs(ft) > limit:
            ft = limit if ft > 0.0 else -limit
        return fn, ft

    def sweep(self, bodies: BodyVelocities, force: Array, order: Array, relaxation: float = 1.0) -> None:
        """Visit every contact once, in place."""
        for c in order:
            fn, ft = self.solve_contact(bodies, c, force, relaxation)
            self._apply(bodies, c, fn - force[c, 0], ft - force[c, 1])
            force[c] = fn, ft

    def natural_map(self, force: Array) -> float:
        """‖f − P(f − D⁻¹ u)‖ / ‖f‖."""
        bodies = self.body_velocities(force)
        residual = [force[c] - self.solve_contact(bodies, c, force) for c in range(self.contacts.count)]
        return float(np.linalg.norm(residual) / np.linalg.norm(force))

    def force_residual(self, force: Array) -> tuple[float, float]:
        """Compute worst and mean |ΣF| [N] on a present grain, weight included."""
        total = [self.grains.mass[k] * np.asarray(self.material.gravity) for k in range(self.grains.count)]
        for c in range(self.contacts.count):
            i, j = self.contacts.i[c], self.contacts.j[c]
            vector = self._vector(c, force[c, 0], force[c, 1])
            total[i] = total[i] - vector
            if j < self.grains.count:
                total[j] = total[j] + vector
        size = [float(np.hypot(*total[k])) for k in range(self.grains.count) if self.free[k]]
        return max(size), sum(size) / len(size)

    def _apply(self, bodies: BodyVelocities, c: int, fn: float, ft: float) -> None:
        i, j = self.contacts.i[c], self.contacts.j[c]
        vector = self._vector(c, fn, ft)
        bodies.velocity[i] -= vector / self.impedance[i]
        bodies.spin[i] -= self.grains.radius[i] * ft / self.inertia[i]  # lever R n, force −f
        if j < self.grains.count:
            bodies.velocity[j] += vector / self.impedance[j]
            bodies.spin[j] -= self.grains.radius[j] * ft / self.inertia[j]  # lever −R n, force f
        elif self._plate(j - self.grains.count) >= 0:
            along, across = self._along(c)
            bodies.plate[self._plate(j - self.grains.count)] += (along * fn + across * ft) / self.plate_impedance

    def _plate(self, w: int) -> int:
        """Loaded wall whose free motion wall w shares; −1: none."""
        for each in (w, -1 if self.walls.plate is None else int(self.walls.plate[w])):
            if each >= 0 and np.isfinite(self.walls.load[each]):
                return each
        return -1

    def _outward(self, w: int) -> Array:
        """Normal of a straight wall, to the right of its direction."""
        along = self.walls.endpoints[w, 1] - self.walls.endpoints[w, 0]
        return np.array([along[1], -along[0]]) / np.hypot(*along)

    def _along(self, c: int) -> tuple[float, float]:
        """Components of the plate's normal along the normal and the tangent of a contact."""
        outward, n = self._outward(self._plate(self.contacts.j[c] - self.grains.count)), self.contacts.normal[c]
        return float(n @ outward), float(np.array([-n[1], n[0]]) @ outward)

    def _drift(self, c: int) -> Array:
        """Velocity of the image of j at i relative to j: the cell velocities times the cell shifts."""
        if self.walls.cell is None or self.contacts.shift is None:
            return np.zeros(2)
        a, b = np.linalg.solve(self.walls.cell.vectors.T, self.contacts.shift[c])
        return round(a) * self.walls.cell.velocity[0] + round(b) * self.walls.cell.velocity[1]

    def _vector(self, c: int, fn: float, ft: float) -> Array:
        n = self.contacts.normal[c]
        return fn * n + ft * np.array([-n[1], n[0]])

    def _wall_velocity(self, w: int, point: Array) -> Array:
        """Velocity of a wall at a point, interpolated between its ends."""
        (start, end), (v0, v1) = self.walls.endpoints[w], self.walls.velocity[w]
        fraction = float((point - start) @ (end - start)) / float((end - start) @ (end - start))
        return (1.0 - fraction) * v0 + fraction * v1


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
    """Mean f_n [N] of bearing contacts."""
    bearing = [fn for fn, _ in force if fn > 0.0]
    return sum(bearing) / len(bearing)


def plain_sweeps(grains, state, walls, contacts, material, impedance, order, count):
    """Forces (c, 2) after `count` sweeps from zero, visiting contacts in `order`."""
    solver = PlainSolver(grains, state, walls, contacts, material, impedance)
    force = np.zeros((contacts.count, 2))
    bodies = solver.body_velocities(force)
    for _ in range(count):
        solver.sweep(bodies, force, order)
    return force
