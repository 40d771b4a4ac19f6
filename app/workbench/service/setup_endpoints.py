"""Endpoints of the set-up: edits of photographs, scale, walls, rods and material."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, StringConstraints

from ...experiment.experiment import GrainGuess
from ...process.errors import InputError
from ...tracking.detection.clicked_circle import fit_clicked
from ..setup import edits, found_walls, photograph_series
from ..setup.validation import ValidationResult, outside_walls
from ..setup.walls import bars, circles
from .endpoints import Line, Number, Numbers, Point, Text, Values, Whole, editing_endpoint, endpoint, without_nul
from .project import Project
from .workbench import Workbench

Pressure = Annotated[float, Field(ge=1e-3, le=1e11)]
Three = Annotated[list[Point], Field(min_length=3, max_length=3)]
Round = Annotated[list[Number], Field(min_length=3, max_length=3)]
Lens = Annotated[dict[Annotated[str, StringConstraints(max_length=2)], Number], Field(max_length=20)]
LARGEST_WRITTEN = 5_000_000  # characters of a table: a hundred thousand rows
Written = Annotated[str, StringConstraints(max_length=LARGEST_WRITTEN), AfterValidator(without_nul)]
WITH_TABLE = frozenset(("set_table",))  # endpoints whose requests hold a table
LEAST_CIRCLE = 10.0  # [px] of a circular wall's radius
Polygon = Annotated[list[Point], Field(min_length=3, max_length=500)]
Stroke = Annotated[list[Point], Field(min_length=1, max_length=5000)]
Brush = Annotated[float, Field(ge=0.5, le=2000.0)]
Files = Annotated[list[Text], Field(min_length=1, max_length=100_000)]
Region = Annotated[list[Whole], Field(min_length=4, max_length=4)]


@editing_endpoint
def set_photographs(
    opened: Project, name: Text | None = None, interval: Number | None = None,
    channel: Literal["grey", "red", "green", "blue"] | None = None, region: Region | Literal["all"] | None = None,
    mask: list[Polygon] | None = None,
) -> None:  # fmt: skip
    """Set the given values; the others are not changed."""
    keys: dict[str, Any] = {}
    if name is not None:
        keys["name"] = name
    if interval is not None:
        keys |= {"photographs.interval": interval, "photographs.times": None}
    if channel is not None:
        keys["photographs.channel"] = None if channel == "grey" else channel
    if region is not None:
        keys["photographs.region"] = None if region == "all" else region
    if mask is not None:
        keys["photographs.mask"] = [[_rounded(point) for point in polygon] for polygon in mask] or None
    opened.draft.set_keys("photographs" if mask is None else "mask", keys)


@editing_endpoint
def brush_mask(opened: Project, points: Stroke, radius: Brush) -> None:
    """Add a stroke of a round brush [px] to the mask."""
    photograph_series.add_to_mask(opened.draft, opened.validation(), points, radius)


@editing_endpoint
def set_order(opened: Project, files: Files, change: Text = "order") -> None:
    """Use the named photographs in this order, and leave the others out."""
    with opened.with_verdicts():
        photograph_series.set_order(opened.draft, opened.validation(), files, change)


@editing_endpoint
def number_by_names(opened: Project) -> None:
    """Take the places in time of the photographs from the numbers in their names."""
    photograph_series.number_by_names(opened.draft, opened.validation())


@editing_endpoint
def use_camera_times(opened: Project) -> None:
    """Order the photographs by the camera's clock, and take their times from it."""
    with opened.with_verdicts():
        photograph_series.use_camera_times(opened.draft, opened.validation())


@editing_endpoint
def rotate(opened: Project, rotation: Literal[0, 90, 180, 270]) -> None:
    """Rotate the photographs clockwise by so many degrees in all, with everything that is drawn on them."""
    photograph_series.rotate(opened.draft, opened.validation(), rotation)


@endpoint
def quality(opened: Project) -> dict[str, Any]:
    """Measure the quality of the photographs, as `rodsight check` does, and the illumination of some of them."""
    measured = opened.quality()
    return {
        "facts": measured.facts(), "faults": measured.faults(), "frame": measured.frame.tolist(),
        "light": measured.light.tolist(), "contrast": measured.contrast.tolist(),
    }  # fmt: skip


class Measured(Values):
    """Radius of a rod [m], and of its outline in pixels."""

    radius: Number
    pixels: Number


@editing_endpoint
def set_scale(
    opened: Project, pixel_size: Number | None = None, line: Line | None = None,
    metres: Number | None = None, rods: list[Measured] | None = None,
) -> None:  # fmt: skip
    """Set the scale by the size of a pixel, by two points and their distance, or by rods of known radius."""
    if line is not None and metres is not None:
        keys = {"photographs.distance": {"start": _rounded(line[0]), "end": _rounded(line[1]), "metres": metres}}
    elif rods:
        if any(rod.pixels <= 0.0 for rod in rods):
            raise InputError("scale", "", "a rod of 0 px gives no scale")
        size = sum(rod.radius for rod in rods) / sum(rod.pixels for rod in rods)
        keys = {"photographs.pixel_size": float(f"{size:.6g}")}
    elif pixel_size is not None:
        keys = {"photographs.pixel_size": pixel_size}
    else:
        raise InputError("scale", "", "give the size of a pixel, a line and its length, or rods of known radius")
    edits.set_scale(opened.draft, keys)


@editing_endpoint
def set_lens(opened: Project, lens: Lens | None = None) -> None:
    """Set the coefficients of OpenCV's or of Brown's model; None: the distortion is estimated from the gaps."""
    edits.set_lens(opened.draft, None if lens is None else dict(lens))


@editing_endpoint
def set_table(opened: Project, name: Literal["times", "load", "forces"], table: Written | None = None) -> None:
    """Set a table of another program: times of photographs, load of walls, forces to compare with; None: remove it."""
    edits.set_table(opened.draft, opened.validation(), name, table)


@endpoint
def measure_rod(opened: Project, x: Number, y: Number, radius: Number) -> dict[str, Any]:
    """Fit the circle of a rod near a drawn one."""
    fitted = fit_clicked(opened.photograph(0), (x, y, max(radius, 3.0)))
    x, y, radius = fitted or (x, y, radius)
    return {"x": x, "y": y, "r": radius, "seen": fitted is not None}


@editing_endpoint
def draw_wall(opened: Project, line: Line, name: Text | None = None, snap: bool = True) -> dict[str, Any]:
    """Draw a new wall, or redraw the named one."""
    found = _scaled(opened)
    drawn, fraction = np.array(line), 1.0
    if snap:
        drawn, fraction = bars.snap_wall(opened.photograph(0), drawn, found)
    else:
        drawn = bars.towards_packing(drawn, found)
    walls = circles.bars_of(found)
    if name is None:
        name = _name_for(drawn, found)
        walls.append((name, drawn))
    else:
        walls = [(each, drawn if each == name else ends) for each, ends in walls]
    edits.set_walls(opened.draft, found, walls, f"wall {name}")
    return opened.describe() | {"snapped": fraction if snap else None, "wall": name}


@editing_endpoint
def find_walls(opened: Project) -> dict[str, Any]:
    """Find the bars around the rods, and the discs in the corners where they meet."""
    count, discs = found_walls.find_frame(opened.draft, opened.photograph(0), _scaled(opened))
    return opened.describe() | {"bars": count, "discs": discs}


@editing_endpoint
def draw_circle(
    opened: Project, points: Three | None = None, place: Round | None = None, name: Text | None = None,
    side: Literal["in", "out"] = "in", snap: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Draw a circular wall, or redraw the named one: through three points, by its place, or around the rods.

    side: of the packing. place: x, y and radius [px]. snap: move it onto the visible edge beside it.
    """
    found = _scaled(opened)
    name = _free("circle", found) if name is None else name
    if name in circles.corner_names(found):
        raise InputError("corner", name, "has its place in the table of corners: delete it and draw it again")
    if points is not None:
        circle = circles.circle_through(np.array(points), name, side)
    elif place is not None:
        circle = circles.Circle(name, place[0], place[1], place[2], side)
    else:
        circle = circles.circle_around(found, name)
    if not circle.radius > LEAST_CIRCLE:
        raise InputError("circle", f"radius {circle.radius:.3g} px", "is too small for a wall")
    fraction = None
    if snap:
        circle, fraction = circles.snapped(opened.photograph(0), circle)
    circles.set_circles(opened.draft, found, circles.with_circle(circles.circles_of(found), circle), f"wall {name}")
    return opened.describe() | {"wall": name, "snapped": fraction}


@editing_endpoint
def make_corner(opened: Project, name: Text) -> None:
    """Make a circular wall a disc in a corner of the frame: it moves with the bar that it is fixed to."""
    circles.make_corner(opened.draft, _scaled(opened), name)


@editing_endpoint
def find_corner(opened: Project, x: Number, y: Number) -> dict[str, Any]:
    """Find the disc in a corner of the frame that was clicked [px]."""
    found = _scaled(opened)
    disc = circles.corner_at(opened.photograph(0), found, x, y)
    found_walls.add_discs(opened.draft, found, [disc])
    return opened.describe() | {"wall": disc.name}


@editing_endpoint
def delete_wall(opened: Project, name: Text) -> None:
    found = _scaled(opened)
    if name in circles.corner_names(found):
        with opened.draft.one_step(f"corner {name} deleted"):
            if "file" not in found.data["walls"]:  # the bars ran through the discs' centres
                edits.set_walls(opened.draft, found, circles.bars_of(found), "bars")
            circles.delete_corner(opened.draft, opened.validation(), name)
        return
    if any(each.name == name for each in circles.circles_of(found)):
        left = [each for each in circles.circles_of(found) if each.name != name]
        circles.set_circles(opened.draft, found, left, f"wall {name} deleted")
        return
    others = [each for each in circles.bars_of(found) if each[0] != name]
    edits.set_walls(opened.draft, found, others, f"wall {name} deleted")


@editing_endpoint
def rename_wall(opened: Project, name: Text, to: Text) -> None:
    edits.rename_wall(opened.draft, opened.validation(), name, to)


@editing_endpoint
def set_plate(
    opened: Project, name: Text, pressure: Pressure | None = None,
    ends: Literal["auto", "bar", "corner"] = "auto",
) -> None:  # fmt: skip
    """Set pressure and ends of a wall; pressure None: the wall has its measured motion."""
    values = {"pressure": pressure, "ends": None if ends == "auto" else ends}
    edits.set_plate(opened.draft, opened.validation(), name, values)


@editing_endpoint
def detect_rods(opened: Project, radii: Numbers) -> dict[str, Any]:
    """Detect the rods of the first photograph; radii [m]: the classes, empty where they are not known."""
    image = opened.used_photograph(0)
    detection = edits.within_picture(edits.detect(image, opened.validation(), radii), image)
    edits.set_rods(opened.draft, f"{detection.count} rods found", edits.as_guess(detection), radii)
    return opened.describe() | {"quality": np.round(detection.quality, 3).tolist()}


@editing_endpoint
def add_rod(opened: Project, x: Number, y: Number, radius: Number) -> None:
    """Add a rod at a click; its circle is fitted to the visible rim."""
    found = opened.validation()
    pose = edits.fit_rod(opened.photograph(0), found, x, y, max(radius, 3.0))
    edits.set_rods(opened.draft, "rod added", edits.with_rod(found.rods, None, pose))


@editing_endpoint
def move_rod(opened: Project, id: Whole, x: Number, y: Number, radius: Number) -> None:
    rods = edits.with_rod(opened.validation().rods, id, (x, y, max(radius, 1.0)))
    edits.set_rods(opened.draft, f"rod {id} moved", rods)


@editing_endpoint
def delete_rods(opened: Project, ids: Annotated[list[Whole], Field(min_length=1)]) -> None:
    rods = opened.validation().rods
    for each in ids:
        rods = edits.with_rod(rods, each, None)
    if rods is not None:
        what = f"{len(ids)} rods deleted" if len(ids) > 1 else f"rod {ids[0]} deleted"
        edits.set_rods(opened.draft, what, rods)


@editing_endpoint
def drop_outside(opened: Project) -> None:
    """Delete the rods that lie outside the walls."""
    found = opened.validation()
    outside = outside_walls(found)
    if found.rods is not None and outside:
        kept = ~np.isin(found.rods.id, outside)
        seen = found.rods
        rods = GrainGuess(seen.id[kept], seen.x[kept], seen.y[kept], seen.radius[kept])
        edits.set_rods(opened.draft, f"{len(outside)} circles outside the walls dropped", rods)


@endpoint
def classes(opened: Project) -> dict[str, Any]:
    """Find the radius classes [m] of the rods."""
    found = _scaled(opened)
    if found.rods is None:
        return {"radii": []}
    pixel = found.scale.mean_size if found.scale is not None else 1.0
    return {"radii": [float(f"{each:.4g}") for each in (edits.find_classes(found.rods.radius) * pixel).tolist()]}


@editing_endpoint
def set_classes(opened: Project, radii: Numbers) -> None:
    """Give every rod the nearest of these radii [m]."""
    found = _scaled(opened)
    if found.rods is None or found.scale is None or not radii or min(radii) <= 0.0:
        raise InputError("radii", str(radii), "give at least one radius, and detect the rods first")
    edits.set_rods(opened.draft, "radius classes", edits.snapped_to(radii, found.rods, found.scale), radii)


@endpoint
def materials(workbench: Workbench) -> dict[str, Any]:
    return edits.MATERIALS


@editing_endpoint
def set_material(
    opened: Project, density: Number | None = None, length: Number | None = None,
    friction: Number | Literal["measured"] | None = None, wall_friction: Number | Literal["same"] | None = None,
    gravity: Point | None = None,
) -> None:  # fmt: skip
    """Set the given values; the others are not changed."""
    values = {"density": density, "length": length, "friction": friction, "gravity": gravity}
    keys: dict[str, Any] = {f"material.{key}": value for key, value in values.items() if value is not None}
    if wall_friction is not None:
        keys["material.wall_friction"] = None if wall_friction == "same" else wall_friction
    opened.draft.set_keys("material", keys)


def _scaled(opened: Project) -> ValidationResult:
    found = opened.validation()
    if found.scale is None:
        raise InputError("scale", "", "is not set: walls and radii are in metres, so it comes first")
    return found


def _name_for(line: Any, found: ValidationResult) -> str:
    """Name of a new wall, by the side of the packing on which it lies."""
    along = line[1] - line[0]
    steep = abs(along[1]) > abs(along[0])
    name = ("right" if along[1] < 0 else "left") if steep else ("bottom" if along[0] > 0 else "top")
    return _free(name, found)


def _free(name: str, found: ValidationResult) -> str:
    """A free name for a wall: this one, or with a number."""
    taken = found.walls.name if found.walls is not None else ()
    return next(each for each in (name, *(f"{name}{k}" for k in range(2, 1000))) if each not in taken)


def _rounded(point: list[float]) -> list[float]:
    """A place in pixels, rounded to the accuracy of a hand."""
    return [round(each, 2) for each in point]
