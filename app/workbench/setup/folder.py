"""What lies in the folder that the workbench was opened on: experiments, photographs of none, the sample."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...experiment.experiment import CONFIG_NAME
from ...experiment.photographs import RAW_SUFFIXES, natural_key
from ...run_folder import SUMMARY, TRACKS, UNFINISHED

PICTURES = frozenset((".png", ".tif", ".tiff", ".jpg", ".jpeg")) | RAW_SUFFIXES
DEEPEST = 3  # folders below the one that was opened
SKIPPED = frozenset(("runs", "node_modules", "__pycache__"))
SAMPLE = "shear"


@dataclass(frozen=True, slots=True)
class Roll:
    """Photographs in one folder that no experiment names."""

    folder: Path
    suffix: str
    files: tuple[Path, ...]


def find_experiments(root: Path) -> list[Path]:
    """Folders with an experiment file, in natural order."""
    return [folder for folder in _folders(root) if (folder / CONFIG_NAME).is_file()]


def find_rolls(root: Path) -> list[Roll]:
    """Photographs that no experiment at or above their folder can name."""
    rolls = []
    for folder in _folders(root):
        if any((up / CONFIG_NAME).is_file() for up in (folder, folder.parent) if up.is_relative_to(root)):
            continue
        kinds: dict[str, list[Path]] = {}
        for file in folder.iterdir():
            if file.suffix.lower() in PICTURES and file.is_file():
                kinds.setdefault(file.suffix, []).append(file)
        rolls += [Roll(folder, suffix, tuple(sorted(each, key=natural_key))) for suffix, each in sorted(kinds.items())]
    return rolls


def home_of(roll: Roll, root: Path) -> tuple[Path, str, str]:
    """Folder, pattern of photographs and name of the experiment that photographs are made into."""
    folder = roll.folder
    shared = [each for each in find_rolls(root) if each.folder.parent == folder.parent and each.folder != folder]
    if folder == root or shared:
        return folder, f"*{roll.suffix}", as_name(folder.name)
    return folder.parent, f"{folder.name}/*{roll.suffix}", as_name(folder.parent.name)


def as_name(text: str) -> str:
    """What an experiment may be called."""
    return re.sub(r"[^\w .+-]", "_", text).strip(" .+-") or "test"


def sample_folder() -> Path | None:
    """The sample that comes with the source; None where only the package is installed."""
    folder = Path(__file__).resolve().parents[3] / "sample_data" / SAMPLE
    return folder if (folder / CONFIG_NAME).is_file() else None


def copy_sample(root: Path) -> Path:
    """A copy of the sample in the folder, to be changed at will."""
    source, target = sample_folder(), root / SAMPLE
    if source is None:
        raise InputError("the sample", "", "is not installed with the package; it comes with the source")
    if not (target / CONFIG_NAME).is_file():
        shutil.copytree(source, target, dirs_exist_ok=True)
    return target


def run_folder(root: Path, name: str) -> Path:
    """Where `rodsight run`, started in the folder, leaves its results."""
    return root / "runs" / name


def run_facts(folder: Path) -> dict[str, Any] | None:
    """What is told of a run at a glance; None where there is none."""
    unfinished = (folder / UNFINISHED).is_dir()
    try:
        summary = json.loads((folder / SUMMARY).read_bytes())
    except (OSError, ValueError):
        return {"unfinished": unfinished} if unfinished or (folder / TRACKS).is_file() else None
    trust = [each for each in summary.get("trust", []) if isinstance(each, int | float)]
    return {
        "unfinished": unfinished,
        "frames": summary.get("frame_count"),
        "rods": summary.get("grain_count"),
        "status": summary.get("status_count", {}),
        "trust": min(trust) if trust else None,
        "lost": summary.get("lost_grains"),
        "finished_at": (folder / SUMMARY).stat().st_mtime,
    }


def _folders(root: Path, depth: int = 0) -> Iterator[Path]:
    yield root
    if depth == DEEPEST:
        return
    for each in sorted(root.iterdir(), key=natural_key):
        if each.is_dir() and not each.name.startswith(".") and each.name not in SKIPPED and not each.is_symlink():
            yield from _folders(each, depth + 1)
