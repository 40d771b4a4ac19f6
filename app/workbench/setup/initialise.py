"""An experiment set up from flags, by the same edits as on the page; a failure reverts all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...experiment.photographs import Channel, Image, ImageSelection, Photographs, read_photograph
from ...experiment.plausibility import rods_cut_by_walls
from ...process.atomic import write_atomically
from ...process.errors import InputError
from . import edits
from .draft import Draft
from .experiment_folders import valid_name
from .setup_picture import draw_setup
from .validation import ValidationResult, first_tracks, validate

PICTURE = "understood.png"
FOUND, NONE = "auto", "none"


@dataclass(frozen=True, slots=True)
class SetupFlags:
    """Values of the flags, in SI units; None: not given."""

    photographs: str
    name: str | None = None
    pixel_size: float | None = None
    interval: float | None = None
    radii: tuple[float, ...] = ()
    walls: str = FOUND  # auto: found around the rods; none; or a table of their ends in metres
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] by wall
    material: Mapping[str, Any] = field(default_factory=dict)
    channel: Channel | None = None
    region: tuple[int, ...] = ()  # [px] first column and row, last column and row
    follow: str | None = None  # texture or outline
    radius_range: tuple[float, float] | None = None  # [px] where the radii are unknown


def initialise(folder: Path, flags: SetupFlags) -> ValidationResult:
    """Write experiment.toml, grains.csv, walls.csv and a picture to check them by.

    Raises
    ------
    InputError
        A value is wrong, or the experiment exists already; nothing is written then.
    """
    draft = Draft(folder)
    if draft.file.exists():
        raise InputError(draft.file, "", "is there already: change it by rodsight open, or delete it")
    photographs = Photographs.matching(folder, flags.photographs)
    name = flags.name if flags.name is not None else valid_name(folder.resolve().name)
    with draft.one_step("new experiment"):
        edits.begin(draft, name, flags.photographs)
        keys = {
            "photographs.interval": flags.interval, "photographs.pixel_size": flags.pixel_size,
            "photographs.radii": list(flags.radii) or None, "photographs.channel": flags.channel,
            "photographs.region": list(flags.region) or None, "photographs.follow": flags.follow,
            **{f"material.{key}": value for key, value in flags.material.items() if value is not None},
        }  # fmt: skip
        draft.set_keys("values of the flags", {key: value for key, value in keys.items() if value is not None})
        _without_errors(draft, "photographs")
        selection = ImageSelection(flags.channel or "grey", flags.region or None)  # type: ignore[arg-type]
        found, notes = _find_rods_and_walls(draft, flags, selection.cut(_first(photographs, selection)))
        write_atomically(folder / PICTURE, draw_setup(_first(photographs, selection), found))
    for note in notes:
        found.steps["walls"].add_warning(note)
    return found


def _first(photographs: Photographs, selection: ImageSelection) -> Image:
    return read_photograph(photographs.files[0], channel=selection.channel)


def _find_rods_and_walls(draft: Draft, flags: SetupFlags, first: Image) -> tuple[ValidationResult, list[str]]:
    """Find rods and walls, and set the pressures; also return sentences on walls that were left out."""
    notes: list[str] = []
    found = _without_errors(draft, "photographs", "scale", "material")
    detection = edits.detect(first, found, flags.radii, flags.radius_range)
    if detection.count == 0:
        raise InputError(found.files[0], "", "no rods were found; give their --radii, or mark them by rodsight open")
    edits.set_rods(draft, "rods", edits.as_guess(detection), flags.radii)
    if flags.walls == NONE:
        if flags.pressure:
            raise InputError("--pressure", next(iter(flags.pressure)), "loads a wall, but there are none: --walls none")
        return validate(draft), notes
    if flags.walls == FOUND:
        found = validate(draft)
        lines = edits.find_walls(first, found)
        names = edits.names_of(lines)
        edits.set_walls(draft, found, list(zip(names, lines, strict=True)), "walls")
        found = validate(draft)
        cut = {} if found.walls is None else rods_cut_by_walls(first_tracks(found), found.walls.frames(0, 1))
        if cut:
            whole = [(name, line) for name, line in zip(names, lines, strict=True) if name not in cut]
            edits.set_walls(draft, found, whole, "walls that cut through no rod")
            notes += [
                f"Wall {name!r} is left out, since it would cut through {count} rod{'s' if count > 1 else ''}."
                for name, count in cut.items()
            ]
    else:
        source = Path(flags.walls)
        if not source.is_file():
            raise InputError("--walls", flags.walls, "is neither auto, none nor a table frame,wall,x1,y1,x2,y2")
        if source.resolve() != (draft.folder / edits.WALLS).resolve():
            write_atomically(draft.folder / edits.WALLS, Path(source).read_bytes())
        draft.set_keys("walls", {"walls.file": edits.WALLS})
    for wall, pressure in flags.pressure.items():
        found = validate(draft)
        if found.walls is not None and wall not in found.walls.name:
            there = ", ".join(found.walls.name)
            raise InputError("--pressure", f"{wall}={pressure:g}", f"there is no such wall; there are {there}")
        edits.set_plate(draft, found, wall, {"pressure": pressure})
    return _without_errors(draft, *validate(draft).steps), notes


def _without_errors(draft: Draft, *steps: str) -> ValidationResult:
    """Validate the draft; raise InputError where a given value is wrong, not where one is missing."""
    found = validate(draft)
    for name in steps:
        for sentence in found.steps[name].errors:
            raise InputError(draft.file, "", sentence)
    return found


def parse_pressures(texts: Sequence[str]) -> dict[str, float]:
    """Parse pressures [Pa] of walls from WALL=PASCAL; raise InputError for other text."""
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


def parse_region(text: str | None) -> tuple[int, ...]:
    """Parse a region from four whole numbers between commas; raise InputError for other text."""
    try:
        region = tuple(int(each) for each in text.split(",")) if text is not None else ()
        if len(region) not in (0, 4):
            raise ValueError
    except ValueError:
        raise InputError("--region", str(text), "is not X0,Y0,X1,Y1 in pixels, such as 100,50,3900,2700") from None
    return region


def parse_radius_range(text: str | None) -> tuple[float, float] | None:
    """Parse a range of radii [px] A:B; raise InputError for other text."""
    if text is None:
        return None
    try:
        least, most = (float(each) for each in text.split(":"))
        if not 3.0 < least < most < 1e5:
            raise ValueError
    except ValueError:
        raise InputError("--radius-range", text, "is not A:B in pixels, with 3 < A < B, such as 40:60") from None
    return least, most


def parse_radii(text: str | None) -> tuple[float, ...]:
    """Parse radii [m] from numbers between commas; raise InputError for other text."""
    try:
        radii = tuple(float(each) for each in (text or "").split(",") if each.strip())
    except ValueError:
        radii = (-1.0,)
    if any(not 0.0 < radius < 1e3 for radius in radii):
        raise InputError("--radii", str(text), "must be lengths in metres between commas, such as 0.007,0.008,0.011")
    return radii
