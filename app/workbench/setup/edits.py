"""Edits of an experiment that is being set up, each one step of undo.

The page gives lengths in pixels of the photograph, files hold metres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...experiment.experiment import TIME_COLUMNS, GrainGuess
from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...experiment.walls import FORCE_COLUMNS, LOAD_COLUMNS, WALL_COLUMNS
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...tracking.detection.clicked_circle import fit_clicked
from ...tracking.detection.detect import Detection, DetectionSettings
from ...tracking.detection.scale_comparison import find_other_scale, packed_fraction
from ...tracking.missed_rods import detect_rods
from .draft import Draft, as_table
from .validation import ValidationResult, validate
from .walls.circles import arcs_table, circles_of, moved_corners, renamed

# Tables of other programs by their key: section, file, columns, and the keys that they replace.
TABLES: dict[str, tuple[str, str, Sequence[str], Sequence[str]]] = {
    "times": ("photographs", "times.csv", TIME_COLUMNS, ("photographs.interval",)),
    "load": ("walls", "load.csv", LOAD_COLUMNS, ()),
    "forces": ("walls", "wall_forces.csv", FORCE_COLUMNS, ()),
}
GRAINS, WALLS, CORRECTIONS = "grains.csv", "walls.csv", "corrections.csv"
GRAIN_COLUMNS = ("id", "x", "y", "radius")
OVERLAP = 0.15  # [radii] that a rod added by hand may overlap others: clicks and fits have errors
# Radii form classes where so many, from so many rods on, are within so much of one of so few classes.
NEARLY_ALL, FEWEST_EVIDENT, EVIDENT, MOST_EVIDENT = 0.85, 20, 0.015, 5
MOST_CLASSES = 8  # of radii
RARE = 0.08  # fraction of the rods that no class has
# Densities [kg/m³] and textbook friction coefficients of dry, clean rods: initial values.
MATERIALS: dict[str, dict[str, float]] = {
    "aluminium": {"density": 2700.0, "friction": 0.25},
    "brass": {"density": 8500.0, "friction": 0.25},
    "steel": {"density": 7850.0, "friction": 0.25},
    "PVC": {"density": 1400.0, "friction": 0.35},
    "PMMA": {"density": 1190.0, "friction": 0.4},
    "wood": {"density": 700.0, "friction": 0.45},
    "soft photoelastic": {"density": 1060.0, "friction": 0.6},
}


def begin(draft: Draft, name: str, files: str) -> None:
    """Write the experiment file of a series of photographs."""
    draft.set_keys("new experiment", {"name": name, "photographs.files": files})


def set_scale(draft: Draft, keys: dict[str, Any]) -> None:
    """Set pixel_size, or distance; walls keep their place in the picture."""
    _set_and_move_walls(draft, "scale", {"photographs.pixel_size": None, "photographs.distance": None, **keys})


def set_lens(draft: Draft, lens: dict[str, float] | None) -> None:
    """Set the coefficients of the lens; walls keep their place in the picture. Raises InputError for wrong ones."""
    keys = {"photographs.lens": lens}
    with _no_new_message(draft, "lens", "scale"):
        _set_and_move_walls(draft, "lens", keys)


def set_table(draft: Draft, found: ValidationResult, name: str, table: str | None) -> None:
    """Write one of TABLES; None: remove it. Raises InputError where it does not match the experiment."""
    section, file, columns, instead = TABLES[name]
    key = f"{section}.{name}"
    if table is None:
        draft.set_keys(name, {key: None})
        return
    if section == "walls" and found.walls is None:
        raise InputError(file, "", "has values of walls, but there are none: draw the walls first")
    lines = table.removeprefix("\ufeff").splitlines()
    missing = [each for each in columns if not lines or each not in [cell.strip() for cell in lines[0].split(",")]]
    if missing:
        raise InputError(file, "", f"has no column {missing[0]}: the table needs {','.join(columns)}")
    with _no_new_message(draft, name, section, file):
        draft.set_keys(name, {key: file, **dict.fromkeys(instead)}, {file: table.encode()})


@contextmanager
def _no_new_message(draft: Draft, name: str, step: str, file: str | None = None) -> Iterator[None]:
    """One step of undo; it is reverted with InputError if a step gets a message that it did not have before."""
    before = validate(draft).steps[step].messages
    with draft.one_step(name):
        yield
        for message in validate(draft).steps[step].messages:
            if message not in before:
                raise InputError(file or draft.file, "", message)


def _set_and_move_walls(draft: Draft, name: str, keys: dict[str, Any]) -> None:
    """Set keys that define the position of a pixel in the world, and write the walls again."""
    before = validate(draft)
    with draft.one_step(name):
        draft.set_keys(name, keys)
        move_walls(draft, before, lambda place: place)


def move_walls(draft: Draft, before: ValidationResult, moved: Callable[[Array], Array]) -> None:
    """Write walls, circles and corner discs again after an edit of the scale or of the photographs' rotation.

    Parameters
    ----------
    draft : Draft
        After the edit.
    before : ValidationResult
        Of the draft before it.
    moved : callable
        New places (…, 2) [px] of places in the photographs.
    """
    walls, scale = before.walls, before.scale
    after = None if walls is None or scale is None else validate(draft).scale
    if walls is None or scale is None or after is None:
        return
    section, bars = before.data.get("walls", {}), walls.sides == STRAIGHT
    names = [wall for wall, bar in zip(walls.name, bars, strict=True) if bar]
    circles = []
    for each in circles_of(before):  # reads the table of corners, before it is written
        x, y = moved(np.array([each.x, each.y])).tolist()
        circles.append(replace(each, x=x, y=y))
    if "corners" in section:
        draft.write("corners", {section["corners"]: moved_corners(before, after, moved)})
    if names and "file" in section:  # else they run through the corners
        ends = moved(scale.to_pixels(walls.endpoints[0])[bars])
        draft.write("walls", {walls_file(before): walls_table(names, ends, after)})
    if circles:
        draft.write("circles", {section["arcs"]: arcs_table(circles, after)})


def walls_file(found: ValidationResult) -> str:
    """Return the name of the table of walls."""
    walls = found.data.get("walls", {})
    return walls.get("file", WALLS) if isinstance(walls, dict) else WALLS


def set_walls(draft: Draft, found: ValidationResult, walls: Sequence[tuple[str, Array]], change: str) -> None:
    """Write the walls of frame 0 by names and ends (2, 2) [px]; settings of removed walls are deleted."""
    if found.scale is None:
        raise InputError(draft.file, "key photographs.pixel_size", "is missing: set the scale before the walls")
    section = found.data.get("walls", {})
    kept = {key: value for key, value in section.items() if not isinstance(value, dict)}
    names = [name for name, _ in walls]
    known = {*names, *(each.name for each in circles_of(found))}
    plates = {key: value for key, value in section.items() if isinstance(value, dict) and key in known}
    if not walls:
        rest = (
            {key: value for key, value in {**kept, **plates}.items() if key != "file"}
            if {"arcs", "corners"} & kept.keys()
            else None
        )
        draft.set_keys(change, {"walls": rest}, {walls_file(found): None})
        return
    table = walls_table(names, np.array([line for _, line in walls]), found.scale)
    draft.set_keys(change, {"walls": {**kept, "file": walls_file(found), **plates}}, {walls_file(found): table})


def set_plate(draft: Draft, found: ValidationResult, wall: str, values: dict[str, Any]) -> None:
    """Set pressure [Pa] and ends of one wall; None: remove the key."""
    plate = {**found.data.get("walls", {}).get(wall, {}), **values}
    plate = {key: value for key, value in plate.items() if value is not None}
    draft.set_keys(f"wall {wall}", {f"walls.{wall}": plate or None})


def rename_wall(draft: Draft, found: ValidationResult, wall: str, name: str) -> None:
    """Rename a wall."""
    walls, scale = found.walls, found.scale
    if walls is None or scale is None or wall not in walls.name:
        raise InputError(draft.file, f"wall {wall!r}", "is not there")
    if name in walls.name or not name.isidentifier():
        raise InputError(draft.file, f"wall {name!r}", "must be a word of letters and digits that no other wall has")
    bars = walls.sides == STRAIGHT
    section = {name if key == wall else key: value for key, value in found.data["walls"].items()}
    if not bars[walls.name.index(wall)]:
        table = arcs_table(renamed(circles_of(found), wall, name), scale)
        draft.set_keys(f"wall {name}", {"walls": section}, {section["arcs"]: table})
        return
    names = [name if each == wall else each for each, bar in zip(walls.name, bars, strict=True) if bar]
    table = walls_table(names, scale.to_pixels(walls.endpoints[0])[bars], scale)
    draft.set_keys(f"wall {name}", {"walls": section}, {walls_file(found): table})


def detect(
    image: Image, found: ValidationResult, radii: Sequence[float], radius_range: tuple[float, float] | None = None
) -> Detection:
    """Detect the rods of the first photograph.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    found : ValidationResult
    radii : sequence of float
        The known classes [m]; empty: unknown.
    radius_range : tuple of float, optional
        Least and greatest radius [px] to look for, where the classes are unknown.

    Returns
    -------
    Detection
        With circles whose centres lie outside of the picture.
    """
    pixel = None if found.scale is None else found.scale.mean_size
    if radii and pixel is None:
        raise InputError("the scale", "", "is not set: radii in metres cannot be converted to pixels yet")
    classes = tuple(radius / pixel for radius in radii) if pixel is not None else ()
    try:
        settings = DetectionSettings(classes, radius_range)
    except ValueError as error:
        if radius_range is not None:
            raise InputError("--radius-range", "{:g}:{:g}".format(*radius_range), str(error)) from None
        _compare_scales(image, classes, None)
        raise InputError("photographs.radii", str(list(radii)), str(error)) from None
    detection = detect_rods(image, settings)
    if classes:
        _compare_scales(image, classes, detection)
    return within_walls(detection, found)


def _compare_scales(image: Image, classes: Sequence[float], found: Detection | None) -> None:
    """Raise InputError where rods of these classes (radii in pixels) are seen at a scale that differs by a factor."""
    other = find_other_scale(image, classes, found)
    if other is None:
        return
    factor, seen = other
    count, filled = (0, 0.0) if found is None else (found.count, 100.0 * packed_fraction(found))
    raise InputError(
        "scale", "", f"looks {max(factor, 1.0 / factor):g} times too {'large' if factor > 1.0 else 'small'}: at this "
        f"scale {count} circles of the known radii are seen, which fill {filled:.0f} % of their area; at "
        f"{1.0 / factor:g} times it {seen} that are packed. Look at step Scale, and at the unit of the radii.",
    )  # fmt: skip


def set_rods(draft: Draft, change: str, rods: GrainGuess, radii: Sequence[float] | None = None) -> None:
    """Write the table of rods [px]; radii [m]: the classes, None: unchanged."""
    rows = zip(
        rods.id.tolist(), np.round(rods.x, 4).tolist(), np.round(rods.y, 4).tolist(),
        np.round(rods.radius, 4).tolist(), strict=True,
    )  # fmt: skip
    keys: dict[str, Any] = {"photographs.grains": GRAINS if len(rods.id) else None}
    if radii is not None:
        keys["photographs.radii"] = list(radii) or None
    draft.set_keys(change, keys, {GRAINS: as_table(GRAIN_COLUMNS, rows) if len(rods.id) else None})


def as_guess(detection: Detection) -> GrainGuess:
    """Convert detected rods to the table of rods, numbered from top to bottom."""
    return GrainGuess(np.arange(detection.count), detection.x, detection.y, detection.radius)


def fit_rod(image: Image, found: ValidationResult, x: float, y: float, radius: float) -> tuple[float, float, float]:
    """Fit centre and radius [px] of a rod clicked at x, y to its visible rim; unchanged where no rim is visible."""
    section = found.data.get("photographs", {})
    classes: list[float] = section.get("radii") or []
    sizes = np.array([] if found.scale is None else classes) / (1.0 if found.scale is None else found.scale.mean_size)
    if len(sizes):
        # A rod that detection missed has a weak rim; a circle through the rims of its neighbours may be stronger.
        sizes = sizes[sizes <= max((1.0 + OVERLAP) * _free_radius(found.rods, x, y), sizes.min())]
        fallback = x, y, float(sizes[np.abs(sizes - radius).argmin()])
    else:
        fallback = x, y, radius
    return fit_clicked(image, (x, y, radius), sizes.tolist()) or fallback


def _free_radius(rods: GrainGuess | None, x: float, y: float) -> float:
    """Radius [px] of the largest circle about x, y that touches no rod."""
    if rods is None or len(rods.id) == 0:
        return np.inf
    return float((np.hypot(rods.x - x, rods.y - y) - rods.radius).min())


def with_rod(rods: GrainGuess | None, name: int | None, pose: tuple[float, float, float] | None) -> GrainGuess:
    """Return the rods with one added (name None), moved, or removed (pose None)."""
    table: dict[int, tuple[float, float, float]] = {}
    if rods is not None:
        table = dict(zip(rods.id.tolist(), zip(rods.x, rods.y, rods.radius, strict=True), strict=True))
    if name is None:
        name = max(table, default=-1) + 1
    if pose is None:
        table.pop(name, None)
    else:
        table[name] = pose
    columns = np.array(list(table.values()), dtype=np.float64).reshape(-1, 3).T
    return GrainGuess(np.array(list(table), dtype=np.int64), *columns)


def snapped_to(radii: Sequence[float], rods: GrainGuess, scale: Scale) -> GrainGuess:
    """Return the rods with the radius of the nearest class [m]."""
    sizes = np.array(sorted(radii)) / scale.mean_size
    nearest = np.abs(rods.radius[:, None] - sizes).argmin(axis=1)
    return GrainGuess(rods.id, rods.x, rods.y, sizes[nearest])


def find_classes(radius: Array) -> Array:
    """Find radius classes (k,), in the unit of the radii: gaps in the sorted radii separate them."""
    ordered = np.sort(radius)
    if len(ordered) < 2:
        return ordered
    gap = np.diff(ordered)
    parts = np.split(ordered, np.flatnonzero(gap > np.maximum(0.035 * ordered[1:], 3.0 * np.median(gap))) + 1)
    large = sorted((each for each in parts if len(each) >= max(2, 0.01 * len(ordered))), key=len)[-MOST_CLASSES:]
    return np.sort(np.array([np.median(each) for each in large or [ordered]]))


def evident_classes(radius: Array) -> Array | None:
    """Find radius classes (k,) that nearly all radii (n,) share; None where there are none, as in a continuous law."""
    classes = find_classes(radius)
    near = np.abs(radius[:, None] / classes - 1.0) < EVIDENT
    classes = classes[near.mean(axis=0) > RARE]
    if not 0 < len(classes) <= MOST_EVIDENT or len(radius) < FEWEST_EVIDENT:
        return None
    off = np.abs(radius[:, None] / classes - 1.0).min(axis=1)
    return classes if np.mean(off < EVIDENT) >= NEARLY_ALL and np.median(off) < 0.25 * EVIDENT else None


def within_picture(detection: Detection, image: Image) -> Detection:
    """Drop circles whose centres lie outside of the picture (H, W): less than half of such a rod is seen."""
    height, width = image.shape
    x, y = detection.x, detection.y
    return detection.select((x >= -0.5) & (y >= -0.5) & (x <= width - 0.5) & (y <= height - 0.5))


def within_walls(detection: Detection, found: ValidationResult) -> Detection:
    """Drop circles beyond the walls: screws and wheels of the apparatus are round, too."""
    if found.walls is None or found.scale is None:
        return detection
    start, end = found.scale.to_pixels(found.walls.endpoints[0]).transpose(1, 0, 2)
    along = end - start
    place = np.stack([detection.x, detection.y], axis=1)[:, None] - start
    inside: NDArray[np.bool_] = (along[:, 0] * place[..., 1] - along[:, 1] * place[..., 0] < 0.0).all(axis=1)
    return detection if inside.mean() < 0.2 else detection.select(inside)


def walls_table(names: Sequence[str], ends: Array, scale: Scale) -> bytes:
    """Return the table of walls of frame 0, by their ends (w, 2, 2) [px]."""
    metres = np.round(scale.to_world(ends), 9).reshape(-1, 4).tolist()
    return as_table(WALL_COLUMNS, ([0, name, *each] for name, each in zip(names, metres, strict=True)))
