"""Sections of the experiment file that say what was photographed or tracked, and where it is."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, model_validator

from .section import Finite, Positive, Section, key


def _pixel_size(value: Any) -> Any:
    """One side or both, in one line of complaint: a union's own would name its branches."""
    sides = value if isinstance(value, list | tuple) else [value]
    numbers = all(isinstance(side, int | float) and not isinstance(side, bool) for side in sides)
    if len(sides) not in (1, 2) or not numbers or not all(0 < side < float("inf") for side in sides):
        raise ValueError(f"value {value!r}: must be a positive number [m], or [along rows, along columns]")
    return tuple(float(side) for side in sides) if isinstance(value, list | tuple) else float(value)


class LensSection(Section):
    """How the lens bends the picture: OpenCV's model, or Brown's with capital letters as p-tracker writes it."""

    fx: Positive | None = key("Focal length along the rows, OpenCV's model.", unit="px", default=None)
    fy: Positive | None = key("Focal length along the columns; absent: as fx.", unit="px", default=None)
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
    metres: Positive = key("Distance of the two points; the farther apart they are, the better.", unit="m")

    @model_validator(mode="after")
    def _apart(self) -> KnownDistance:
        if self.start == self.end:
            raise ValueError(f"value {list(self.start)!r}: start and end are the same point")
        return self


class PhotographsSection(Section):
    """Where the photographs are and what a pixel is."""

    files: str = key("Pattern of the photographs, relative to the experiment; taken in natural order of their names.")
    pixel_size: Annotated[float | tuple[float, float] | None, BeforeValidator(_pixel_size)] = key(
        "Side of a pixel in the plane of the rods' ends. Two numbers where pixels are not square: along rows, along "
        "columns. Give this or distance.",
        unit="m",
        default=None,
    )
    distance: KnownDistance | None = key(
        "A distance measured in the first photograph, in place of pixel_size.", default=None
    )
    lens: LensSection | None = key("Distortion by the lens; absent: the picture is straight.", default=None)
    interval: Positive | None = key("Time between photographs. Give this or times.", unit="s", default=None)
    times: str | None = key("Table frame,time of photographs at uneven times, in place of interval.", default=None)
    grains: str | None = key(
        "Table id,x,y,radius in pixels of the rods on the first photograph; absent: they are detected. The "
        "detections.csv of a run, mended by hand, can be given here.",
        default=None,
    )
    radii: tuple[Positive, ...] = key(
        "Known radius classes of the rods. They make detection sure and tell an error of pixel_size.",
        unit="m",
        default=(),
    )
    corrections: str | None = key(
        "Table frame,id,x,y,theta of poses told by hand in pixels and radians, or the word lost.", default=None
    )

    @model_validator(mode="after")
    def _one_scale(self) -> PhotographsSection:
        if self.pixel_size is None and self.distance is None:
            raise ValueError("pixel_size is missing: give it or distance = {start, end, metres}")
        if self.pixel_size is not None and self.distance is not None:
            raise ValueError("give either pixel_size or distance")
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
    precision: Positive = key(
        "Standard deviation of a position component. Change it to what your tracker reaches: pairs are judged by it, "
        "unless the gaps of touching rods contradict it.",
        unit="m",
        default=1.0e-5,
    )


class Plate(Section):
    """What is known of one wall beside its position."""

    pressure: Positive | None = key(
        "Pressure that loads this wall; absent: its measured velocity is imposed. One loaded wall sets the scale of "
        "all forces.",
        unit="Pa",
        default=None,
    )


class WallsSection(Section):
    """The walls: a table of their ends, and a table [walls.NAME] of what else is known of one."""

    file: str = key("Table frame,wall,x1,y1,x2,y2 of the walls' ends in metres; the packing lies to the left of 1 → 2.")
    track: bool | None = key(
        "Follow walls in the photographs where the table has no row; absent: where it has frame 0 alone.", default=None
    )
    thickness: Positive | None = key(
        "Thickness of the bars seen beside the walls' inner faces; absent: measured on the picture.",
        unit="m",
        default=None,
    )
    forces: str | None = key(
        "Table frame,wall,fx,fy of the packing's force on walls in newtons, from sensors: to compare with, never used.",
        default=None,
    )
    plates: dict[str, Plate] = key("What is known of walls by their names: the tables [walls.NAME].", default={})

    @model_validator(mode="before")
    @classmethod
    def _gather_plates(cls, data: Any) -> Any:
        """[walls.NAME] tables stand beside `file` in the experiment file."""
        if not isinstance(data, dict) or "plates" in data:
            return data
        return {
            **{key: value for key, value in data.items() if not isinstance(value, dict)},
            "plates": {key: value for key, value in data.items() if isinstance(value, dict)},
        }
