"""Explicit discrete-element simulation of a packing in a shear frame: the truth of synthetic experiments.

Discs (rods seen end on) and four straight walls; at every contact a linear normal spring with a
dashpot, and a tangential spring with history, cut at Coulomb's limit (Cundall & Strack 1979).
The frame is that of the 1γ2ε device: bottom fixed, sides turning about the bottom corners, a
plate on top that moves sideways with the sides, and a right side that can be moved along the bottom.
The plate carries a constant pressure unless it is driven; the right side can carry a load instead of being driven.
While the frame moves nothing is dissipated but in the contacts, on the base and in the plates' own dashpots.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array, Grains
from solver.dem.kernels import HEIGHT, LOAD, RIGHT, SHEAR, TOP, WIDTH, Bodies, Law, Pairs, advance
from solver.dem.truth import WALL_NAMES, DemFrame, DemSettings, DemTruth, UnbalancedError

__all__ = ["DemFrame", "DemSettings", "DemTruth", "ShearCell", "UnbalancedError", "shear_photographs"]

RAMP = 0.3  # part of a motion spent on speeding up, and on slowing down
LOAD_STEPS = 40  # in which a load is changed
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
        span: float | None = None,
    ) -> None:
        """Place grains of radius (n,) [m] at position (n, 2) [m] in a frame of width × height [m].

        velocity (n, 3) [m/s, m/s, rad/s]: at rest unless given. drag [1/s] slows every grain: for
        the preparation of a packing only. span [m]: length of the bars at bottom and top, the width unless given;
        longer where the right side will move outwards.
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
        # Rows of grains along a plate, each with the impedance √(stiffness · mass).
        impedance = np.sqrt(settings.normal_stiffness * mean_mass)
        plates = np.array([
            [2.0 * mean_mass * length / diameter, load, settings.plate_damping * (length / diameter * impedance)]
            for length, load in ((width, settings.pressure * width * settings.length), (height, np.nan))
        ])  # fmt: skip
        self._bodies = Bodies(
            state, np.zeros((n, 3)), self.grains.radius, self.grains.mass, np.array([0.0, height, 0.0, width, 0.0]),
            plates, np.zeros((n, 3)), settings.base_friction * self.grains.mass,
        )  # fmt: skip
        tangential = settings.stiffness_ratio * settings.normal_stiffness
        self._law = Law(
            time_step=self.time_step,
            normal_stiffness=settings.normal_stiffness,
            tangential_stiffness=tangential,
            # The same damping ratio along t, where a contact of two solid rods has a third of the mass.
            tangential_damping=float(np.sqrt(settings.stiffness_ratio / 3.0)),
            friction=settings.friction,
            wall_friction=settings.wall_friction,
            rolling_friction=settings.rolling_friction,
            drag=drag,
            gravity_x=settings.gravity[0],
            gravity_y=settings.gravity[1],
        )
        self._side_length = SIDE_MARGIN * height
        self._span = width if span is None else span
        self._skin = 0.1 * float(radius.min())
        self._pairs = _empty_pairs()
        self._wall_pairs = _empty_pairs()

    @property
    def time_scale(self) -> float:
        """√(m̄ / (pressure · length)) [s]: shear rate times this is the inertial number.

        The pressure is the plate's; where it carries none, that of the contacts at present.
        """
        pressure = self.settings.pressure if np.isfinite(self.settings.pressure) else self.pressure
        return float(np.sqrt(self.grains.mass.mean() / (pressure * self.settings.length)))

    @property
    def pressure(self) -> float:
        """Half the trace of the stress that the normal forces carry [Pa]."""
        radius, pairs, walls = self.grains.radius, self._pairs, self._wall_pairs
        work = pairs.fn @ (radius[pairs.i] + radius[pairs.j]) + walls.fn @ radius[walls.i]
        return float(work) / (2.0 * self.width * self.height * self.settings.length)

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
    def width(self) -> float:
        return float(self._bodies.frame[WIDTH])

    @property
    def side_length(self) -> float:
        """Of the bars at both sides [m]."""
        return self._side_length

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
        """|normal force on a plate − load| / load, of the worse one; zero where no plate is loaded."""
        walls, worst = self._wall_pairs, 0.0
        for wall, load in zip((TOP, RIGHT), self._bodies.plates[:, LOAD], strict=True):
            if np.isfinite(load):
                worst = max(worst, abs(float(walls.fn[walls.j == wall].sum()) - load) / load)
        return worst

    def run(self, drive: Array) -> None:
        """Take one time step per row of drive (steps, 3).

        Columns: shear rate [rad/s]; velocities of the plate (up) and of the right side (outwards) [m/s], that of one
        under load being passed over. drive (steps,) is the shear rate alone, all else held.
        """
        if drive.ndim == 1:
            drive = np.column_stack([drive, np.zeros((len(drive), 2))])
        done = 0
        while done < len(drive):
            self._find_neighbours()
            done += advance(self._bodies, self._pairs, self._wall_pairs, self._law, drive[done:], self._skin)

    def rest(self) -> int:
        """Hold the frame until grains and plates are in balance, or the pause limit; return the steps taken.

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
        self.move_to(shear=angle)

    def move_to(self, *, shear: float | None = None, height: float | None = None, width: float | None = None) -> None:
        """Bring the frame to a shear angle [rad], a height and a width [m], all at once; what is not given stays.

        Start and stop gently, never above the inertial number. A plate under load goes where the load brings it.
        """
        way = np.array([
            0.0 if shear is None else shear - self.shear,
            0.0 if height is None else height - self.height,
            0.0 if width is None else width - self.width,
        ])  # fmt: skip
        strain = float(np.abs(way / np.array([1.0, self.height, self.width])).max())
        fastest = self.settings.inertial_number / self.time_scale
        steps = max(20, int(np.ceil(strain / (fastest * self.time_step) / (1.0 - RAMP))))
        ramp = np.linspace(0.0, 1.0, int(RAMP * steps) + 1)
        profile = np.ones(steps)
        profile[: len(ramp)] = ramp
        profile[steps - len(ramp) :] = ramp[::-1]
        self.run(way / self.time_step * profile[:, None] / profile.sum())

    def load(self, *, top: float | None = None, side: float | None = None) -> None:
        """Bring the loads on the plate and on the right side [N] gently to these; what is not given stays.

        A plate that was driven begins with the force that the packing has on it. NaN: it is driven from now on.
        """
        walls, plates = self._wall_pairs, self._bodies.plates
        start, end = plates[:, LOAD].copy(), plates[:, LOAD].copy()
        for row, (wall, wanted) in enumerate(((TOP, top), (RIGHT, side))):
            if wanted is None:
                continue
            end[row] = wanted
            if np.isnan(start[row]):
                start[row] = walls.fn[walls.j == wall].sum()
        for share in np.linspace(0.0, 1.0, LOAD_STEPS + 1)[1:]:
            plates[:, LOAD] = np.where(start == end, end, start + share * (end - start))
            self.run(np.zeros(PAUSE_STEPS))

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
        left, right, end = np.zeros(2), np.array([self.width, 0.0]), np.array([self._span, 0.0])
        top = np.array([height * np.tan(shear), height])
        return np.array([[left, end], [right, right + slant], [top + end, top], [left + slant, left]])

    def _find_neighbours(self) -> None:
        position, radius = self.position, self.grains.radius
        pairs = KDTree(position).query_pairs(2.0 * radius.max() + self._skin, output_type="ndarray")
        i, j = pairs.min(axis=1), pairs.max(axis=1)
        near = np.linalg.norm(position[j] - position[i], axis=1) < radius[i] + radius[j] + self._skin
        i, j = i[near], j[near]
        mass = self.grains.mass
        self._pairs = self._carry_over(self._pairs, i, j, mass[i] * mass[j] / (mass[i] + mass[j]))
        i, j = self._wall_neighbours(position)
        self._wall_pairs = self._carry_over(self._wall_pairs, i, j, mass[i])

    def _wall_neighbours(self, position: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Grains and walls that may touch before neighbours are looked for again."""
        walls = self.endpoints
        along = walls[:, 1] - walls[:, 0]
        along /= np.linalg.norm(along, axis=1)[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        distance = np.einsum("nwk,wk->nw", walls[None, :, 0] - position[:, None], outward)
        i, wall = np.nonzero(distance < self.grains.radius[:, None] + self._skin)
        return i, wall

    def _carry_over(self, old: Pairs, i: NDArray[np.int64], j: NDArray[np.int64], mass: Array) -> Pairs:
        """Make the pair list i, j with reduced masses [kg], in ascending order, with the springs of the old one."""
        base = self.grains.count + len(WALL_NAMES)
        key = i * base + j
        order = np.argsort(key)
        i, j, key, mass = i[order], j[order], key[order], mass[order]
        damping = 2.0 * self.settings.damping_ratio * np.sqrt(self.settings.normal_stiffness * mass)
        new = Pairs(i.astype(np.int32), j.astype(np.int32), damping, *np.zeros((4, len(i))))
        _, row, old_row = np.intersect1d(
            key, old.i.astype(np.int64) * base + old.j, assume_unique=True, return_indices=True
        )
        for name in ("spring", "roll", "fn", "ft"):
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
    return Pairs(none, none, *np.empty((5, 0)))
