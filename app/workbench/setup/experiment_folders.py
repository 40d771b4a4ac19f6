"""Contents of the folder that the workbench was opened on: experiments, other photographs, the sample."""

from __future__ import annotations

import os
import re
import shutil
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...experiment.experiment import CONFIG_NAME
from ...experiment.pictures.picture_file import RAW_SUFFIXES
from ...experiment.reading.input_files import read_text_file
from ...experiment.reading.photograph_order import in_order, natural_key
from ...process.atomic import replacing_folder, write_atomically
from ...process.errors import InputError
from ...solver.bodies.wall_shapes import STRAIGHT
from .draft import Draft
from .edits import WALLS, walls_table
from .toml_edit import set_values
from .validation import ValidationResult
from .walls.circles import ARCS, arcs_table, circles_of

PICTURES = frozenset((".png", ".tif", ".tiff", ".jpg", ".jpeg")) | RAW_SUFFIXES
DEEPEST = 3  # folders below the one that was opened
SKIPPED = frozenset(("runs", "node_modules", "__pycache__"))
SAMPLE = "shear"
# Settings of the apparatus and the camera. Rods, corrections, times, loads and truths belong to one test.
SECTIONS = ("material", "tracking", "calibration", "contacts", "solver", "recording")
PHOTOGRAPHS = (
    "interval", "pixel_size", "distance", "lens", "radii", "channel", "rotation", "region", "mask", "follow",
    "max_pixels",
)  # fmt: skip
OF_ONE_TEST = ("file", "arcs", "load", "forces", "corners")  # keys of walls that name tables


@dataclass(frozen=True, slots=True)
class ImageSeries:
    """Photographs in one folder that no experiment names."""

    folder: Path
    suffix: str
    files: tuple[Path, ...]


def find_experiments(root: Path) -> list[Path]:
    """Find the folders with an experiment file, in natural order."""
    return [folder for folder in _folders(root) if _is_file(folder / CONFIG_NAME)]


def find_image_series(root: Path) -> list[ImageSeries]:
    """Find the photographs that no experiment at or above their folder names."""
    found = []
    for folder in _folders(root):
        above = folder.parent
        if _is_file(folder / CONFIG_NAME) or (above.is_relative_to(root) and folder in _named_folders(above)):
            continue
        kinds: dict[str, list[Path]] = {}
        for file in _listed(folder):
            if file.suffix.lower() in PICTURES and _is_file(file):
                kinds.setdefault(file.suffix, []).append(file)
        found += [ImageSeries(folder, suffix, in_order(each)) for suffix, each in sorted(kinds.items())]
    return found


def experiment_place(series: ImageSeries, root: Path) -> tuple[Path, str, str]:
    """Return folder, pattern of photographs and name of the experiment that a series is made into."""
    folder = series.folder
    series_beside = [each.folder for each in find_image_series(root) if each.folder.parent == folder.parent]
    beside = {*series_beside, *(each for each in _listed(folder.parent) if _is_file(each / CONFIG_NAME))} - {folder}
    if folder == root or beside or (folder.parent / CONFIG_NAME).is_file():
        return folder, f"*{series.suffix}", valid_name(folder.name)
    return folder.parent, f"{folder.name}/*{series.suffix}", valid_name(folder.parent.name)


def find_series(root: Path, folder: str, suffix: str) -> ImageSeries:
    """Return the series of a folder, by its path from the root; raise InputError where it is not there any more."""
    for each in find_image_series(root):
        if each.folder.relative_to(root).as_posix() == folder and each.suffix == suffix:
            return each
    raise InputError(root, f"photographs {folder}/*{suffix}", "are not there any more, or belong to an experiment")


def _named_folders(folder: Path) -> tuple[Path, ...]:
    """The folders of the photographs that the experiment of a folder names; all where it cannot be read."""
    file = folder / CONFIG_NAME
    if not _is_file(file):
        return ()
    try:
        section = tomllib.loads(read_text_file(file).decode("utf-8")).get("photographs")
    except (OSError, ValueError, RecursionError, InputError):
        return tuple(_listed(folder))
    pattern = section.get("files") if isinstance(section, dict) else None
    return ((folder / pattern).parent,) if isinstance(pattern, str) else ()


def valid_name(text: str) -> str:
    """Return a valid name of an experiment, as close to a text as possible."""
    return re.sub(r"[^\w .+-]", "_", text).strip(" .+-") or "test"


def sample_folder() -> Path | None:
    """Return the folder of the sample in the source; None where only the package is installed."""
    folder = Path(__file__).resolve().parents[3] / "sample_data" / SAMPLE
    return folder if (folder / CONFIG_NAME).is_file() else None


def copy_sample(root: Path) -> Path:
    """Copy the sample into the folder."""
    source, target = sample_folder(), root / SAMPLE
    if source is None:
        raise InputError("the sample", "", "is not installed with the package; it comes with the source")
    if not (target / CONFIG_NAME).is_file():
        with replacing_folder(target) as part:
            shutil.copytree(source, part, dirs_exist_ok=True)
    return target


def duplicate(folder: Path, root: Path) -> Path:
    """Copy an experiment into a new folder with a name of its own; photographs are linked, not copied.

    The new folder is beside that of the experiment; where this is the folder that was opened, below it. Experiments
    below it are not copied.
    """
    beside = folder if folder == root else folder.parent
    names = (f"{folder.name} copy", *(f"{folder.name} copy {k}" for k in range(2, 1000)))
    target = next(beside / name for name in names if not (beside / name).exists())

    def left_out(place: str, names: list[str]) -> list[str]:
        below = [name for name in names if _is_file(Path(place, name, CONFIG_NAME))]
        return [name for name in names if name.startswith(".") or name in ("runs", target.name, *below)]

    with replacing_folder(target) as part:
        shutil.copytree(folder, part, copy_function=_link_picture, symlinks=True, ignore=left_out, dirs_exist_ok=True)
        file = part / CONFIG_NAME
        described = set_values(file.read_bytes().decode("utf-8"), {"name": valid_name(target.name)})
        write_atomically(file, described.encode())
    return target


def take_over(draft: Draft, source: ValidationResult) -> None:
    """Write the set-up of another experiment into a new one: settings, scale, walls as they stand on photograph 0."""
    data = source.data
    keys: dict[str, Any] = {name: data[name] for name in SECTIONS if name in data}
    section = data.get("photographs", {})
    keys |= {f"photographs.{name}": section[name] for name in PHOTOGRAPHS if name in section}
    tables: dict[str, bytes | None] = {}
    walls, scale = source.walls, source.scale
    if walls is not None and scale is not None:
        bars, circles = walls.sides == STRAIGHT, circles_of(source)
        names = [walls.name[w] for w in np.flatnonzero(bars).tolist()]
        kept = {key: value for key, value in data["walls"].items() if key not in OF_ONE_TEST}
        if names:
            tables[WALLS] = walls_table(names, scale.to_pixels(walls.endpoints[0])[bars], scale)
            kept["file"] = WALLS
        if circles:
            tables[ARCS] = arcs_table(circles, scale)
            kept["arcs"] = ARCS
        keys["walls"] = kept
    draft.set_keys("set-up taken over", keys, tables)


def _link_picture(source: str, target: str) -> None:
    """Link a photograph, which nothing changes; copy any other file."""
    if Path(source).suffix.lower() in PICTURES:
        with suppress(OSError):  # another file system, or one without links
            os.link(source, target)
            return
    shutil.copy2(source, target)


def run_folder(root: Path, name: str) -> Path:
    """Return the folder to which `rodsight run`, started in the root, writes its results."""
    return root / "runs" / name


def _listed(folder: Path) -> list[Path]:
    """Return what a folder holds; nothing where it may not be read."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _is_file(file: Path) -> bool:
    """Whether there is a file; not where its folder may not be entered."""
    try:
        return file.is_file()
    except OSError:
        return False


def _is_folder(place: Path) -> bool:
    """Whether this is a folder of the root, not a link that leads elsewhere."""
    try:
        return place.is_dir() and not place.is_symlink()
    except OSError:
        return False


def _folders(root: Path, depth: int = 0) -> Iterator[Path]:
    yield root
    if depth == DEEPEST:
        return
    for each in sorted(_listed(root), key=natural_key):
        if not each.name.startswith(".") and each.name not in SKIPPED and _is_folder(each):
            yield from _folders(each, depth + 1)
