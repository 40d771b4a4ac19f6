"""Sections of the experiment file for its inputs: photographs, tracks, walls and boundaries."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, field_validator, model_validator

from .corrections import DIGITS, GREATEST_RADIUS, look_like_millimetres
from .section import Finite, Length, Pixels, Section, Switch, above, between, key, whole

OUTER = "outer"  # instead of a table: the outermost grains
PRESSURES = (1e-3, 1e11)  # [Pa] of a wall, at least and at most


def _pixel_size(value: Any) -> Any:
    """Validate one or both sides of a pixel with a one-line error (pydantic would list all branches of a union)."""
    sides = value if isinstance(value, list | tuple) else [value]
    numbers = all(isinstance(side, int | float) and not isinstance(side, bool) for side in sides)
    if len(sides) not in (1, 2) or not numbers or not all(0 < side <= 1 for side in sides):
        raise ValueError(f"value {value!r}: must be a number > 0, ≤ 1 [m], or [along rows, along columns]")
    return tuple(float(side) for side in sides) if isinstance(value, list | tuple) else float(value)


class LensSection(Section):
    """Distortion by the lens: OpenCV's model, or Brown's with capital letters as in p-tracker."""

    fx: Pixels | None = key("Focal length along the rows, OpenCV's model.", unit="px", default=None)
    fy: Pixels | None = key("Focal length along the columns; absent: as fx.", unit="px", default=None)
    cx: Finite | None = key("Column of the optical axis, OpenCV's model.", unit="px", default=None)
    cy: Finite | None = key("Row of the optical axis, OpenCV's model.", unit="px", default=None)
    k1: Finite = key("Radial distortion, second order, OpenCV's model.", default=0.0)
    k2: Finite = key("Radial distortion, fourth order, OpenCV's model.", default=0.0)
    p1: Finite = key("Tangential distortion, first coefficient, OpenCV's model.", default=0.0)
    p2: Finite = key("Tangential distortion, second coefficient, OpenCV's model.", default=0.0)
    k3: Finite = key("Radial distortion, sixth order, OpenCV's model.", default=0.0)
    xc: Finite | None = key("Column of the centre of distortion, Brown's model.", unit="px", default=None)
    yc: Finite | None = key("Row of the centre of distortion, Brown's model.", unit="px", default=None)
    K1: Finite = key("Radial distortion, second order, Brown's model.", unit="1/px²", default=0.0)
    K2: Finite = key("Radial distortion, fourth order, Brown's model.", unit="1/px⁴", default=0.0)
    K3: Finite = key("Radial distortion, sixth order, Brown's model.", unit="1/px⁶", default=0.0)
    P1: Finite = key("Tangential distortion, first coefficient, Brown's model.", unit="1/px", default=0.0)
    P2: Finite = key("Tangential distortion, second coefficient, Brown's model.", unit="1/px", default=0.0)
    P3: Finite = key("Tangential distortion, third coefficient, Brown's model.", unit="1/px²", default=0.0)

    @model_validator(mode="after")
    def _one_model(self) -> LensSection:
        opencv = [key for key in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3") if getattr(self, key)]
        brown = [key for key in ("xc", "yc", "K1", "K2", "K3", "P1", "P2", "P3") if getattr(self, key)]
        if opencv and brown:
            raise ValueError(f"{opencv[0]} belongs to OpenCV's model and {brown[0]} to Brown's: give one of them")
        needed = ("xc", "yc") if brown else ("fx", "cx", "cy")
        for name in needed:
            if getattr(self, name) is None:
                raise ValueError(f"{name} is missing: OpenCV's model needs fx, cx, cy, Brown's xc, yc, all in pixels")
        return self


class KnownDistance(Section):
    """Two points of the first photograph whose distance was measured, instead of pixel_size."""

    start: tuple[Finite, Finite] = key("Column and row of one point.", unit="px")
    end: tuple[Finite, Finite] = key("Column and row of the other point.", unit="px")
    metres: Length = key("Distance of the two points; a longer distance is more precise.", unit="m")

    @model_validator(mode="after")
    def _apart(self) -> KnownDistance:
        if self.start == self.end:
            raise ValueError(f"value {list(self.start)!r}: start and end are the same point")
        return self


Column = Annotated[int, whole(0, 10**6)]
Pixel = Annotated[float, between(-1e6, 1e6)]  # a place, beyond the photograph as well


class PhotographsSection(Section):
    """The photographs, their scale and their times."""

    files: str = key(
        "Pattern of the photographs, relative to the experiment; they are sorted by name in natural order."
    )
    pixel_size: Annotated[float | tuple[float, float] | None, BeforeValidator(_pixel_size)] = key(
        "Side of a pixel in the plane of the rods' ends. Two numbers where pixels are not square: along rows, along "
        "columns. Give this or distance.",
        unit="m",
        default=None,
    )
    distance: KnownDistance | None = key(
        "A distance measured in the first photograph, instead of pixel_size.", default=None
    )
    lens: LensSection | None = key("Distortion by the lens; absent: none.", default=None)
    interval: Annotated[float, above(0, 1e9)] | None = key(
        "Time between photographs. Give this or times.", unit="s", default=None
    )
    times: str | None = key("Table frame,time of photographs at uneven times, instead of interval.", default=None)
    grains: str | None = key(
        "Table id,x,y,radius in pixels of the rods on the first photograph; absent: they are detected. The "
        "detections.csv of a run, corrected by hand, can be given here.",
        default=None,
    )
    radii: tuple[Length, ...] = key(
        "Known radius classes of the rods. They make detection reliable and reveal an error of pixel_size.",
        unit="m",
        default=(),
    )
    channel: Literal["grey", "red", "green", "blue"] = key(
        "Channel of colour photographs to use: the one with the best contrast of the rods.", default="grey"
    )
    region: tuple[Column, Column, Column, Column] | None = key(
        "First column and row, last column and row of the used part of the photographs.", unit="px", default=None
    )
    mask: str | tuple[tuple[tuple[Pixel, Pixel], ...], ...] = key(
        "Parts of the photographs in which nothing is looked at (bolts, cables, reflections): a picture of their size "
        "that is not black there, or polygons, each a list of [column, row].",
        unit="px", default=(),
    )  # fmt: skip
    order: str | None = key(
        "Table file[,number]: the photographs to use, in this order, of those that files matches, and their places in "
        "time in intervals; absent: all, in the natural order of their names.",
        default=None,
    )
    rotation: Literal[0, 90, 180, 270] = key(
        "Angle by which the photographs are rotated clockwise before they are used. A camera's note of its orientation "
        "is not used: cameras that look down do not know it.",
        unit="degrees",
        default=0,
    )
    follow: Literal["texture", "outline"] = key(
        "Feature of the rods that is tracked. texture: the paint on them, with their rotation; outline: their rims, "
        "for plain discs or for discs that change inside, such as photoelastic ones; their rotation stays unknown.",
        default="texture",
    )
    fringes: str | None = key(
        "Pattern of the photographs of the same discs through a polariser, one for every photograph, or same: the "
        "photographs themselves. The squared brightness gradient of every disc is evidence for its pressure.",
        default=None,
    )
    fringe_channel: Literal["grey", "red", "green", "blue"] = key(
        "Channel of colour photographs in which fringes are sharp: that of the narrowest light.", default="green"
    )
    max_pixels: Annotated[int, whole(1, 10**10)] = key(
        "Largest number of pixels in the header of a photograph, because a file of a few bytes can state any number.",
        unit="px",
        default=200_000_000,
    )
    corrections: str | None = key(
        "Table frame,id,x,y,theta of poses entered by hand in pixels and radians, or the word lost.", default=None
    )

    @field_validator("radii")
    @classmethod
    def _radii_of_rods(cls, radii: tuple[float, ...]) -> tuple[float, ...]:
        if any(radius > GREATEST_RADIUS for radius in radii):
            metres = ", ".join(f"{1e-3 * radius:.{DIGITS}g}" for radius in radii)
            guess = f"; they look like millimetres: write radii = [{metres}]"
            raise ValueError(
                f"value {list(radii)!r}: rods are not larger than {GREATEST_RADIUS:g} m: lengths are in metres"
                f"{guess if all(look_like_millimetres(radius) for radius in radii) else ''}"
            )
        return radii

    @model_validator(mode="after")
    def _one_scale(self) -> PhotographsSection:
        if self.pixel_size is None and self.distance is None:
            raise ValueError("pixel_size is missing: give it or distance = {start, end, metres}")
        if self.pixel_size is not None and self.distance is not None:
            raise ValueError("give either pixel_size or distance")
        return self

    @model_validator(mode="after")
    def _region_has_sides(self) -> PhotographsSection:
        if self.region is not None and not (self.region[0] < self.region[2] and self.region[1] < self.region[3]):
            raise ValueError(f"region value {list(self.region)!r}: must be [x0, y0, x1, y1] with x0 < x1 and y0 < y1")
        return self

    @model_validator(mode="after")
    def _mask_has_corners(self) -> PhotographsSection:
        for polygon in () if isinstance(self.mask, str) else self.mask:
            if len(polygon) < 3:
                raise ValueError(
                    f"mask value {[list(point) for point in polygon]!r}: a polygon has three corners or more"
                )
        return self

    @model_validator(mode="after")
    def _one_clock(self) -> PhotographsSection:
        if (self.interval is None) == (self.times is None):
            raise ValueError("give either interval or times")
        return self


class GivenTracks(Section):
    """Tables of grains already tracked by any tool."""

    positions: str = key("Table frame,id,x,y,theta of poses in metres and radians; a missing row is a lost grain.")
    grains: str = key("Table id,radius of the grains in metres.")
    times: str = key("Table frame,time of the photographs in seconds.")
    radius_offset: Literal["estimate"] | Finite = key(
        "Offset common to all radii, added to each, or estimate: found from the gaps of touching grains.",
        unit="m",
        default="estimate",
    )
    precision: Annotated[float, above(0, 1)] = key(
        "Standard deviation of a position component. Set it to the precision of your tracker: contacts are detected by "
        "it, unless the gaps of touching rods contradict it.",
        unit="m",
        default=1.0e-5,
    )


class Plate(Section):
    """Load and end points of one wall."""

    pressure: Annotated[float, between(*PRESSURES)] | None = key(
        "Pressure that loads this wall between its neighbours, where rods can touch it; absent: its measured velocity "
        "is imposed. One loaded wall sets the scale of all forces.",
        unit="Pa",
        default=None,
    )

    ends: Literal["auto", "bar", "corner"] = key(
        "Meaning of the two points of this wall. bar: points of the bar itself; corner: points where bars meet, which "
        "slide along the bar; auto: corners where their distance changes.",
        default="auto",
    )


class WallsSection(Section):
    """The walls: tables of straight and of circular ones, and a table [walls.NAME] with further keys of one wall."""

    file: str | None = key(
        "Table frame,wall,x1,y1,x2,y2 of straight walls' ends in metres; the packing lies to the left of 1 → 2.",
        default=None,
    )
    arcs: str | None = key(
        "Table frame,wall,x,y,radius,side of circular walls in metres; side: in where the packing is inside the "
        "circle, out where it is outside. A circle given in frame 0 alone does not move. A column theta in radians "
        "gives its rotation.",
        default=None,
    )
    corners: str | None = key(
        "Table frame,corner,x,y,radius of discs in metres that are fixed to the frame where two bars meet; rods touch "
        "them. Without `file`, the bars run through the centres of neighbouring corners. A disc turns with its bar, "
        "unless a column theta in radians gives its rotation, and shares the load of a loaded bar. In photographs a "
        "disc that is given in frame 0 alone is centred on its rim and followed; in tables it does not move.",
        default=None,
    )
    load: str | None = key(
        "Table frame,wall,force of the normal force in newtons measured on walls in every photograph, which loads them "
        "instead of a pressure.",
        default=None,
    )
    track: Switch | None = key(
        "Track walls in the photographs where the table has no row; absent: where it has frame 0 alone.", default=None
    )
    thickness: Length | None = key(
        "Thickness of the bars seen beside the walls' inner faces; absent: measured on the photograph.",
        unit="m",
        default=None,
    )
    forces: str | None = key(
        "Table frame,wall,fx,fy of the packing's force on walls in newtons, from sensors. Forces are not fitted to it: "
        "where it contradicts their scale, the scale's standard deviation grows.",
        default=None,
    )
    plates: dict[str, Plate] = key("Further keys of walls by their names: the tables [walls.NAME].", default={})

    @model_validator(mode="after")
    def _some_walls(self) -> WallsSection:
        if self.file is None and self.arcs is None and self.corners is None:
            raise ValueError(
                "file is missing: give a table of straight walls, arcs, a table of circular ones, or corners, a table "
                "of the discs where bars meet"
            )
        return self

    @model_validator(mode="before")
    @classmethod
    def _gather_plates(cls, data: Any) -> Any:
        """Gather the tables [walls.NAME], which stand beside `file` in the experiment file."""
        if not isinstance(data, dict) or "plates" in data:
            return data
        return {
            **{key: value for key, value in data.items() if not isinstance(value, dict)},
            "plates": {key: value for key, value in data.items() if isinstance(value, dict)},
        }


class BoundarySection(Section):
    """Boundary of the packing other than walls: some of its grains, or the edges of a periodic cell."""

    grains: str | None = key(
        "Table id of the boundary grains, or outer: the outermost ones, found on the first photograph. Their measured "
        "motion is imposed; they carry forces and need not be in equilibrium.",
        default=None,
    )
    periodic: str | None = key(
        "Table frame,ax,ay,bx,by of the vectors of a periodic cell in metres, instead of walls.", default=None
    )

    @property
    def found(self) -> bool:
        """Whether the boundary grains are to be detected."""
        return self.grains == OUTER

    @model_validator(mode="after")
    def _one_kind(self) -> BoundarySection:
        if (self.grains is None) == (self.periodic is None):
            raise ValueError("give either grains or periodic")
        if self.grains and self.grains != OUTER and get_close_matches(self.grains.lower(), [OUTER], cutoff=0.7):
            raise ValueError(f'grains = "{self.grains}" is neither a table nor outer: write grains = "{OUTER}"')
        return self
