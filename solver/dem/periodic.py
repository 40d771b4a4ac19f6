"""A packing in a periodic cell that shears and holds its pressure: the truth of experiments without walls.

The rods move with the cell, as in Lees & Edwards' simple shear, and among themselves; b shears over a. All directions
shrink or widen alike until half the trace of the stress is the pressure that is wanted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.cell import Cell
from solver.bodies.grains import Array, Grains
from solver.dem.kernels import Law
from solver.dem.periodic_kernels import PeriodicBodies, PeriodicPairs, Servo, advance_periodic
from solver.dem.truth import DemFrame, DemSettings

RAMP = 0.3  # part of a motion spent on speeding up, and on slowing down
PAUSE_STEPS = 250  # between two looks at the balance
RESPONSE = 300.0  # steps in which the servo takes off a difference of pressure, were the packing a solid
FASTEST = 3e-6  # strain of a step, the servo's greatest
HELD = 1e-3  # relative difference of pressure at rest


class PeriodicCell:
    """A packing in its cell, advanced in time. Changes in place; everything it hands out is a copy."""

    def __init__(
        self, radius: Array, position: Array, vectors: Array, *, settings: DemSettings, drag: float = 0.0
    ) -> None:
        """Place grains of radius (n,) [m] at position (n, 2) [m] in a cell of vectors (2, 2) [m], at rest.

        drag [1/s] slows every grain: for the preparation of a packing only.
        """
        n = len(radius)
        self.settings = settings
        self.grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        state = np.zeros((n, 6))
        state[:, :2] = position
        self.time_step = settings.time_step_factor * float(np.sqrt(self.grains.mass.min() / settings.normal_stiffness))
        self._bodies = PeriodicBodies(
            state, np.zeros((n, 3)), self.grains.radius, self.grains.mass, vectors.astype(np.float64), np.zeros(1)
        )
        self._law = Law(
            time_step=self.time_step,
            normal_stiffness=settings.normal_stiffness,
            tangential_stiffness=settings.stiffness_ratio * settings.normal_stiffness,
            tangential_damping=float(np.sqrt(settings.stiffness_ratio / 3.0)),
            friction=settings.friction, wall_friction=settings.wall_friction, rolling_friction=0.0, drag=drag,
            gravity_x=0.0, gravity_y=0.0,
        )  # fmt: skip
        bulk = settings.normal_stiffness / settings.length  # [Pa] nearly that of a dense packing
        self._servo = Servo(
            settings.pressure, RESPONSE * self.time_step * bulk, FASTEST / self.time_step, settings.length
        )
        self._skin = 0.1 * float(radius.min())
        none = np.empty(0, np.int32)
        self._pairs = PeriodicPairs(none, none, np.empty((0, 2), np.int64), *np.empty((4, 0)))

    @property
    def position(self) -> Array:
        """Centres (n, 2) [m], not wrapped."""
        return self._bodies.state[:, :2].copy()

    @property
    def vectors(self) -> Array:
        """Vectors a and b of the cell (2, 2) [m]."""
        return self._bodies.cell.copy()

    @property
    def pressure(self) -> float:
        """Half the trace of the stress that the normal forces carry [Pa]."""
        return float(self._bodies.pressure[0])

    @property
    def shear(self) -> float:
        """How far b leans over a, of its height."""
        return float(self._bodies.cell[1, 0] / self._bodies.cell[1, 1])

    @property
    def unbalance(self) -> float:
        """Mean |ΣF| of a grain over the mean f_n of the closed contacts; infinite without one."""
        fn = self._pairs.fn
        if not np.any(fn > 0.0):
            return float("inf")
        return float(np.linalg.norm(self._bodies.force[:, :2], axis=1).mean() / fn[fn > 0.0].mean())

    def run(self, drive: Array) -> None:
        """Take one time step per shear rate of drive (steps,) [1/s]."""
        done = 0
        while done < len(drive):
            self._find_neighbours()
            done += advance_periodic(self._bodies, self._pairs, self._law, self._servo, drive[done:], self._skin)

    def rest(self, unbalance: float | None = None) -> int:
        """Do not shear until the packing is in balance under its pressure, or the pause limit; the steps taken."""
        wanted = self.settings.rest if unbalance is None else unbalance
        chunk, taken = np.zeros(PAUSE_STEPS), 0
        while taken < self.settings.pause_limit:
            self.run(chunk)
            taken += len(chunk)
            self._bodies.state[~self._touching, 3:] = 0.0
            if self.unbalance < wanted and abs(self.pressure / self.settings.pressure - 1.0) < HELD:
                break
        return taken

    def shear_to(self, shear: float) -> None:
        """Bring the cell to a shear: start and stop gently, never above the inertial number."""
        way = shear - self.shear
        scale = float(np.sqrt(self.grains.mass.mean() / (self.settings.pressure * self.settings.length)))
        fastest = self.settings.inertial_number / scale
        steps = max(20, int(np.ceil(abs(way) / (fastest * self.time_step) / (1.0 - RAMP))))
        ramp = np.linspace(0.0, 1.0, int(RAMP * steps) + 1)
        profile = np.ones(steps)
        profile[: len(ramp)] = ramp
        profile[steps - len(ramp) :] = ramp[::-1]
        self.run(way / self.time_step * profile / profile.sum())

    def photograph(self, pause: int) -> DemFrame:
        """Copy out the present state; f_n, f_t include the dashpots, which are silent at rest."""
        pairs = self._pairs
        rows = np.flatnonzero(pairs.fn > 0.0)
        return DemFrame(
            position=self.position, rotation=self._bodies.state[:, 2].copy(), endpoints=np.empty((0, 2, 2)),
            i=pairs.i[rows], j=pairs.j[rows], fn=pairs.fn[rows], ft=pairs.ft[rows], unbalance=self.unbalance,
            plate_unbalance=abs(self.pressure / self.settings.pressure - 1.0), shear=self.shear, pause=pause,
            cell=self.vectors,
        )  # fmt: skip

    @property
    def _touching(self) -> NDArray[np.bool_]:
        closed = self._pairs.fn > 0.0
        return np.isin(np.arange(self.grains.count), np.append(self._pairs.i[closed], self._pairs.j[closed]))

    def _find_neighbours(self) -> None:
        position, radius, cell = self.position, self.grains.radius, Cell.at_rest(self.vectors)
        place, owner = cell.with_surroundings(position, 2.0 * radius.max() + self._skin)
        found = owner[KDTree(place).query_pairs(2.0 * radius.max() + self._skin, output_type="ndarray")]
        key = np.unique(found.min(axis=1) * len(radius) + found.max(axis=1))
        i, j = key // len(radius), key % len(radius)
        apart = position[j] - position[i]
        shift = cell.shift(apart)
        near = (np.linalg.norm(apart + shift, axis=1) < radius[i] + radius[j] + self._skin) & (i < j)
        i, j, key = i[near], j[near], key[near]
        mass = self.grains.mass[i] * self.grains.mass[j] / (self.grains.mass[i] + self.grains.mass[j])
        damping = 2.0 * self.settings.damping_ratio * np.sqrt(self.settings.normal_stiffness * mass)
        image = np.rint(shift[near] @ np.linalg.inv(cell.vectors)).astype(np.int64)
        new = PeriodicPairs(i.astype(np.int32), j.astype(np.int32), image, damping, *np.zeros((3, len(i))))
        old = self._pairs
        former = old.i.astype(np.int64) * len(radius) + old.j
        _, row, old_row = np.intersect1d(key, former, assume_unique=True, return_indices=True)
        for name in ("spring", "fn", "ft"):
            getattr(new, name)[row] = getattr(old, name)[old_row]
        self._pairs = new
