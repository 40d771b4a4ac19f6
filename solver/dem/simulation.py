"""Explicit discrete-element simulation of a packing: the truth of synthetic experiments.

Discs (rods seen end on) inside a boundary; at every contact a linear normal spring with a dashpot, and a tangential
spring with history, cut at the Coulomb limit (Cundall & Strack 1979). Energy is dissipated only in the contacts, on the
base and in the dashpots of the plates, except for the drag of a preparation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.grains import Array, Grains
from ..bodies.strain import inertial_time
from .boundaries import LOAD, Boundary
from .contact_law import Law
from .dem_truth import DemFrame, DemSettings
from .time_step import DemBodies, DemPairs, advance

RAMP = 0.3  # fraction of a motion spent on acceleration, and on deceleration
PAUSE_STEPS = 250  # between checks of the equilibrium


class Simulation(ABC):
    """A packing and its boundary, advanced in time. Changes in place; all returned arrays are copies."""

    drive_columns: ClassVar[int]  # of `run`

    def __init__(
        self,
        grains: Grains,
        position: Array,
        boundary: Boundary,
        *,
        settings: DemSettings,
        velocity: Array | None = None,
        drag: float = 0.0,
        axis: Array | None = None,
    ) -> None:
        """Place grains at position (n, 2) [m] with velocity (n, 3) [m/s, m/s, rad/s], at rest by default.

        drag [1/s] slows every grain: for the preparation of a packing only. axis (n,) [rad]: directions of the greatest
        radii of elliptic sections, random by default.

        Raises
        ------
        ValueError
            The sections are elliptic and a wall is not flat.
        """
        if settings.ovality > 0.0 and not self._flat_walls(boundary):
            raise ValueError("elliptic sections are simulated between flat walls only")
        n = grains.count
        self.settings = settings
        self.grains = grains
        state = np.zeros((n, 6))
        state[:, :2] = position
        if velocity is not None:
            state[:, 3:] = velocity
        self.time_step = settings.time_step_factor * float(np.sqrt(grains.mass.min() / settings.normal_stiffness))
        base_limit = settings.base_drag * grains.mass
        # ±√2: a contact's mean of two grains varies by the spread, whatever the radii
        sign = np.where(np.random.default_rng(n).permutation(n) % 2 == 0, 1.0, -1.0)
        self._bodies = DemBodies(
            state, np.zeros((n, 3)), grains.radius, grains.mass, np.zeros((n, 3)), base_limit,
            np.maximum(1.0 + np.sqrt(2.0) * settings.friction_spread * sign, 0.0), np.zeros((n, 2)),
            np.random.default_rng(n).uniform(0.0, np.pi, n) if axis is None else axis.copy(),
        )  # fmt: skip
        self._law = Law(
            time_step=self.time_step,
            normal_stiffness=settings.normal_stiffness,
            tangential_stiffness=settings.stiffness_ratio * settings.normal_stiffness,
            # The same damping ratio along t, where a contact of two solid rods has a third of the mass.
            tangential_damping=float(np.sqrt(settings.stiffness_ratio / 3.0)),
            friction=settings.friction,
            wall_friction=settings.wall_friction,
            rolling_friction=settings.rolling_friction,
            adhesion=settings.adhesion,
            ovality=settings.ovality,
            drag=drag,
            gravity_x=settings.gravity[0],
            gravity_y=settings.gravity[1],
        )
        self._boundary = boundary
        self._skin = 0.1 * float(grains.radius.min())
        none = np.empty(0, np.int32)
        self._pairs = self._wall_pairs = DemPairs(none, none, np.empty((0, 2), np.int64), *np.empty((5, 0)))

    @property
    def position(self) -> Array:
        """Centres (n, 2) [m], not wrapped into a cell."""
        return self._bodies.state[:, :2].copy()

    @property
    def axis(self) -> Array:
        """Directions of the greatest radii of elliptic sections (n,) [rad]."""
        return self._bodies.axis + self._bodies.state[:, 2]

    @property
    def velocity(self) -> Array:
        """vx, vy [m/s] and spin [rad/s] (n, 3), half a step earlier, without the homogeneous motion of a cell."""
        return self._bodies.state[:, 3:].copy()

    @property
    @abstractmethod
    def endpoints(self) -> Array:
        """The walls (w, 2, 2) [m]."""

    @property
    @abstractmethod
    def area(self) -> float:
        """Area between the boundaries [m²]."""

    @property
    @abstractmethod
    def shear(self) -> float:
        """Shear of the boundary; see DemFrame."""

    @property
    def vectors(self) -> Array | None:
        """Vectors (2, 2) [m] of a periodic cell; None without one."""
        return None

    @property
    @abstractmethod
    def plate_unbalance(self) -> float:
        """Relative difference of force and load of the plates, or of the pressure of a cell."""

    @property
    def plate_tolerance(self) -> float:
        """Greatest `plate_unbalance` at rest."""
        return self.settings.rest

    @property
    def time_scale(self) -> float:
        """The inertial number over the shear rate [s].

        The pressure is that of the settings or, where they have none, that of the contacts at present.
        """
        pressure = self.settings.pressure if np.isfinite(self.settings.pressure) else self.pressure
        return inertial_time(self.grains.mass.mean(), pressure, self.settings.length)

    @property
    def pressure(self) -> float:
        """Half the trace of the stress of the normal forces [Pa]."""
        radius, pairs, walls = self.grains.radius, self._pairs, self._wall_pairs
        work = pairs.fn @ (radius[pairs.i] + radius[pairs.j]) + walls.fn @ radius[walls.i]
        return float(work) / (2.0 * self.area * self.settings.length)

    @property
    def unbalance(self) -> float:
        """Mean |ΣF| of a grain over the mean f_n of the closed contacts; infinite without a contact."""
        fn = np.concatenate([self._pairs.fn, self._wall_pairs.fn])
        if not np.any(fn > 0.0):
            return float("inf")
        gravity = self.grains.mass[:, None] * np.array([self._law.gravity_x, self._law.gravity_y])
        resultant = np.linalg.norm(self._bodies.force[:, :2] + self._bodies.external + gravity, axis=1)
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

    def run(self, drive: Array) -> None:
        """Advance by one time step per row of drive (steps, d), the imposed rates of the boundary.

        drive (steps,): the first rate alone, all others zero.
        """
        if drive.ndim == 1:
            drive = np.column_stack([drive, np.zeros((len(drive), self.drive_columns - 1))])
        done = 0
        while done < len(drive):
            self._find_neighbours()
            done += advance(
                self._bodies, self._pairs, self._wall_pairs, self._law, self._boundary, drive[done:], self._skin
            )

    def tilt(self, angle: float) -> None:
        """Turn gravity clockwise by an angle [rad] from the settings' direction, as in a box that tilts."""
        x, y = self.settings.gravity
        cosine, sine = float(np.cos(angle)), float(np.sin(angle))
        self._law = self._law._replace(gravity_x=cosine * x + sine * y, gravity_y=cosine * y - sine * x)

    def rest(self, unbalance: float | None = None) -> int:
        """Hold the boundary until grains and plates are in equilibrium, or the pause limit; return the steps done.

        Grains without contact are stopped: nothing dissipates their motion during the pause. unbalance: the value to
        reach, that of the settings by default.
        """
        if self.settings.moving:
            return 0
        required = self.settings.rest if unbalance is None else unbalance
        pause, done = np.zeros(PAUSE_STEPS), 0
        while done < self.settings.pause_limit:
            self.run(pause)
            done += len(pause)
            self._bodies.state[~self.touching, 3:] = 0.0
            if self.unbalance < required and self.plate_unbalance < self.plate_tolerance:
                break
        return done

    def photograph(self, pause: int) -> DemFrame:
        """Copy the present state; f_n, f_t include the dashpots, which vanish at rest."""
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
            cell=self.vectors,
        )  # fmt: skip

    def _move(self, displacement: Array, strain: float) -> None:
        """Move the boundary by displacements (d,) with a smooth start and end, below the greatest inertial number."""
        fastest = self.settings.inertial_number / self.time_scale
        steps = max(20, int(np.ceil(strain / (fastest * self.time_step) / (1.0 - RAMP))))
        ramp = np.linspace(0.0, 1.0, int(RAMP * steps) + 1)
        profile = np.ones(steps)
        profile[: len(ramp)] = ramp
        profile[steps - len(ramp) :] = ramp[::-1]
        if self.settings.moving:
            profile[:] = 1.0
        self.run(displacement / self.time_step * profile[:, None] / profile.sum())

    @property
    def _greatest_radius(self) -> Array:
        """Radii (n,) [m] of the circles around the sections, whatever their rotations."""
        return self.grains.radius * (1.0 + self.settings.ovality)

    @staticmethod
    def _flat_walls(boundary: Boundary) -> bool:
        """Whether every wall is a straight bar."""
        return False

    def _find_neighbours(self) -> None:
        mass = self.grains.mass
        i, j, image = self._pair_neighbours()
        self._pairs = self._keep_springs(self._pairs, i, j, image, mass[i] * mass[j] / (mass[i] + mass[j]))
        i, j = self._wall_neighbours()
        image = np.zeros((len(i), 2), np.int64)
        self._wall_pairs = self._keep_springs(self._wall_pairs, i, j, image, mass[i])

    def _pair_neighbours(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Return pairs i < j of grains that may touch before the next search, and the images (p, 2) of j."""
        position, radius = self.position, self._greatest_radius
        pairs = KDTree(position).query_pairs(2.0 * radius.max() + self._skin, output_type="ndarray")
        i, j = pairs.min(axis=1), pairs.max(axis=1)
        near = np.linalg.norm(position[j] - position[i], axis=1) < radius[i] + radius[j] + self._skin
        return i[near], j[near], np.zeros((int(near.sum()), 2), np.int64)

    def _wall_neighbours(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return grains and walls that may touch before the next search."""
        i, wall = np.nonzero(self._wall_distance(self.position) < self._greatest_radius[:, None] + self._skin)
        return i, wall

    @abstractmethod
    def _wall_distance(self, position: Array) -> Array:
        """Return the distance (n, w) [m] of points (n, 2) [m] from the walls."""

    def _keep_springs(
        self, former: DemPairs, i: NDArray[np.int64], j: NDArray[np.int64], image: NDArray[np.int64], mass: Array
    ) -> DemPairs:
        """Make the list of pairs i, j with reduced masses [kg], in ascending order, with the springs of the former."""
        base = self.grains.count + len(self.endpoints)
        key = i * base + j
        order = np.argsort(key)
        i, j, key, mass = i[order], j[order], key[order], mass[order]
        damping = 2.0 * self.settings.damping_ratio * np.sqrt(self.settings.normal_stiffness * mass)
        pairs = DemPairs(i.astype(np.int32), j.astype(np.int32), image[order], damping, *np.zeros((4, len(i))))
        former_key = former.i.astype(np.int64) * base + former.j
        _, row, former_row = np.intersect1d(key, former_key, assume_unique=True, return_indices=True)
        for name in ("spring", "roll", "fn", "ft"):
            getattr(pairs, name)[row] = getattr(former, name)[former_row]
        return pairs

    def _force_on(self, wall: int) -> float:
        """Return the sum of the normal forces on a wall [N]."""
        return float(self._wall_pairs.fn[self._wall_pairs.j == wall].sum())

    def _load_residual(self, row: int, wall: int) -> float:
        """Return |force − load| / load of a plate (row of the plates) and its wall; zero without load."""
        load = float(self._boundary.plates[row, LOAD])
        return abs(self._force_on(wall) - load) / load if np.isfinite(load) else 0.0


def plate_constants(grains: Grains, settings: DemSettings, length: float, load: float) -> Array:
    """Return mass [kg], load [N] and damping [N s/m] (3,) of a plate of a length [m]; load NaN: driven."""
    mean_mass = float(grains.mass.mean())
    diameter = 2.0 * float(grains.radius.mean())
    # Rows of grains along a plate, each with the impedance √(stiffness · mass).
    impedance = np.sqrt(settings.normal_stiffness * mean_mass)
    damping = settings.plate_damping * (length / diameter * impedance)
    return np.array([2.0 * mean_mass * length / diameter, load, damping])
