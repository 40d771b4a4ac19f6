"""Explicit discrete-element simulation of a packing in a shear frame: the truth of synthetic experiments.

Discs (rods seen end on) and four straight walls; at every contact a linear normal spring with a
dashpot, and a tangential spring with history, cut at Coulomb's limit (Cundall & Strack 1979).
The frame is that of the 1γ2ε device: bottom fixed, sides turning about the bottom corners, a
plate on top that moves sideways with the sides and carries a constant pressure. While it is sheared
nothing is dissipated but in the contacts and in the plate's own dashpot.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array, Grains
from solver.dem.kernels import HEIGHT, LOAD, SHEAR, TOP, WIDTH, Bodies, Law, Pairs, advance
from solver.dem.truth import WALL_NAMES, DemFrame, DemSettings, DemTruth, UnbalancedError

__all__ = ["DemFrame", "DemSettings", "DemTruth", "ShearCell", "UnbalancedError", "shear_photographs"]

RAMP = 0.3  # part of a shear step spent on speeding up, and on slowing down
PAUSE_STEPS = 250  # between two looks at the balance
SIDE_MARGIN = 1.12  # the sides' length over the first height: room for dilation and slant at 15°


class ShearCell:
    """A packing in its frame, advanced in time. Changes in place; everything it hands out is a copy."""

    def __init__(
        self,
        radius: Array,
        position: Array,
        *,
        width: float,
        height: float,
        settings: DemSettings,
        velocity: Array | None = None,
        drag: float = 0.0,
    ) -> None:
        """Place grains of radius (n,) [m] at position (n, 2) [m] in a frame of width × height [m].

        velocity (n, 3) [m/s, m/s, rad/s]: at rest unless given. drag [1/s] slows every grain: for
        the preparation of a packing only.
        """
        n = len(radius)
        self.settings = settings
        self.grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        state = np.zeros((n, 6))
        state[:, :2] = position
        if velocity is not None:
            state[:, 3:] = velocity
        mean_mass = float(self.grains.mass.mean())
        diameter = 2.0 * float(radius.mean())
        self.time_step = settings.time_step_factor * float(np.sqrt(self.grains.mass.min() / settings.normal_stiffness))
        # Grains per length of plate times the impedance √(stiffness · mass) of a row of them.
        impedance = width / diameter * np.sqrt(settings.normal_stiffness * mean_mass)
        constants = np.array([
            width,
            2.0 * mean_mass * width / diameter,
            settings.pressure * width * settings.length,
            settings.plate_damping * impedance,
        ])  # fmt: skip
        frame = np.array([0.0, height, 0.0])
        self._bodies = Bodies(state, np.zeros((n, 3)), self.grains.radius, self.grains.mass, frame, constants)
        tangential = settings.stiffness_ratio * settings.normal_stiffness
        self._law = Law(
            time_step=self.time_step,
            normal_stiffness=settings.normal_stiffness,
            tangential_stiffness=tangential,
            # The same damping ratio along t, where a contact of two solid rods has a third of the mass.
            tangential_damping=float(np.sqrt(settings.stiffness_ratio / 3.0)),
            friction=settings.friction,
            wall_friction=settings.wall_friction,
            drag=drag,
            gravity_x=settings.gravity[0],
            gravity_y=settings.gravity[1],
        )
        self._side_length = SIDE_MARGIN * height
        self._skin = 0.1 * float(radius.min())
        self._pairs = _empty_pairs()
        self._wall_pairs = _empty_pairs()

    @property
    def time_scale(self) -> float:
        """√(m̄ / (pressure · length)) [s]: shear rate times this is the inertial number."""
        return float(np.sqrt(self.grains.mass.mean() / (self.settings.pressure * self.settings.length)))

    @property
    def position(self) -> Array:
        return self._bodies.state[:, :2].copy()

    @property
    def velocity(self) -> Array:
        """vx, vy [m/s] and spin [rad/s] (n, 3), half a step ago."""
        return self._bodies.state[:, 3:].copy()

    @property
    def shear(self) -> float:
        return float(self._bodies.frame[SHEAR])

    @property
    def height(self) -> float:
        return float(self._bodies.frame[HEIGHT])

    @property
    def unbalance(self) -> float:
        """Mean |ΣF| of a grain over the mean f_n of the closed contacts; infinite without one."""
        fn = np.concatenate([self._pairs.fn, self._wall_pairs.fn])
        if not np.any(fn > 0.0):
            return float("inf")
        gravity = self.grains.mass[:, None] * np.array(self.settings.gravity)
        resultant = np.linalg.norm(self._bodies.force[:, :2] + gravity, axis=1)
        return float(resultant.mean() / fn[fn > 0.0].mean())

    @property
    def touching(self) -> NDArray[np.bool_]:
        """Which grains have a closed contact (n,)."""
        touching = np.zeros(self.grains.count, dtype=np.bool_)
        closed = self._pairs.fn > 0.0
        touching[self._pairs.i[closed]] = True
        touching[self._pairs.j[closed]] = True
        touching[self._wall_pairs.i[self._wall_pairs.fn > 0.0]] = True
        return touching

    @property
    def plate_unbalance(self) -> float:
        """|normal force on the plate − load| / load; zero where the plate is held."""
        load = float(self._bodies.frame_constants[LOAD])
        if np.isnan(load):
            return 0.0
        return abs(float(self._wall_pairs.fn[self._wall_pairs.j == TOP].sum()) - load) / load

    def run(self, shear_rate: Array) -> None:
        """Take one time step per entry of shear_rate (steps,) [rad/s]."""
        done = 0
        while done < len(shear_rate):
            self._find_neighbours()
            done += advance(self._bodies, self._pairs, self._wall_pairs, self._law, shear_rate[done:], self._skin)

    def rest(self) -> int:
        """Hold the frame until grains and plate are in balance, or the pause limit; return the steps taken.

        Grains that touch nothing are stopped: they would come to rest in the minute between two real
        photographs, but nothing in the pause could take their motion from them.
        """
        chunk, taken = np.zeros(PAUSE_STEPS), 0
        while taken < self.settings.pause_limit:
            self.run(chunk)
            taken += len(chunk)
            self._bodies.state[~self.touching, 3:] = 0.0
            if self.unbalance < self.settings.rest and self.plate_unbalance < self.settings.rest:
                break
        return taken

    def shear_to(self, angle: float) -> None:
        """Bring the frame to a shear angle [rad]: start and stop gently, never above the inertial number."""
        fastest = self.settings.inertial_number / self.time_scale
        way = angle - self.shear
        steps = max(20, int(np.ceil(abs(way) / (fastest * self.time_step) / (1.0 - RAMP))))
        ramp = np.linspace(0.0, 1.0, int(RAMP * steps) + 1)
        profile = np.ones(steps)
        profile[: len(ramp)] = ramp
        profile[steps - len(ramp) :] = ramp[::-1]
        self.run(way / self.time_step * profile / profile.sum())

    def photograph(self, pause: int) -> DemFrame:
        """Copy out the present state; f_n, f_t include the dashpots, which are silent at rest."""
        pairs, walls, n = self._pairs, self._wall_pairs, self.grains.count
        i = np.concatenate([pairs.i, walls.i])
        j = np.concatenate([pairs.j, walls.j + np.int32(n)])
        fn = np.concatenate([pairs.fn, walls.fn])
        ft = np.concatenate([pairs.ft, walls.ft])
        order = np.lexsort((j, i))
        order = order[fn[order] > 0.0]
        return DemFrame(
            position=self.position,
            rotation=self._bodies.state[:, 2].copy(),
            endpoints=self.endpoints,
            i=i[order], j=j[order], fn=fn[order], ft=ft[order],
            unbalance=self.unbalance,
            plate_unbalance=self.plate_unbalance,
            shear=self.shear,
            pause=pause,
        )  # fmt: skip

    @property
    def endpoints(self) -> Array:
        """The walls (4, 2, 2) [m], counter-clockwise from the bottom; all keep their lengths, the sides stand out."""
        shear, height = self.shear, self.height
        slant = self._side_length * np.array([np.sin(shear), np.cos(shear)])
        left, right = np.zeros(2), np.array([self._bodies.frame_constants[WIDTH], 0.0])
        top = np.array([height * np.tan(shear), height])
        return np.array([[left, right], [right, right + slant], [top + right, top], [left + slant, left]])

    def _find_neighbours(self) -> None:
        position, radius = self.position, self.grains.radius
        pairs = KDTree(position).query_pairs(2.0 * radius.max() + self._skin, output_type="ndarray")
        i, j = pairs.min(axis=1), pairs.max(axis=1)
        near = np.linalg.norm(position[j] - position[i], axis=1) < radius[i] + radius[j] + self._skin
        i, j = i[near], j[near]
        mass = self.grains.mass
        self._pairs = self._carry_over(self._pairs, i, j, mass[i] * mass[j] / (mass[i] + mass[j]))
        walls = self.endpoints
        along = walls[:, 1] - walls[:, 0]
        along /= np.linalg.norm(along, axis=1)[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        distance = np.einsum("nwk,wk->nw", walls[None, :, 0] - position[:, None], outward)
        i, j = np.nonzero(distance < radius[:, None] + self._skin)
        self._wall_pairs = self._carry_over(self._wall_pairs, i, j, mass[i])

    def _carry_over(self, old: Pairs, i: NDArray[np.int64], j: NDArray[np.int64], mass: Array) -> Pairs:
        """Make the pair list i, j with reduced masses [kg], in ascending order, with the springs of the old one."""
        base = self.grains.count + len(WALL_NAMES)
        key = i * base + j
        order = np.argsort(key)
        i, j, key, mass = i[order], j[order], key[order], mass[order]
        damping = 2.0 * self.settings.damping_ratio * np.sqrt(self.settings.normal_stiffness * mass)
        new = Pairs(i.astype(np.int32), j.astype(np.int32), damping, *np.zeros((3, len(i))))
        _, row, old_row = np.intersect1d(
            key, old.i.astype(np.int64) * base + old.j, assume_unique=True, return_indices=True
        )
        for name in ("spring", "fn", "ft"):
            getattr(new, name)[row] = getattr(old, name)[old_row]
        return new


def shear_photographs(cell: ShearCell, angles: Array) -> Iterator[DemFrame]:
    """Bring the cell to each shear angle (f,) [rad] in turn and photograph it at rest.

    The frame stands still before every photograph until the packing is in balance, as it would at
    the real experiment's rate, which is thousands of times slower.
    """
    for angle in angles:
        if angle != cell.shear:
            cell.shear_to(float(angle))
        yield cell.photograph(cell.rest())


def _empty_pairs() -> Pairs:
    none = np.empty(0, np.int32)
    return Pairs(none, none, *np.empty((4, 0)))
