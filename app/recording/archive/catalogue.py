"""A folder of recordings as a catalogue: their properties as a table."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ..files.properties import EXPERIMENT, OUTCOME
from ..parts import is_later_part

RECORDING = "recording.rrd"  # of a run, in a folder of its own
# Side files of another recording, and recordings that are being written.
_SIDE_FILES = ("recording-sweeps.rrd", "recording-live.rrd")

Value = str | int | float


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """One recording of a folder."""

    file: Path
    properties: dict[str, Value] | None  # by name, for instance "experiment:friction"; None: the file is damaged


def find_recordings(folder: Path | str) -> list[Path]:
    """Return the recordings in a folder and those of the runs in its folders, sorted by name."""
    folder = Path(folder)
    loose = [file for file in folder.glob("*.rrd") if file.name not in _SIDE_FILES and not is_later_part(file)]
    return sorted([*loose, *folder.glob(f"*/{RECORDING}")])


def read_catalogue(files: Sequence[Path]) -> list[CatalogueRow]:
    """Read the properties of recordings; None for a file that cannot be read."""
    rows = []
    for file in files:
        try:
            rows.append(CatalogueRow(file, read_properties(file)))
        except OSError:
            rows.append(CatalogueRow(file, None))
    return rows


def read_properties(file: Path) -> dict[str, Value]:
    """Read the properties of a recording that are single values; raise OSError if it cannot be read."""
    found: dict[str, Value] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # of a missing end store() raises
            store = RrdReader(str(file)).store()
        for name in (EXPERIMENT, OUTCOME):
            chunks = store.stream().filter(content=f"/__properties/{name}").to_chunks()
            for chunk in chunks:
                for row in chunk.to_record_batch().to_pylist():
                    values = {key: value for key, value in row.items() if isinstance(value, list) and len(value) == 1}
                    found |= {f"{name}:{key}": value[0] for key, value in values.items()}
    except (RuntimeError, ValueError) as error:
        raise OSError(f"{file} cannot be read as a recording: {error}") from error
    return found
