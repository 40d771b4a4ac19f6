"""A packing in a box of two halves, of which the upper one slides with the plate, and a tool that is moved inside it.

The direct shear box is this box without a tool. Without a split it is a bed that a bar, a footing, or a disc, an
intruder, is pushed into.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..bodies.wall_shapes import OUT, STRAIGHT, circle_ends
from .boundaries import (
    BOX,
    HEIGHT,
    SLIDE,
    SPLIT,
    TOOL,
    TOOL_RADIUS,
    TOOL_WIDTH,
    TOOL_X,
    TOOL_Y,
    TOP,
    Boundary,
    box_distance,
)
from .dem_truth import DemSettings
from .simulation import Simulation, plate_constants

BOX_NAMES = ("bottom", "right", "top", "left", "upper-right", "upper-left", "tool")
SIDE_MARGIN = 1.12  # height of the sides over that of the plate


class Tool(NamedTuple):
    """A body that is moved inside the box [m]: a flat bar that faces down, or a disc."""

    x: float
    y: float
    width: float = 0.0  # of the bar; 0: a disc
    radius: float = 0.0  # of the disc; 0: a bar


class BoxSize(NamedTuple):
    """Size of a box [m]."""

    width: float
    height: float  # of the plate
    split: float = float("inf")  # height at which the upper half begins; infinite: the sides are whole


class BoxCell(Simulation):
    """A packing in a box; the pressure of the settings is that of the plate, NaN: it is driven.

    Columns of the drive: velocities [m/s] of the upper half (sideways), of the plate (up; ignored where it is under
    load), and of the tool (x, y).
    """

    drive_columns: ClassVar[int] = 4

    def __init__(
        self, radius: Array, position: Array, size: BoxSize, settings: DemSettings, *, tool: Tool | None = None
    ) -> None:
        """Place grains of radii (n,) and centres (n, 2) [m] in a box; without a tool, one without size lies outside."""
        grains = Grains.of_rods(radius, density=settings.density, length=settings.length)
        width, height, split = size
        tool = Tool(0.0, -1e3, radius=1e-3) if tool is None else tool
        plates = np.array([
            plate_constants(grains, settings, width, settings.pressure * width * settings.length),
            plate_constants(grains, settings, width, np.nan),
        ])  # fmt: skip
        state = np.array([0.0, height, 0.0, width, split, *tool])
        super().__init__(grains, position, Boundary(BOX, state, plates, np.zeros(4)), settings=settings)
        self._width, self._side_height = width, SIDE_MARGIN * height

    @property
    def shear(self) -> float:
        """Displacement of the upper half over the height."""
        return float(self._boundary.state[SLIDE]) / self.height

    @property
    def width(self) -> float:
        """Distance of the sides [m]."""
        return self._width

    @property
    def height(self) -> float:
        """Height of the plate [m]."""
        return float(self._boundary.state[HEIGHT])

    @property
    def area(self) -> float:
        """Area of both halves [m²]; the tool is part of it."""
        return self._width * self.height

    @property
    def sides(self) -> NDArray[np.int8]:
        """Shapes of the walls (7,)."""
        shape = np.full(TOOL + 1, STRAIGHT, np.int8)
        shape[TOOL] = OUT if self._boundary.state[TOOL_RADIUS] > 0.0 else STRAIGHT
        return shape

    @property
    def endpoints(self) -> Array:
        """The walls (7, 2, 2) [m] in the order of BOX_NAMES; the upper halves have no length without a split."""
        state, width, high = self._boundary.state, self._width, self._side_height
        slide, height, split = state[SLIDE], state[HEIGHT], min(float(state[SPLIT]), high)
        centre = state[[TOOL_X, TOOL_Y]]
        arm = np.array([0.5 * state[TOOL_WIDTH], 0.0])
        bar = np.stack([centre + arm, centre - arm])
        disc = circle_ends(centre, state[TOOL_RADIUS], np.array(0.0))
        walls = [
            [(0.0, 0.0), (width, 0.0)], [(width, 0.0), (width, split)],
            [(width + slide, height), (slide, height)], [(0.0, split), (0.0, 0.0)],
            [(width + slide, split), (width + slide, high)], [(slide, high), (slide, split)],
        ]  # fmt: skip
        return np.concatenate([np.array(walls), (disc if state[TOOL_RADIUS] > 0.0 else bar)[None]])

    @property
    def plate_unbalance(self) -> float:
        """|normal force − load| / load of the plate; zero without a load."""
        return self._load_residual(0, TOP)

    def move(self, *, slide: float = 0.0, tool: tuple[float, float] = (0.0, 0.0)) -> None:
        """Move the upper half sideways and the tool by displacements [m], smoothly and slowly."""
        displacement = np.array([slide, 0.0, *tool])
        self._move(displacement, float(np.abs(displacement).sum()) / self.height)

    def _wall_distance(self, position: Array) -> Array:
        distance = np.empty((len(position), TOOL + 1))
        box_distance(self._boundary, position, distance)
        return distance
