"""Circular walls of an experiment that is being set up: through three points, or around the rods; a table of arcs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ....experiment.pictures.image import Image
from ....experiment.reading.corners import CORNER_COLUMNS
from ....experiment.units import Scale
from ....experiment.walls import ARC_COLUMNS
from ....process.errors import InputError
from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import IN, STRAIGHT, circle_parameters
from ....tracking.walls.corner_rims import BETWEEN_BARS, CLICKED, find_disc
from ....tracking.walls.round_edge import snap_to_rim
from ..draft import Draft, as_table
from ..validation import ValidationResult

ARCS, CORNERS = "arcs.csv", "corners.csv"
RIM = 24  # points of a rod's rim that a circle around the rods must hold
SNAP = 0.06  # of its radius, how far beside a drawn circle its edge is looked for
MEETING = 2.0  # [px] between the ends of two bars that meet
FRAME = 4  # bars, and discs, of a closed frame
THROUGH = 0.05  # [radii] between the end of a bar and the centre of its disc
FLAT = 1e-3  # height of a triangle by its longest side below which it is a line


@dataclass(frozen=True, slots=True)
class Circle:
    """A circular wall on the first photograph."""

    name: str
    x: float  # [px]
    y: float
    radius: float  # [px]
    side: str = "in"  # where the packing is: in or out


def circles_of(found: ValidationResult) -> list[Circle]:
    """List the circular walls of the experiment; discs in the corners of a frame have a table of their own."""
    corners = corner_names(found)
    return [each for each in discs_of(found) if each.name not in corners]


def discs_of(found: ValidationResult) -> list[Circle]:
    """List the circular walls and the discs in the corners of the frame."""
    walls, scale = found.walls, found.scale
    if walls is None or scale is None:
        return []
    centre, radius, _ = circle_parameters(walls.endpoints[0])
    place = scale.to_pixels(centre)
    pixels = radius / scale.size_at(place)
    return [
        Circle(walls.name[w], float(place[w, 0]), float(place[w, 1]), float(pixels[w]), _side(int(walls.sides[w])))
        for w in np.flatnonzero(walls.sides != STRAIGHT).tolist()
    ]


def corner_names(found: ValidationResult) -> frozenset[str]:
    """Return the names of the discs in the corners of the frame."""
    file = found.data.get("walls", {}).get("corners")
    if file is None or found.experiment is None:
        return frozenset()
    return frozenset(found.experiment.table(file, ("corner",)).text("corner"))


def make_corner(draft: Draft, found: ValidationResult, name: str) -> None:
    """Make a circular wall a disc in a corner of the frame, where two of its bars meet."""
    circles = circles_of(found)
    chosen = [each for each in circles if each.name == name]
    section = dict(found.data.get("walls", {}))
    if not chosen or found.scale is None:
        raise InputError("circle", name, "is not there")
    if "file" not in section:
        raise InputError("corner", name, "needs the bars that meet there: draw them first")
    rest = [each for each in circles if each.name != name]
    tables = {
        section.get("corners", CORNERS): as_table(
            CORNER_COLUMNS, [*_corner_rows(found), _corner_row(found, chosen[0])]
        ),
        section.get("arcs", ARCS): arcs_table(rest, found.scale) if rest else None,
    }
    if not rest:
        section.pop("arcs", None)
    draft.set_keys(f"corner {name}", {"walls": {**section, "corners": section.get("corners", CORNERS)}}, tables)


def delete_corner(draft: Draft, found: ValidationResult, name: str) -> None:
    """Delete a disc in a corner of the frame."""
    section = dict(found.data.get("walls", {}))
    file = section["corners"]
    table = _corner_rows(found)
    left = [row for row in table if row[1] != name]
    if not left:
        section.pop("corners")
    draft.set_keys(
        f"corner {name} deleted", {"walls": section}, {file: as_table(CORNER_COLUMNS, left) if left else None}
    )


def find_corners(image: Image, found: ValidationResult) -> list[Circle]:
    """Find the discs of the frame where its bars meet, without those that are in the table."""
    bars = bars_of(found)
    ends = [(name, end) for name, line in bars for end in line]
    discs = []
    for k, (name, end) in enumerate(ends):
        for other, place in ends[k + 1 :]:
            if float(np.hypot(*(place - end))) < MEETING:
                disc = find_disc(image, (float(end[0]), float(end[1])), within=BETWEEN_BARS)
                if disc is not None:
                    discs.append(Circle(_corner_name(name, other), *disc, side="out"))
    taken = corner_names(found)
    return [each for each in discs if each.name not in taken]


def corner_at(image: Image, found: ValidationResult, x: float, y: float) -> Circle:
    """Return the disc in a corner of the frame that was clicked; raise InputError where no rim is seen."""
    bars = bars_of(found)
    if len(bars) < 2:
        raise InputError("corner", "", "needs the bars that meet there: draw them first")
    disc = find_disc(image, (x, y), within=CLICKED)
    if disc is None:
        raise InputError("corner", "", "has no disc with a visible rim there: draw a circle, and choose what it is")
    away = {name: min(float(np.hypot(end[0] - disc[0], end[1] - disc[1])) for end in line) for name, line in bars}
    name = _corner_name(*sorted(away, key=lambda each: away[each])[:2])
    if name in corner_names(found):
        raise InputError("corner", name, "has a disc already: delete it first")
    return Circle(name, *disc, side="out")


def add_corners(draft: Draft, found: ValidationResult, discs: Sequence[Circle]) -> None:
    """Write discs in the corners of the frame to their table."""
    section = {"corners": CORNERS, **found.data.get("walls", {})}
    rows = [*_corner_rows(found), *(_corner_row(found, each) for each in discs)]
    tables: dict[str, bytes | None] = {section["corners"]: as_table(CORNER_COLUMNS, rows)}
    if "file" in section and _run_through_centres(bars_of(found), [*discs_of(found), *discs]):
        tables[section.pop("file")] = None  # the bars follow from the discs, whose rims are seen better
    change = f"corner {discs[0].name}" if len(discs) == 1 else f"{len(discs)} corners"
    draft.set_keys(change, {"walls": section}, tables)


def _run_through_centres(bars: Sequence[tuple[str, Array]], discs: Sequence[Circle]) -> bool:
    """Whether four bars join the centres of four discs, as far as edges and rims show it."""
    if len(bars) != FRAME or len(discs) != FRAME:
        return False
    centre = np.array([[each.x, each.y] for each in discs])
    radius = np.array([each.radius for each in discs])
    ends = np.concatenate([line for _, line in bars])
    return bool((np.linalg.norm(ends[:, None] - centre, axis=2) < THROUGH * radius).any(axis=1).all())


def bars_of(found: ValidationResult) -> list[tuple[str, Array]]:
    """Names and ends (2, 2) [px] of the straight walls."""
    if found.walls is None or found.scale is None:
        return []
    ends = found.scale.to_pixels(found.walls.endpoints[0])
    return [(found.walls.name[w], ends[w]) for w in np.flatnonzero(found.walls.sides == STRAIGHT).tolist()]


def _corner_name(*bars: str) -> str:
    """Name of the corner between two bars: bottom-left, not left-bottom."""
    return "-".join(sorted(bars, key=lambda each: (each not in ("bottom", "top"), each)))


def _corner_row(found: ValidationResult, circle: Circle) -> tuple[object, ...]:
    assert found.scale is not None
    place = np.array([[circle.x, circle.y]])
    (x, y), size = found.scale.to_world(place)[0].tolist(), float(found.scale.size_at(place)[0])
    return (0, circle.name, round(x, 7), round(y, 7), round(circle.radius * size, 7))


def _corner_rows(found: ValidationResult) -> list[tuple[object, ...]]:
    """Rows of the table of corner discs; none without a table."""
    file = found.data.get("walls", {}).get("corners")
    if file is None or found.experiment is None:
        return []
    table = found.experiment.table(file, CORNER_COLUMNS)
    numbers = (table.numbers(name).tolist() for name in ("x", "y", "radius"))
    return list(zip(table.integers("frame").tolist(), table.text("corner"), *numbers, strict=True))


def moved_corners(found: ValidationResult, after: Scale, moved: Callable[[Array], Array]) -> bytes:
    """Write the table of corner discs anew, in metres of another scale, with their places (n, 2) [px] moved."""
    assert found.experiment is not None
    assert found.scale is not None
    table = found.experiment.table(found.data["walls"]["corners"], CORNER_COLUMNS, optional=("theta",))
    place = found.scale.to_pixels(np.column_stack([table.numbers("x"), table.numbers("y")]))
    size = table.numbers("radius") / found.scale.size_at(place)
    place = moved(place)
    radius = size * after.size_at(place)
    angle = table.text("theta") if "theta" in table.names else None
    rows = [
        (int(frame), corner, *np.round(world, 7).tolist(), round(size, 7), *(() if angle is None else (angle[k],)))
        for k, (frame, corner, world, size) in enumerate(
            zip(table.integers("frame"), table.text("corner"), after.to_world(place), radius.tolist(), strict=True)
        )
    ]
    return as_table(CORNER_COLUMNS if angle is None else (*CORNER_COLUMNS, "theta"), rows)


def set_circles(draft: Draft, found: ValidationResult, circles: Sequence[Circle], name: str) -> None:
    """Write the circular walls, and delete the settings of those that are removed; bars are not changed."""
    if found.scale is None:
        raise InputError(draft.file, "key photographs.pixel_size", "is missing: set the scale before the walls")
    section = dict(found.data.get("walls", {}))
    removed = {each.name for each in circles_of(found)} - {each.name for each in circles}
    section = {key: value for key, value in section.items() if key not in removed}
    file = section.pop("arcs", ARCS)
    if circles:
        section = {"arcs": file, **section}
    elif not section.keys() & {"file", "corners"}:
        section = {}
    draft.set_keys(name, {"walls": section or None}, {file: arcs_table(circles, found.scale) if circles else None})


def arcs_table(circles: Sequence[Circle], scale: Scale) -> bytes:
    """Write the table of arcs of frame 0, in metres."""
    place = np.array([[each.x, each.y] for each in circles])
    world, size = scale.to_world(place), scale.size_at(place)
    rows = [
        (0, each.name, *np.round(world[k], 7).tolist(), round(each.radius * float(size[k]), 7), each.side)
        for k, each in enumerate(circles)
    ]
    return as_table(ARC_COLUMNS, rows)


def circle_through(points: Array, name: str, side: str) -> Circle:
    """Return the circle through three points (3, 2) [px]; raise InputError where they lie on a line."""
    a, b, c = points
    ab, ac = b - a, c - a
    twice = float(ab[0] * ac[1] - ab[1] * ac[0])
    longest = max(float(ab @ ab), float(ac @ ac), float((c - b) @ (c - b)))
    if abs(twice) < FLAT * longest:
        raise InputError("circle", "", "the three points lie on a line: click them far apart on the rim")
    d, e = float(ab @ ab), float(ac @ ac)
    from_a = np.array([ac[1] * d - ab[1] * e, ab[0] * e - ac[0] * d]) / (2.0 * twice)
    return Circle(name, float(a[0] + from_a[0]), float(a[1] + from_a[1]), float(np.linalg.norm(from_a)), side)


def circle_around(found: ValidationResult, name: str) -> Circle:
    """Return the smallest circle around the rods of the first photograph; raise InputError if they are too few."""
    rods = found.rods
    if rods is None or len(rods.id) < 8:
        raise InputError("circle", "", "needs the rods: detect them first (step Rods), or click three points")
    angle = 2.0 * np.pi * np.arange(RIM) / RIM
    rim = np.stack([
        rods.x[:, None] + rods.radius[:, None] * np.cos(angle), rods.y[:, None] + rods.radius[:, None] * np.sin(angle)
    ], axis=-1)  # fmt: skip
    (x, y), radius = cv2.minEnclosingCircle(rim.reshape(-1, 1, 2).astype(np.float32))
    return Circle(name, float(x), float(y), float(radius))


def snapped(image: Image, circle: Circle) -> tuple[Circle, float]:
    """Move a circle onto the edge beside it, if enough is visible; return it with the visible fraction of the edge."""
    reach = min(max(SNAP * circle.radius, 8.0), 40.0)
    (x, y, radius), fraction = snap_to_rim(
        image, (circle.x, circle.y, circle.radius), reach, inside=circle.side == "in"
    )
    return replace(circle, x=x, y=y, radius=radius), fraction


def with_circle(circles: Sequence[Circle], circle: Circle) -> list[Circle]:
    """Add a circle, or replace the one of the same name."""
    if any(each.name == circle.name for each in circles):
        return [circle if each.name == circle.name else each for each in circles]
    return [*circles, circle]


def renamed(circles: Sequence[Circle], name: str, to: str) -> list[Circle]:
    return [replace(each, name=to) if each.name == name else each for each in circles]


def _side(side: int) -> str:
    return "in" if side == IN else "out"
