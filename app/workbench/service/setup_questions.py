"""Questions of the set-up: what the page does to photographs, scale, walls, rods and material."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, StringConstraints

from solver.bodies.wall_shapes import STRAIGHT

from ...errors import InputError
from ..setup import circles, edits
from ..setup.steps import Understood
from .bench import Bench
from .project import Project
from .questions import Line, Number, Numbers, Point, Shape, Text, Whole, edit, question

Pressure = Annotated[float, Field(ge=1e-3, le=1e11)]
Three = Annotated[list[Point], Field(min_length=3, max_length=3)]
Round = Annotated[list[Number], Field(min_length=3, max_length=3)]
Lens = Annotated[dict[Annotated[str, StringConstraints(max_length=2)], Number], Field(max_length=20)]
Written = Annotated[str, StringConstraints(max_length=5_000_000)]  # a table of a hundred thousand rows
LEAST_CIRCLE = 10.0  # [px] of a circular wall's radius
Region = Annotated[list[Whole], Field(min_length=4, max_length=4)]


@edit
def set_photographs(
    bench: Bench, at: Text, name: Text | None = None, interval: Number | None = None,
    channel: Literal["grey", "red", "green", "blue"] | None = None, region: Region | Literal["all"] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Values that are not given stay."""
    opened = bench.project(at)
    keys: dict[str, Any] = {}
    if name is not None:
        keys["name"] = name
    if interval is not None:
        keys |= {"photographs.interval": interval, "photographs.times": None}
    if channel is not None:
        keys["photographs.channel"] = None if channel == "grey" else channel
    if region is not None:
        keys["photographs.region"] = None if region == "all" else region
    opened.draft.set_keys("photographs", keys)
    return opened.describe()


@question
def quality(bench: Bench, at: Text) -> dict[str, Any]:
    """What the photographs are good for, as `rodsight check` says it, and the light of some of them."""
    measured = bench.project(at).quality()
    return {
        "facts": measured.facts(), "faults": measured.faults(), "frame": measured.frame.tolist(),
        "light": measured.light.tolist(), "contrast": measured.contrast.tolist(),
    }  # fmt: skip


class Measured(Shape):
    """A rod whose outline was seen, and its radius [m]."""

    radius: Number
    pixels: Number


@edit
def set_scale(
    bench: Bench, at: Text, pixel_size: Number | None = None, line: Line | None = None, metres: Number | None = None,
    rods: list[Measured] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """By the size of a pixel, by two points and their distance, or by rods of known radius."""
    opened = bench.project(at)
    if line is not None and metres is not None:
        told = {"photographs.distance": {"start": _rounded(line[0]), "end": _rounded(line[1]), "metres": metres}}
    elif rods:
        if any(rod.pixels <= 0.0 for rod in rods):
            raise InputError("scale", "", "a rod of no size tells nothing")
        size = sum(rod.radius for rod in rods) / sum(rod.pixels for rod in rods)
        told = {"photographs.pixel_size": float(f"{size:.6g}")}
    elif pixel_size is not None:
        told = {"photographs.pixel_size": pixel_size}
    else:
        raise InputError("scale", "", "give the size of a pixel, a line and its length, or rods of known radius")
    edits.set_scale(opened.draft, told)
    return opened.describe()


@edit
def set_lens(bench: Bench, at: Text, lens: Lens | None = None) -> dict[str, Any]:
    """The coefficients of OpenCV's or of Brown's model; None: what bends the picture is found as far as gaps tell."""
    opened = bench.project(at)
    edits.set_lens(opened.draft, None if lens is None else dict(lens))
    return opened.describe()


@edit
def set_table(
    bench: Bench, at: Text, name: Literal["times", "load", "forces"], table: Written | None = None
) -> dict[str, Any]:
    """A table from elsewhere: times of the photographs, load of walls, forces to compare with; None: take it away."""
    opened = bench.project(at)
    edits.set_table(opened.draft, opened.understood(), name, table)
    return opened.describe()


@question
def measure_rod(bench: Bench, at: Text, x: Number, y: Number, radius: Number) -> dict[str, Any]:
    """The circle of a rod near a drawn one."""
    opened = bench.project(at)
    free = Understood(opened.understood().steps, {})
    x, y, radius = edits.fit_rod(opened.photograph(0), free, x, y, max(radius, 3.0))
    return {"x": x, "y": y, "r": radius}


@edit
def draw_wall(bench: Bench, at: Text, line: Line, name: Text | None = None, snap: bool = True) -> dict[str, Any]:
    """Draw a new wall, or draw the named one anew."""
    opened = bench.project(at)
    found = _scaled(opened)
    drawn = np.array(line)
    share = 1.0
    if snap:
        drawn, share = edits.snap_wall(opened.photograph(0), drawn, found)
    else:
        drawn = edits.towards_packing(drawn, found)
    walls = _walls(found)
    if name is None:
        name = _name_for(drawn, found)
        walls.append((name, drawn))
    else:
        walls = [(each, drawn if each == name else ends) for each, ends in walls]
    edits.set_walls(opened.draft, found, walls, f"wall {name}")
    return opened.describe() | {"snapped": share if snap else None, "wall": name}


@edit
def find_walls(bench: Bench, at: Text) -> dict[str, Any]:
    """Find the bars around the rods."""
    opened = bench.project(at)
    found = _scaled(opened)
    lines = edits.find_walls(opened.photograph(0), found)
    names = edits.names_of(lines)
    edits.set_walls(opened.draft, found, list(zip(names, lines, strict=True)), "walls found")
    return opened.describe()


@edit
def draw_circle(
    bench: Bench, at: Text, points: Three | None = None, place: Round | None = None, name: Text | None = None,
    side: Literal["in", "out"] = "in", snap: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Draw a circular wall, or the named one anew: through three points, by its place, or around the rods.

    side: where the packing is. place: x, y and radius [px]. snap: onto the edge that is seen beside it.
    """
    opened = bench.project(at)
    found = _scaled(opened)
    name = _free("circle", found) if name is None else name
    if points is not None:
        circle = circles.circle_through(np.array(points), name, side)
    elif place is not None:
        circle = circles.Circle(name, place[0], place[1], place[2], side)
    else:
        circle = circles.circle_around(found, name)
    if not circle.radius > LEAST_CIRCLE:
        raise InputError("circle", f"radius {circle.radius:.3g} px", "is too small for a wall")
    share = None
    if snap:
        circle, share = circles.snapped(opened.photograph(0), circle)
    circles.set_circles(opened.draft, found, circles.with_circle(circles.circles_of(found), circle), f"wall {name}")
    return opened.describe() | {"wall": name, "snapped": share}


@edit
def delete_wall(bench: Bench, at: Text, name: Text) -> dict[str, Any]:
    opened = bench.project(at)
    found = _scaled(opened)
    if any(each.name == name for each in circles.circles_of(found)):
        left = [each for each in circles.circles_of(found) if each.name != name]
        circles.set_circles(opened.draft, found, left, f"wall {name} deleted")
        return opened.describe()
    edits.set_walls(opened.draft, found, [each for each in _walls(found) if each[0] != name], f"wall {name} deleted")
    return opened.describe()


@edit
def rename_wall(bench: Bench, at: Text, name: Text, to: Text) -> dict[str, Any]:
    opened = bench.project(at)
    edits.rename_wall(opened.draft, opened.understood(), name, to)
    return opened.describe()


@edit
def set_plate(
    bench: Bench, at: Text, name: Text, pressure: Pressure | None = None,
    ends: Literal["auto", "bar", "corner"] = "auto",
) -> dict[str, Any]:  # fmt: skip
    """pressure None: the wall moves as it was seen."""
    opened = bench.project(at)
    told = {"pressure": pressure, "ends": None if ends == "auto" else ends}
    edits.set_plate(opened.draft, opened.understood(), name, told)
    return opened.describe()


@edit
def detect_rods(bench: Bench, at: Text, radii: Numbers) -> dict[str, Any]:
    """Look for the rods of the first photograph; radii [m]: the classes, none where they are not known."""
    opened = bench.project(at)
    detection = edits.detect(opened.photograph(0), opened.understood(), radii)
    edits.set_rods(opened.draft, f"{detection.count} rods found", edits.as_guess(detection), radii)
    return opened.describe() | {"quality": np.round(detection.quality, 3).tolist()}


@edit
def add_rod(bench: Bench, at: Text, x: Number, y: Number, radius: Number) -> dict[str, Any]:
    """Add a rod at a click; its circle is fitted to the rim that is seen there."""
    opened = bench.project(at)
    found = opened.understood()
    pose = edits.fit_rod(opened.photograph(0), found, x, y, max(radius, 3.0))
    edits.set_rods(opened.draft, "rod added", edits.with_rod(found.rods, None, pose))
    return opened.describe()


@edit
def move_rod(bench: Bench, at: Text, id: Whole, x: Number, y: Number, radius: Number) -> dict[str, Any]:
    opened = bench.project(at)
    rods = edits.with_rod(opened.understood().rods, id, (x, y, max(radius, 1.0)))
    edits.set_rods(opened.draft, f"rod {id} moved", rods)
    return opened.describe()


@edit
def delete_rods(bench: Bench, at: Text, ids: list[Whole]) -> dict[str, Any]:
    opened = bench.project(at)
    rods = opened.understood().rods
    for each in ids:
        rods = edits.with_rod(rods, each, None)
    if rods is not None:
        what = f"{len(ids)} rods deleted" if len(ids) > 1 else f"rod {ids[0]} deleted"
        edits.set_rods(opened.draft, what, rods)
    return opened.describe()


@question
def classes(bench: Bench, at: Text) -> dict[str, Any]:
    """The radii [m] at which those of the rods crowd."""
    found = _scaled(bench.project(at))
    if found.rods is None:
        return {"radii": []}
    pixel = found.scale.mean_size if found.scale is not None else 1.0
    return {"radii": [float(f"{each:.4g}") for each in (edits.find_classes(found.rods.radius) * pixel).tolist()]}


@edit
def set_classes(bench: Bench, at: Text, radii: Numbers) -> dict[str, Any]:
    """Give every rod the nearest of these radii [m]."""
    opened = bench.project(at)
    found = _scaled(opened)
    if found.rods is None or found.scale is None or not radii or min(radii) <= 0.0:
        raise InputError("radii", str(radii), "give at least one radius, and rods to have it")
    edits.set_rods(opened.draft, "radius classes", edits.snapped_to(radii, found.rods, found.scale), radii)
    return opened.describe()


@question
def materials(bench: Bench) -> dict[str, Any]:
    return edits.MATERIALS


@edit
def set_material(
    bench: Bench, at: Text, density: Number | None = None, length: Number | None = None,
    friction: Number | Literal["measured"] | None = None, wall_friction: Number | Literal["same"] | None = None,
    gravity: Point | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Values that are not given stay."""
    opened = bench.project(at)
    told = {"density": density, "length": length, "friction": friction, "gravity": gravity}
    keys: dict[str, Any] = {f"material.{key}": value for key, value in told.items() if value is not None}
    if wall_friction is not None:
        keys["material.wall_friction"] = None if wall_friction == "same" else wall_friction
    opened.draft.set_keys("material", keys)
    return opened.describe()


def _scaled(opened: Project) -> Understood:
    found = opened.understood()
    if found.scale is None:
        raise InputError("scale", "", "is not set: walls and radii are in metres, so it comes first")
    return found


def _walls(found: Understood) -> list[tuple[str, Any]]:
    if found.walls is None or found.scale is None:
        return []
    bars = found.walls.sides == STRAIGHT  # circles are told in a table of their own
    ends = found.scale.to_pixels(found.walls.endpoints[0])
    return [(name, line) for name, line, bar in zip(found.walls.name, ends, bars, strict=True) if bar]


def _name_for(line: Any, found: Understood) -> str:
    """What a new wall is called, by the side of the packing that it lies on."""
    along = line[1] - line[0]
    steep = abs(along[1]) > abs(along[0])
    name = ("right" if along[1] < 0 else "left") if steep else ("bottom" if along[0] > 0 else "top")
    return _free(name, found)


def _free(name: str, found: Understood) -> str:
    """A wall's name that is not taken: this one, or with a number."""
    taken = found.walls.name if found.walls is not None else ()
    return next(each for each in (name, *(f"{name}{k}" for k in range(2, 1000))) if each not in taken)


def _rounded(point: list[float]) -> list[float]:
    """A place in pixels, no finer than a hand can tell."""
    return [round(each, 2) for each in point]
