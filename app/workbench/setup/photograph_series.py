"""Edits of the series of photographs: their order, their places in time, what is left out, how they are rotated.

Tables that name photographs by their number keep naming the same photographs.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...experiment.pictures.mask import outline_of_stroke
from ...experiment.reading.camera_notes import camera_times, read_note
from ...experiment.reading.photograph_order import last_number, relative_name
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from .draft import Draft, as_table
from .edits import GRAIN_COLUMNS, GRAINS, move_walls
from .validation import ValidationResult

ORDER, TIMES = "order.csv", "times.csv"
NUMBERED = {  # tables whose rows belong to a photograph: section and keys
    "photographs": ("times", "corrections"), "walls": ("file", "arcs", "corners", "load", "forces"),
    "boundary": ("periodic",), "": ("truth", "truth_tracks"),
}  # fmt: skip


def describe_series(found: ValidationResult) -> dict[str, Any]:
    """Describe the series for the page: names as set_order takes them, places in time, and what can be done."""
    folder = None if found.experiment is None else found.experiment.folder
    return {
        "names": [relative_name(file, folder) for file in found.files] if folder else [],
        "number": list(found.number),
        "left_out": [relative_name(file, folder) for file in found.left_out] if folder else [],
        "unusable": list(found.unusable), "missing": len(found.missing),
        "clock": bool(found.files) and all(read_note(file).time is not None for file in found.files),
    }  # fmt: skip


def set_order(draft: Draft, found: ValidationResult, names: Sequence[str], change: str) -> None:
    """Use the named photographs in this order; the others are left out.

    Each keeps its place in time where the order is the natural one; else the places are given anew.

    Parameters
    ----------
    draft : Draft
    found : ValidationResult
    names : sequence of str
        Names of files, as the table of the order has them.
    change : str
        Name of the step of undo.

    Raises
    ------
    InputError
        A name is unknown or stands twice, none is left, or another photograph would be the first one, although rods or
        walls are marked on that.
    """
    known = {relative_name(file, draft.folder): file for file in (*found.files, *found.left_out)}
    wrong = next((name for name in names if name not in known or names.count(name) > 1), None)
    if wrong is not None or not names:
        raise InputError(draft.file, f"photograph {wrong!r}", "is unknown, or stands twice: reload the page")
    files = [known[name] for name in names]
    if files[0] != found.files[0] and (found.rods is not None or found.walls is not None):
        raise InputError(
            found.files[0].name, "", "stays the first photograph: rods and walls are marked on it; without them any "
            "other can be the first",
        )  # fmt: skip
    places = _places(found, files)
    rows = zip(names, places, strict=True)
    natural = files == list(found.all_files)
    plain = natural and places == list(range(len(places)))
    content = None if plain else as_table(("file", "number"), rows)
    place_of = {file: k for k, file in enumerate(files)}
    moved = {k: place_of.get(file) for k, file in enumerate(found.files)}
    tables = _renumbered(draft, found.data, moved)
    draft.set_keys(change, {"photographs.order": None if plain else ORDER}, {**tables, ORDER: content})


def _places(found: ValidationResult, files: Sequence[Path]) -> list[int]:
    """The place in time of every photograph, in intervals.

    Each keeps its own where these ascend, and one that was left out takes a free place after the one before it; else
    the same places are given in the new order.
    """
    own = dict(zip(found.files, found.number, strict=True)) or {file: k for k, file in enumerate(found.all_files)}
    places: list[int] = []
    for file in files:
        places.append(own.get(file, places[-1] + 1 if places else 0))
    if all(before < after for before, after in pairwise(places)):
        return places
    return sorted(places) if len(set(places)) == len(places) else list(range(len(places)))


def _renumbered(draft: Draft, data: Mapping[str, Any], moved: Mapping[int, int | None]) -> dict[str, bytes]:
    """The tables whose rows belong to photographs, by new numbers, without rows of photographs that are left out."""
    if all(k == to for k, to in moved.items()):
        return {}
    tables: dict[str, bytes] = {}
    for section, keys in NUMBERED.items():
        values = data.get(section, {}) if section else data
        for key in keys if isinstance(values, dict) else ():
            name = values.get(key)
            content = draft.content(name) if isinstance(name, str) else None
            if content is not None and (table := _renumber(content, moved)) is not None:
                tables[str(name)] = table
    return tables


def _renumber(content: bytes, moved: Mapping[int, int | None]) -> bytes | None:
    """A table with other numbers of frames; None: it has none."""
    rows = list(csv.reader(io.StringIO(content.decode("utf-8", "replace"))))
    if not rows or "frame" not in (head := [each.strip() for each in rows[0]]):
        return None
    at, kept = head.index("frame"), []
    for row in rows[1:]:
        number = int(row[at]) if at < len(row) and row[at].strip().isdigit() else None
        to = number if number is None else moved.get(number, number)
        if to is not None:
            kept.append([*row[:at], to, *row[at + 1 :]])
        elif number is None:
            kept.append(row)
    kept.sort(key=lambda row: row[at] if isinstance(row[at], int) else -1)
    return as_table(rows[0], kept)


def number_by_names(draft: Draft, found: ValidationResult) -> None:
    """Take the places in time from the numbers in the names: where one is missing, two intervals pass."""
    numbers = [last_number(file) for file in found.files]
    known = [each for each in numbers if each is not None]
    steps = np.diff(known)
    if len(known) < len(numbers) or len(known) < 2 or not (steps > 0).all():
        raise InputError(draft.file, "photographs", "have no ascending numbers in their names")
    places = (np.array(known) - known[0]) / float(np.median(steps))
    if not np.allclose(places, np.rint(places)):
        raise InputError(draft.file, "photographs", "have numbers that are no multiples of one step")
    names = [relative_name(file, draft.folder) for file in found.files]
    rows = zip(names, np.rint(places).astype(int).tolist(), strict=True)
    draft.set_keys(
        "places in time by numbers", {"photographs.order": ORDER}, {ORDER: as_table(("file", "number"), rows)}
    )


def add_to_mask(draft: Draft, found: ValidationResult, points: Sequence[Sequence[float]], radius: float) -> None:
    """Add a stroke of a round brush [px] to the mask."""
    mask = found.data.get("photographs", {}).get("mask", [])
    if isinstance(mask, str):
        raise InputError(mask, "key photographs.mask", "is a picture: paint in it, or leave it out first")
    added = [[list(point) for point in polygon] for polygon in outline_of_stroke(points, radius)]
    draft.set_keys("mask", {"photographs.mask": [*mask, *added]})


def use_camera_times(draft: Draft, found: ValidationResult) -> None:
    """Order the photographs by the camera's clock, and take their times from it."""
    files = list(found.files)
    times = camera_times(files)
    if times is None:
        raise InputError(draft.file, "photographs", "do not all have the time of their camera")
    order = np.argsort(times, kind="stable")
    if (np.diff(times[order]) <= 0.0).any():
        k = int(np.flatnonzero(np.diff(times[order]) <= 0.0)[0])
        raise InputError(
            files[order[k + 1]].name, "", f"has the time of {files[order[k]].name}: the camera's clock is too coarse"
        )  # fmt: skip
    names = [relative_name(files[k], draft.folder) for k in order]
    seconds = np.round(times[order] - times[order[0]], 3).tolist()
    with draft.one_step("times of the camera"):
        if (np.diff(order) != 1).any():
            set_order(draft, found, names, "order of the camera")
        keys = {"photographs.times": TIMES, "photographs.interval": None}
        draft.set_keys("times", keys, {TIMES: as_table(("frame", "time"), enumerate(seconds))})


def rotate(draft: Draft, found: ValidationResult, rotation: int) -> None:
    """Rotate the photographs clockwise by so many degrees in all; rods, walls and all that is drawn go with them.

    Raises
    ------
    InputError
        A lens or corrections are given, which do not go with them.
    """
    section = found.data.get("photographs", {})
    for key, words in (("lens", "coefficients of a lens"), ("corrections", "corrections of rods")):
        if section.get(key):
            raise InputError(
                draft.file, f"key photographs.{key}", f"{words} belong to the present rotation: remove them"
            )
    quarters = (rotation - section.get("rotation", 0)) // 90 % 4
    if not quarters or found.shape is None:
        return
    keys: dict[str, Any] = {"photographs.rotation": rotation or None}
    turn = _Turn(quarters, found.shape)
    if "distance" in section:
        both = turn.of(np.array([section["distance"]["start"], section["distance"]["end"]])).tolist()
        keys["photographs.distance"] = {**section["distance"], "start": both[0], "end": both[1]}
    if "region" in section:
        corners = turn.of(np.array(section["region"], np.float64).reshape(2, 2))
        keys["photographs.region"] = [*map(int, corners.min(axis=0)), *map(int, corners.max(axis=0))]
    if isinstance(section.get("mask"), str):
        raise InputError(
            section["mask"], "key photographs.mask", "is a picture: turn it by hand, or leave it out first"
        )
    if "mask" in section:
        keys["photographs.mask"] = [turn.of(np.array(polygon)).tolist() for polygon in section["mask"]]
    tables: dict[str, bytes | None] = {}
    if found.rods is not None:
        place = turn.of(np.column_stack([found.rods.x, found.rods.y]))
        rows = zip(found.rods.id.tolist(), *np.round(place, 4).T.tolist(), found.rods.radius.tolist(), strict=True)
        keys["photographs.grains"] = GRAINS
        tables[GRAINS] = as_table(GRAIN_COLUMNS, rows)
    with draft.one_step("rotation"):
        draft.set_keys("rotation", keys, tables)
        move_walls(draft, found, turn.of)


class _Turn:
    """Places of a picture after quarter turns clockwise."""

    def __init__(self, quarters: int, shape: tuple[int, int]) -> None:
        self._quarters, self._shape = quarters, shape

    def of(self, place: Array) -> Array:
        """Places (…, 2) x, y [px] in the rotated picture."""
        rows, columns = self._shape
        for _ in range(self._quarters):
            place = np.stack([rows - 1 - place[..., 1], place[..., 0]], axis=-1)
            rows, columns = columns, rows
        return place
