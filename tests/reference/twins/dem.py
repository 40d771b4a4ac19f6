"""The discrete-element step, body by body, with vectors and explicit frame geometry."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.dem.contact_law import Law

SIDES = ("bottom", "right", "top", "left")
TINY = 1e-40  # step of complex derivatives: nothing is subtracted, so that no digits are lost


@dataclass
class PlainCell:
    """Grains in a shear frame; pairs by their bodies' numbers, walls by number in SIDES."""

    position: Array  # (n, 2) [m]
    angle: Array  # (n,) [rad]
    velocity: Array  # (n, 2) [m/s]
    spin: Array  # (n,) [rad/s]
    force: Array  # (n, 2) [N]
    torque: Array  # (n,) [N m]
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg]
    shear: float  # [rad]
    height: float  # [m]
    rise: float  # [m/s]
    width: float  # [m]
    plate_mass: float  # [kg]
    load: float | None  # [N]; None: fixed plate
    plate_damping: float  # [N s/m]
    spread: float  # [m/s] of the right side, outwards
    side: tuple[float, float, float] | None  # mass [kg], load [N], damping [N s/m] of the right side; None: driven
    base_limit: Array  # (n,) [N]
    roughness: Array  # (n,) factor of the friction between grains
    external: Array  # (n, 2) [N] further forces
    axis: Array  # (n,) [rad] directions of the greatest radii at angle zero
    law: Law
    pairs: list[tuple[int, int]]
    wall_pairs: list[tuple[int, int]]
    damping: dict[tuple[str, int, int], float]
    spring: dict[tuple[str, int, int], float] = field(default_factory=dict)
    roll: dict[tuple[str, int, int], float] = field(default_factory=dict)
    held: dict[int, Array] = field(default_factory=dict)  # elastic friction of the base, by grain
    contact: dict[tuple[str, int, int], tuple[float, float]] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)  # branches reached

    def step(self, rate: float, rise: float = 0.0, spread: float = 0.0) -> float:
        """Advance one step at a shear rate [rad/s]; return the greatest possible approach of two bodies in it [m].

        rise, spread [m/s]: velocities of the plate and of the right side where no load moves them.
        """
        dt, law = self.law.time_step, self.law
        gravity = np.array([law.gravity_x, law.gravity_y])
        fastest = 0.0
        for k in range(len(self.mass)):
            inertia = 0.5 * self.mass[k] * self.radius[k] ** 2
            acceleration = (self.force[k] + self.external[k]) / self.mass[k] + gravity
            self.velocity[k] = (1.0 - law.drag * dt) * self.velocity[k] + dt * acceleration
            self.spin[k] = (1.0 - law.drag * dt) * self.spin[k] + dt * self.torque[k] / inertia
            self.position[k] = self.position[k] + dt * self.velocity[k]
            self.angle[k] += dt * self.spin[k]
            fastest = max(fastest, float(np.hypot(*self.velocity[k])))
        self.force[:], self.torque[:] = 0.0, 0.0
        self.shear += dt * rate
        self.height += dt * self.rise
        self.width += dt * self.spread
        for i, j in self.pairs:
            self._touch("pair", i, j, *self._pair_surfaces(i, j), self.velocity[j])
        push, side_push = 0.0, 0.0
        for i, w in self.wall_pairs:
            outward, distance, velocity, wall_spin = self._wall(w, self.position[i], rate)
            direction = float(np.arctan2(outward[1], outward[0]))
            radius = self._reach(i, direction, 0.0).real
            slope = self._reach(i, direction + 1j * TINY, 0.0).imag / TINY
            self._touch("wall", i, w, outward, distance - radius, ((radius, slope), (0.0, 0.0)), velocity, wall_spin)
            push += self.contact["wall", i, w][0] if SIDES[w] == "top" else 0.0
            side_push += self.contact["wall", i, w][0] if SIDES[w] == "right" else 0.0
        for k in range(len(self.mass)):
            self._rub(k)
        if self.load is None:
            self.rise = rise
        else:
            self.rise += dt * (push - self.load - self.plate_damping * self.rise) / self.plate_mass
        if self.side is None:
            self.spread = spread
        else:
            mass, load, damping = self.side
            self.spread += dt * (side_push - load - damping * self.spread) / mass
        wall_speed = (abs(self.rise) + abs(rate) * self.height) / np.cos(self.shear) ** 2 + abs(self.spread)
        return dt * (fastest + max(fastest, wall_speed))

    def _reach(self, k: int, direction: complex, turn: complex) -> complex:
        """Radius of grain k in a direction [rad] when it has turned by a further angle [rad]."""
        beyond = direction - self.angle[k] - turn - self.axis[k]
        return complex(self.radius[k] * (1.0 + self.law.ovality * np.cos(2.0 * beyond)))

    def _pair_surfaces(self, i: int, j: int) -> tuple[Array, float, tuple[tuple[float, float], tuple[float, float]]]:
        """Normal, gap [m] and the arms [m] of f_t and f_n about both grains, from the gap's derivatives.

        The gap g depends on the displacement of j and on the rotations of both grains; forces are along its gradient.
        Derivatives are those of the complex step, exact to rounding (Squire & Trapp 1998).
        """
        apart = self.position[j] - self.position[i]
        direction = float(np.arctan2(apart[1], apart[0]))
        distance = float(np.hypot(*apart))

        def gap(dx: complex, dy: complex, turn_i: complex, turn_j: complex) -> complex:
            along = distance + np.cos(direction) * dx + np.sin(direction) * dy
            across = np.cos(direction) * dy - np.sin(direction) * dx
            turned = direction + np.arctan(across / along)
            opposite = turned + np.pi  # the point in the view of j
            reach = self._reach(i, turned, turn_i) + self._reach(j, opposite, turn_j)
            return complex(np.sqrt(along**2 + across**2) - reach)

        slope = [gap(*step).imag / TINY for step in 1j * TINY * np.eye(4)]
        steepness = float(np.hypot(slope[0], slope[1]))
        normal = np.array(slope[:2]) / steepness
        first, second = self._reach(i, direction, 0.0).real, self._reach(j, direction + np.pi, 0.0).real
        arms = ((first / steepness, slope[2] / steepness), (second / steepness, slope[3] / steepness))
        return normal, gap(0.0, 0.0, 0.0, 0.0).real * steepness, arms

    def _rub(self, k: int) -> None:
        """Friction of the base on grain k: a spring and a dashpot against sliding, another against rotation."""
        law, limit = self.law, self.base_limit[k]
        if limit == 0.0:
            self.seen.add("no base")
            return
        slide = np.array([*self.velocity[k], self.radius[k] * self.spin[k]])
        elastic = self.held.get(k, np.zeros(3)) - law.tangential_stiffness * law.time_step * slide
        total = elastic - np.sqrt(law.tangential_stiffness * self.mass[k]) * slide
        if np.hypot(*total[:2]) > limit:
            self.seen.add("base slides")
            total[:2] *= limit / np.hypot(*total[:2])
            elastic[:2] = total[:2]
        else:
            self.seen.add("base sticks")
        if abs(total[2]) > 2.0 / 3.0 * limit:
            self.seen.add("base rotates " + ("forth" if total[2] > 0 else "back"))
            total[2] = elastic[2] = np.sign(total[2]) * 2.0 / 3.0 * limit
        self.held[k] = elastic
        self.force[k] += total[:2]
        self.torque[k] += self.radius[k] * total[2]

    def _wall(self, w: int, place: Array, rate: float) -> tuple[Array, float, Array, float]:
        """Outward normal, distance of a place [m], velocity of the wall there [m/s] and its spin [rad/s]."""
        along = np.array([np.sin(self.shear), np.cos(self.shear)])  # the sides, upwards
        if SIDES[w] == "bottom":
            return np.array([0.0, -1.0]), place[1], np.zeros(2), 0.0
        if SIDES[w] == "top":  # its ends run along the sides: x = h tan γ
            speed = self.rise * np.tan(self.shear) + self.height * rate / np.cos(self.shear) ** 2
            return np.array([0.0, 1.0]), self.height - place[1], np.array([speed, self.rise]), 0.0
        foot = np.array([self.width if SIDES[w] == "right" else 0.0, 0.0])
        outward = np.array([along[1], -along[0]]) * (1.0 if SIDES[w] == "right" else -1.0)
        arm = float((place - foot) @ along)  # of the rotation about the foot, clockwise
        velocity = arm * rate * np.array([along[1], -along[0]])
        if SIDES[w] == "right":
            velocity = velocity + np.array([self.spread, 0.0])
        return outward, float((foot - place) @ outward), velocity, -rate

    def _touch(
        self,
        kind: str,
        i: int,
        j: int,
        normal: Array,
        gap: float,
        arms: tuple[tuple[float, float], tuple[float, float]],
        velocity: Array,
        wall_spin: float = 0.0,
    ) -> None:
        """Spring, dashpot and friction of one contact; velocity [m/s] is that of the other body's centre or surface.

        arms [m]: of f_t and of f_n about i and about j. wall_spin [rad/s]: spin of a wall.
        """
        key, law = (kind, i, j), self.law
        if gap >= 0.0:
            self.seen.add(f"{kind} open" + (" again" if self.spring.get(key, 0.0) != 0.0 else ""))
            self.spring[key], self.roll[key], self.contact[key] = 0.0, 0.0, (0.0, 0.0)
            return
        tangent = np.array([-normal[1], normal[0]])
        (along_i, across_i), (along_j, across_j) = arms
        surface = self.velocity[i] + self.spin[i] * (along_i * tangent - across_i * normal)
        other = velocity - self.spin[j] * (along_j * tangent - across_j * normal) if kind == "pair" else velocity
        un, ut = float(normal @ (other - surface)), float(tangent @ (other - surface))
        damping = self.damping[key]
        fn = -law.normal_stiffness * gap - damping * un
        if fn < 0.0:
            fn = 0.0
            self.seen.add(f"{kind} torn")
        spring = self.spring.get(key, 0.0) - law.tangential_stiffness * ut * law.time_step
        ft = spring - law.tangential_damping * damping * ut
        rough = 0.5 * (self.roughness[i] + self.roughness[j]) if kind == "pair" else 1.0
        limit = rough * (law.friction if kind == "pair" else law.wall_friction) * fn
        if abs(ft) > limit:
            self.seen.add(f"{kind} slides {'forth' if ft > 0 else 'back'}")
            ft = spring = limit if ft > 0.0 else -limit
        else:
            self.seen.add(f"{kind} sticks")
        if kind == "wall":
            self.seen.add(SIDES[j])
        pressed, fn = fn, fn - law.adhesion
        self.spring[key], self.contact[key] = spring, (fn, ft)
        force = fn * normal + ft * tangent
        self.force[i] -= force
        self.torque[i] += across_i * fn - along_i * ft
        if kind == "pair":
            self.force[j] += force
            self.torque[j] += across_j * fn - along_j * ft
        arm = self.radius[i] * (self.radius[j] / (self.radius[i] + self.radius[j]) if kind == "pair" else 1.0)
        rotational_slip = arm * ((self.spin[j] if kind == "pair" else wall_spin) - self.spin[i])
        elastic = self.roll.get(key, 0.0) - law.tangential_stiffness * rotational_slip * law.time_step
        moment = elastic - law.tangential_damping * damping * rotational_slip
        most = law.rolling_friction * pressed
        if abs(moment) > most:
            self.seen.add(f"{kind} rolls {'forth' if moment > 0 else 'back'}")
            moment = elastic = most if moment > 0.0 else -most
        else:
            self.seen.add(f"{kind} does not roll")
        self.roll[key] = elastic
        self.torque[i] -= arm * moment
        if kind == "pair":
            self.torque[j] += arm * moment
