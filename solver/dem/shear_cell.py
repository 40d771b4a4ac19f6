"""A packing in a shear frame: four straight walls that move as the linkage of the 1γ2ε device.

The bottom is fixed and the sides rotate about the bottom corners. The plate on top moves sideways with the sides; it
carries a constant pressure unless it is driven. The right side can move along the bottom, driven or under a load.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, NamedTuple

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.wall_shapes import OUT, STRAIGHT, circle_ends, wall_distance
from .boundaries import (
    DISC_RADIUS,
    FRAME,
    HEIGHT,
    LOAD,
    RIGHT,
    SHEAR,
    TOP,
    TOP_LEFT,
    TOP_RIGHT,
    WIDTH,
    Boundary,
)
from .dem_truth import DemFrame, DemSettings
from .simulation import PAUSE_STEPS, Simulation, plate_constants

CORNER_NAMES = ("bottom-left", "bottom-right", "top-right", "top-left")  # of the discs
CORNERED_SIDES = np.array([STRAIGHT] * 4 + [OUT] * 4, np.int8)  # bars, then discs
LOAD_STEPS = 40  # in which a load is changed
SIDE_MARGIN = 1.12  # length of the sides over the first height, for dilation and for the slant at 15°


class FrameSize(NamedTuple):
    """Size of a shear frame [m]."""

    width: float
    height: float
    # Of the bars at bottom and top, the width by default; longer where the right side moves outwards.
    span: float | None = None
    corner_radius: float = 0.0  # of discs where the bars meet; 0: none


class ShearCell(Simulation):
    """A packing in a shear frame.

    Columns of the drive: shear rate [rad/s]; velocities of the plate (up) and of the right side (outwards) [m/s], each
    ignored where the wall is under load.
    """

    drive_columns: ClassVar[int] = 3

    def __init__(
        self,
        radius: Array,
        position: Array,
        frame: FrameSize,
        settings: DemSettings,
        *,
        velocity: Array | None = None,
        drag: float = 0.0,
        axis: Array | None = None,
    ) -> None:
        """Place grains in a rectangular frame.

        Parameters
        ----------
        radius : (n,)
            Radii [m].
        position : (n, 2)
            Centres [m].
        frame
            Its size at the start.
        settings
            Material, load and numerics.
        velocity : (n, 3), optional
            Velocities and spins [m/s, m/s, rad/s]; at rest by default.
        drag
            Damping rate of every grain [1/s], for the preparation of a packing only.
        axis : (n,), optional
            Directions of the greatest radii of elliptic sections [rad]; random by default.
        """
        width, height = frame.width, frame.height
        grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        plates = np.array([
            plate_constants(grains, settings, width, settings.pressure * width * settings.length),
            plate_constants(grains, settings, height, np.nan),
        ])  # fmt: skip
        boundary = Boundary(FRAME, np.array([0.0, height, 0.0, width, 0.0, frame.corner_radius]), plates, np.zeros(4))
        super().__init__(grains, position, boundary, settings=settings, velocity=velocity, drag=drag, axis=axis)
        self._side_length = SIDE_MARGIN * height
        self._span = width if frame.span is None else frame.span

    @property
    def shear(self) -> float:
        """Shear angle of the sides [rad]."""
        return float(self._boundary.state[SHEAR])

    @property
    def height(self) -> float:
        """Height of the plate [m]."""
        return float(self._boundary.state[HEIGHT])

    @property
    def width(self) -> float:
        """Distance of the right side from the left one along the bottom [m]."""
        return float(self._boundary.state[WIDTH])

    @property
    def area(self) -> float:
        """Area between the walls [m²]; four discs whose centres are the corners cover the area of one."""
        return self.width * self.height - np.pi * self.corner_radius**2

    @property
    def corner_radius(self) -> float:
        """Radius of the discs where the bars meet [m]; 0: there are none."""
        return float(self._boundary.state[DISC_RADIUS])

    @property
    def endpoints(self) -> Array:
        """The walls (w, 2, 2) [m], counter-clockwise from the bottom, of constant lengths; the sides extend upwards.

        Bars, then diameters of the discs, where there are any.
        """
        shear, height = self.shear, self.height
        slant = self._side_length * np.array([np.sin(shear), np.cos(shear)])
        left, right, end = np.zeros(2), np.array([self.width, 0.0]), np.array([self._span, 0.0])
        top = np.array([height * np.tan(shear), height])
        bars = np.array([[left, end], [right, right + slant], [top + end, top], [left + slant, left]])
        if self.corner_radius == 0.0:
            return bars
        discs = circle_ends(
            np.array([left, right, top + right, top]), np.full(4, self.corner_radius), np.zeros(4)
        )  # fmt: skip
        return np.concatenate([bars, discs])

    @property
    def plate_unbalance(self) -> float:
        """|normal force − load| / load of the plates, the greater one; zero where no plate is loaded."""
        return max(self._load_residual(row, wall) for row, wall in enumerate((TOP, RIGHT)))

    def shear_to(self, angle: float) -> None:
        """Move the frame to a shear angle [rad]; see `move_to`."""
        self.move_to(shear=angle)

    def move_to(self, *, shear: float | None = None, height: float | None = None, width: float | None = None) -> None:
        """Move the frame to a shear angle [rad], a height and a width [m], all at once; others are unchanged.

        The motion starts and stops smoothly, below the greatest inertial number. A plate under load follows its load.
        """
        displacement = np.array([
            0.0 if shear is None else shear - self.shear,
            0.0 if height is None else height - self.height,
            0.0 if width is None else width - self.width,
        ])  # fmt: skip
        strain = float(np.abs(displacement / np.array([1.0, self.height, self.width])).max())
        self._move(displacement, strain)

    def load(self, *, top: float | None = None, side: float | None = None) -> None:
        """Change the loads on the plate and on the right side [N] gradually; others are unchanged.

        The load of a driven plate starts from the force of the packing on it. NaN: the plate is driven from now on.
        """
        plates = self._boundary.plates
        start, end = plates[:, LOAD].copy(), plates[:, LOAD].copy()
        for row, (wall, load) in enumerate(((TOP, top), (RIGHT, side))):
            if load is None:
                continue
            end[row] = load
            if np.isnan(start[row]):
                start[row] = self._force_on(wall)
        for fraction in np.linspace(0.0, 1.0, LOAD_STEPS + 1)[1:]:
            plates[:, LOAD] = np.where(start == end, end, start + fraction * (end - start))
            self.run(np.zeros(PAUSE_STEPS))

    @property
    def plate_force(self) -> float:
        """Force of the packing on the plate [N], its discs included, normal to it."""
        pairs, force = self._wall_pairs, self._force_on(TOP)
        if self.corner_radius == 0.0:
            return force
        on_disc = (pairs.j == TOP_RIGHT) | (pairs.j == TOP_LEFT)
        disc = self.endpoints[pairs.j[on_disc]]
        _, normal = wall_distance(disc, np.full(len(disc), OUT), self.position[pairs.i[on_disc]])
        return force + float(pairs.fn[on_disc] @ normal[:, 1] + pairs.ft[on_disc] @ normal[:, 0])

    @staticmethod
    def _flat_walls(boundary: Boundary) -> bool:
        return bool(boundary.state[DISC_RADIUS] == 0.0)

    def _load_residual(self, row: int, wall: int) -> float:
        load = float(self._boundary.plates[row, LOAD])
        if wall != TOP or not np.isfinite(load):
            return super()._load_residual(row, wall)
        return abs(self.plate_force - load) / load

    def _wall_distance(self, position: Array) -> Array:
        walls = self.endpoints
        bars = walls[:4]
        along = bars[:, 1] - bars[:, 0]
        along /= np.linalg.norm(along, axis=1)[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        to_bars = np.einsum("nwk,wk->nw", bars[None, :, 0] - position[:, None], outward)
        if len(walls) == len(bars):
            return to_bars
        centre = walls[4:].mean(axis=1)
        to_discs = np.linalg.norm(position[:, None] - centre, axis=-1) - self.corner_radius
        return np.concatenate([to_bars, to_discs], axis=1)


def shear_photographs(cell: ShearCell, angles: Array) -> Iterator[DemFrame]:
    """Move the cell to each shear angle (f,) [rad] in turn and photograph it at rest.

    The frame stands still before every photograph until the packing is in equilibrium, as at the rate of the real
    experiment, which is thousands of times slower.
    """
    for angle in angles:
        if angle != cell.shear:
            cell.shear_to(float(angle))
        yield cell.photograph(cell.rest())
