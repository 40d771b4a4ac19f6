"""A folder of recordings as a catalogue: its recordings by their properties, as a table or in the viewer.

The table is read from the files alone. The viewer shows the same properties as columns where Rerun's own catalogue
server can be given the blueprint, for which the package `datafusion` is needed (extra `catalog`).
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

from ..look import entities
from ..parts import is_later_part
from ..tabs.blueprint import make_blueprint
from ..tabs.layout_property import read_layout
from ..viewing.viewer import viewer_binary, viewer_environment
from .properties import EXPERIMENT, OUTCOME

RECORDING = "recording.rrd"  # of a run, in a folder of its own
DATASET = "runs"
# Recordings that belong to another one, or are still being written.
_PARTS = ("recording-sweeps.rrd", "recording-live.rrd")

Value = str | int | float


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """One recording of a folder."""

    file: Path
    properties: dict[str, Value] | None  # by name, "experiment:friction" for instance; None: the file is damaged


def find_recordings(folder: Path | str) -> list[Path]:
    """The recordings of a folder: files in it, and those of the runs in its folders, by name."""
    folder = Path(folder)
    loose = [file for file in folder.glob("*.rrd") if file.name not in _PARTS and not is_later_part(file)]
    return sorted([*loose, *folder.glob(f"*/{RECORDING}")])


def read_entries(files: Sequence[Path]) -> list[CatalogueRow]:
    """The properties of recordings; none of those that cannot be read."""
    entries = []
    for file in files:
        try:
            entries.append(CatalogueRow(file, read_properties(file)))
        except OSError:
            entries.append(CatalogueRow(file, None))
    return entries


def read_properties(file: Path) -> dict[str, Value]:
    """The properties of a recording that are single values; raises OSError where it cannot be read."""
    found: dict[str, Value] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rr.error_utils.RerunWarning)  # of a missing end: store() raises for it
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
    """Whether the catalogue server can be given the blueprint here."""
    return importlib.util.find_spec("datafusion") is not None


@contextmanager
def serve(files: Sequence[Path]) -> Iterator[str]:
    """Serve recordings as a catalogue on this machine; gives the address of their table.

    Every recording opens with the tabs, framed as the first one is. Raises ImportError without `datafusion`.
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


def show_together(address: str | Sequence[Path]) -> subprocess.Popen[bytes]:
    """Open the viewer's window on a catalogue, or on several recordings at once; gives its process."""
    shown = [address] if isinstance(address, str) else [str(file) for file in address]
    return subprocess.Popen(
        [str(viewer_binary()), "--hide-welcome-screen", *shown],
        env=viewer_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
