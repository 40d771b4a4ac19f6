"""A folder of recordings as a catalogue: their properties as a table, or in the viewer.

The table is read from the files. The viewer shows the same properties as columns if Rerun's catalogue server can
register the blueprint, which requires the package `datafusion` (extra `catalog`).
"""

from __future__ import annotations

import importlib.util
import subprocess
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ..files.properties import EXPERIMENT, OUTCOME
from ..look import entities
from ..parts import is_later_part
from ..tabs.blueprint import make_blueprint
from ..tabs.layout_property import read_layout
from ..viewing.viewer import viewer_binary, viewer_environment

RECORDING = "recording.rrd"  # of a run, in a folder of its own
DATASET = "runs"
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


def can_serve() -> bool:
    """Return whether the catalogue server can register a blueprint in this environment."""
    return importlib.util.find_spec("datafusion") is not None


@contextmanager
def serve(files: Sequence[Path]) -> Iterator[str]:
    """Serve recordings as a catalogue on this machine while the block runs.

    Every recording opens with the tabs and the view bounds of the first one.

    Yields
    ------
    str
        The address of the table of recordings.

    Raises
    ------
    ImportError
        If `datafusion` is not installed.
    """
    with (
        rr.server.Server(host="127.0.0.1", datasets={DATASET: [str(file.resolve()) for file in files]}) as server,
        tempfile.TemporaryDirectory(prefix="rodsight-") as folder,
    ):
        blueprint = Path(folder) / "tabs.rbl"
        make_blueprint(read_layout(files[0])).save(entities.APPLICATION_ID, str(blueprint))
        dataset = server.client().get_dataset(DATASET)
        dataset.register_blueprint(blueprint.resolve().as_uri())
        yield f"{server.url()}/dataset/{dataset.id}"


def show_catalogue(address: str | Sequence[Path]) -> subprocess.Popen[bytes]:
    """Open the viewer on the address of a catalogue, or on several recordings at once, and return its process."""
    shown = [address] if isinstance(address, str) else [str(file) for file in address]
    return subprocess.Popen(
        [str(viewer_binary()), "--hide-welcome-screen", *shown],
        env=viewer_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
