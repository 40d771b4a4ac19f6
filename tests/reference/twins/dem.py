"""The discrete-element step, body by body, with vectors and the frame's geometry written out."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from solver.bodies.grains import Array
from solver.dem.kernels import Law

SIDES = ("bottom", "right", "top", "left")


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
    load: float | None  # [N]; None: the plate is held
    plate_damping: float  # [N s/m]
    law: Law
    pairs: list[tuple[int, int]]
    wall_pairs: list[tuple[int, int]]
    damping: dict[tuple[str, int, int], float]
    spring: dict[tuple[str, int, int], float] = field(default_factory=dict)
    contact: dict[tuple[str, int, int], tuple[float, float]] = field(default_factory=dict)
    seen: set[str] = field(default_factory=set)  # branches taken

    def step(self, rate: float) -> float:
        """Take one step at a shear rate [rad/s]; how much two bodies may have approached in it [m]."""
        dt, law = self.law.time_step, self.law
        gravity = np.array([law.gravity_x, law.gravity_y])
        fastest = 0.0
        for k in range(len(self.mass)):
            inertia = 0.5 * self.mass[k] * self.radius[k] ** 2
            self.velocity[k] = (1.0 - law.drag * dt) * self.velocity[k] + dt * (self.force[k] / self.mass[k] + gravity)
            self.spin[k] = (1.0 - law.drag * dt) * self.spin[k] + dt * self.torque[k] / inertia
            self.position[k] = self.position[k] + dt * self.velocity[k]
            self.angle[k] += dt * self.spin[k]
            fastest = max(fastest, float(np.hypot(*self.velocity[k])))
        self.force[:], self.torque[:] = 0.0, 0.0
        self.shear += dt * rate
        self.height += dt * self.rise
        for i, j in self.pairs:
            apart = self.position[j] - self.position[i]
            distance = float(np.hypot(*apart))
            normal = apart / distance
            self._touch("pair", i, j, normal, distance - self.radius[i] - self.radius[j], self.velocity[j])
        push = 0.0
        for i, w in self.wall_pairs:
            outward, distance, velocity = self._wall(w, self.position[i], rate)
            self._touch("wall", i, w, outward, distance - self.radius[i], velocity)
            if SIDES[w] == "top":
                push += self.contact["wall", i, w][0]
        if self.load is not None:
            self.rise += dt * (push - self.load - self.plate_damping * self.rise) / self.plate_mass
        wall_speed = (abs(self.rise) + abs(rate) * self.height) / np.cos(self.shear) ** 2
        return dt * (fastest + max(fastest, wall_speed))

    def _wall(self, w: int, place: Array, rate: float) -> tuple[Array, float, Array]:
        """Outward normal, distance of a place [m] and the wall's velocity there [m/s]."""
        along = np.array([np.sin(self.shear), np.cos(self.shear)])  # the sides, upwards
        if SIDES[w] == "bottom":
            return np.array([0.0, -1.0]), place[1], np.zeros(2)
        if SIDES[w] == "top":  # its ends run along the sides: x = h tan γ
            speed = self.rise * np.tan(self.shear) + self.height * rate / np.cos(self.shear) ** 2
            return np.array([0.0, 1.0]), self.height - place[1], np.array([speed, self.rise])
        foot = np.array([self.width if SIDES[w] == "right" else 0.0, 0.0])
        outward = np.array([along[1], -along[0]]) * (1.0 if SIDES[w] == "right" else -1.0)
        arm = float((place - foot) @ along)  # of the turn about the foot, clockwise
        return outward, float((foot - place) @ outward), arm * rate * np.array([along[1], -along[0]])

    def _touch(self, kind: str, i: int, j: int, normal: Array, gap: float, velocity: Array) -> None:
        """Spring, dashpot and friction of one contact; velocity [m/s] is that of the other body's centre or surface."""
        key, law = (kind, i, j), self.law
        if gap >= 0.0:
            self.seen.add(f"{kind} open" + (" again" if self.spring.get(key, 0.0) != 0.0 else ""))
            self.spring[key], self.contact[key] = 0.0, (0.0, 0.0)
            return
        tangent = np.array([-normal[1], normal[0]])
        surface = self.velocity[i] + self.spin[i] * self.radius[i] * tangent
        other = velocity - self.spin[j] * self.radius[j] * tangent if kind == "pair" else velocity
        un, ut = float(normal @ (other - surface)), float(tangent @ (other - surface))
        damping = self.damping[key]
        fn = -law.normal_stiffness * gap - damping * un
        if fn < 0.0:
            fn = 0.0
            self.seen.add(f"{kind} torn")
        spring = self.spring.get(key, 0.0) - law.tangential_stiffness * ut * law.time_step
        ft = spring - law.tangential_damping * damping * ut
        limit = (law.friction if kind == "pair" else law.wall_friction) * fn
        if abs(ft) > limit:
            self.seen.add(f"{kind} slides {'forth' if ft > 0 else 'back'}")
            ft = spring = limit if ft > 0.0 else -limit
        else:
            self.seen.add(f"{kind} sticks")
        if kind == "wall":
            self.seen.add(SIDES[j])
        self.spring[key], self.contact[key] = spring, (fn, ft)
        force = fn * normal + ft * tangent
        self.force[i] -= force
        self.torque[i] -= self.radius[i] * ft
        if kind == "pair":
            self.force[j] += force
            self.torque[j] -= self.radius[j] * ft
