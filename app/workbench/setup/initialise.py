"""An experiment set up from flags: the same edits as on the page, in their order; nothing is left where one fails."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...atomic import write_atomically
from ...errors import InputError
from ...experiment.photographs import Photographs, read_photograph
from . import edits
from .draft import Draft
from .folder import as_name
from .steps import Understood, judge
from .understood import draw_understood

PICTURE = "understood.png"
FOUND, NONE = "auto", "none"


@dataclass(frozen=True, slots=True)
class Told:
    """What the flags say; SI units. None: not told."""

    photographs: str
    name: str | None = None
    pixel_size: float | None = None
    interval: float | None = None
    radii: tuple[float, ...] = ()
    walls: str = FOUND  # auto: found around the rods; none; or a table of their ends in metres
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] by wall
    material: Mapping[str, Any] = field(default_factory=dict)


def initialise(folder: Path, told: Told) -> Understood:
    """Write experiment.toml, grains.csv, walls.csv and a picture of what was understood.

    Raises InputError for what cannot be understood, and for an experiment that is there already; nothing is written
    then.
    """
    draft = Draft(folder)
    if draft.file.exists():
        raise InputError(draft.file, "", "is there already: rodsight open changes it, or delete it")
    photographs = Photographs.matching(folder, told.photographs)
    name = told.name if told.name is not None else as_name(folder.resolve().name)
    with draft.one_step("new experiment"):
        edits.begin(draft, name, told.photographs)
        keys = {
            "photographs.interval": told.interval, "photographs.pixel_size": told.pixel_size,
            "photographs.radii": list(told.radii) or None,
            **{f"material.{key}": value for key, value in told.material.items() if value is not None},
        }  # fmt: skip
        draft.set_keys("what is known", {key: value for key, value in keys.items() if value is not None})
        found = _settle(draft, told, read_photograph(photographs.files[0]))
        write_atomically(folder / PICTURE, draw_understood(read_photograph(photographs.files[0]), found))
    return found


def _settle(draft: Draft, told: Told, first: Any) -> Understood:
    """Find rods and walls, and load these."""
    found = _sound(draft, "photographs", "scale", "material")
    detection = edits.detect(first, found, told.radii)
    if detection.count == 0:
        raise InputError(found.files[0], "", "no rods were found; tell their --radii, or set them by rodsight open")
    edits.set_rods(draft, "rods", edits.as_guess(detection), told.radii)
    if told.walls == NONE:
        if told.pressure:
            raise InputError("--pressure", next(iter(told.pressure)), "loads a wall, and there are none: --walls none")
        return judge(draft)
    if told.walls == FOUND:
        found = judge(draft)
        lines = edits.find_walls(first, found)
        names = edits.names_of(lines)
        edits.set_walls(draft, found, list(zip(names, lines, strict=True)), "walls")
    else:
        source = Path(told.walls)
        if not source.is_file():
            raise InputError("--walls", told.walls, "is neither auto, none nor a table frame,wall,x1,y1,x2,y2")
        if source.resolve() != (draft.folder / edits.WALLS).resolve():
            shutil.copyfile(source, draft.folder / edits.WALLS)
        draft.set_keys("walls", {"walls.file": edits.WALLS})
    for wall, pressure in told.pressure.items():
        found = judge(draft)
        if found.walls is not None and wall not in found.walls.name:
            there = ", ".join(found.walls.name)
            raise InputError("--pressure", f"{wall}={pressure:g}", f"there is no such wall; there are {there}")
        edits.set_plate(draft, found, wall, {"pressure": pressure})
    return _sound(draft, *judge(draft).steps)


def _sound(draft: Draft, *steps: str) -> Understood:
    """What is understood; raises InputError where something that was told is wrong, not where it is missing."""
    found = judge(draft)
    for name in steps:
        for sentence in found.steps[name].wrong:
            raise InputError(draft.file, "", sentence)
    return found


def parse_pressures(texts: Sequence[str]) -> dict[str, float]:
    """Pressures [Pa] of walls from WALL=PASCAL. Raises InputError."""
    found: dict[str, float] = {}
    for text in texts:
        wall, equals, value = text.partition("=")
        try:
            if not equals or not wall.strip():
                raise ValueError
            found[wall.strip()] = float(value)
        except ValueError:
            raise InputError("--pressure", text, "is not WALL=PASCAL, such as top=50e3") from None
    return found


def parse_radii(text: str | None) -> tuple[float, ...]:
    """Radii [m] from numbers between commas. Raises InputError."""
    try:
        radii = tuple(float(each) for each in (text or "").split(",") if each.strip())
    except ValueError:
        radii = (-1.0,)
    if any(not 0.0 < radius < 1e3 for radius in radii):
        raise InputError("--radii", str(text), "must be lengths in metres between commas, such as 0.007,0.008,0.011")
    return radii
