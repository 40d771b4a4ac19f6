"""A run as a notebook sees it: tables of contacts, grains, frames and walls, with their units."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from .. import pipeline
from ..exchange.tidy_tables import make_tables
from ..experiment.experiment import load_experiment
from ..progress import Progress, silent
from ..results.results import Results
from ..results.store import load_results
from ..results.summary import summarize
from ..run_folder import RESULTS, owned
from ..run_folder import Run as RunFolder
from .settings import as_texts


class Run:
    """What a run found out. Made by `rodsight.run`, `rodsight.open` and `rodsight.solve`.

    Tables are pandas.DataFrames in SI units, named in `.attrs["units"]`; what is not known is NaN.
    """

    def __init__(self, results: Results | Path) -> None:
        """results: in memory, or the file that holds them, which is read when it is first needed."""
        self._source = results

    @cached_property
    def results(self) -> Results:
        """Everything, as arrays."""
        return self._source if isinstance(self._source, Results) else load_results(self._source)

    @property
    def name(self) -> str:
        """The experiment's name."""
        return self.results.name

    @property
    def file(self) -> Path | None:
        """Where results.h5 lies; None for a run that was never on disk."""
        return None if isinstance(self._source, Results) else self._source

    def contacts(self, frame: int | None = None) -> pd.DataFrame:
        """Contacts of one frame, or of all: bodies, point [m], normal, gap [m], forces and their errors [N], state.

        i is a grain's id; j is a grain's id or a wall's name, as text. f_n > 0 is compression; forces are those that i
        exerts on j.
        """
        return self._table("contacts", frame)

    def grains(self, frame: int | None = None) -> pd.DataFrame:
        """Grains in one frame, or in all: id, radius [m], pose [m, rad] and how well it is known."""
        return self._table("grains", frame)

    def frames(self) -> pd.DataFrame:
        """One row a frame: status, trust, residuals and the statistics of the packing."""
        return self._table("frames", None)

    def walls(self, frame: int | None = None) -> pd.DataFrame:
        """Walls in one frame, or in all: ends [m], pressure [Pa], and the forces [N] on them, inferred and recorded."""
        return self._table("walls", frame)

    def summary(self) -> dict[str, Any]:
        """The facts that a person reads at the end of `rodsight run`, as plain values."""
        return summarize(self.results, None, {})

    def __repr__(self) -> str:
        tracks = self.results.tracks
        return f"<rodsight.Run {self.name!r}: {tracks.grain_count} grains, {tracks.frame_count} frames>"

    @cached_property
    def _tables(self) -> dict[str, pd.DataFrame]:
        tables = {}
        for name, table in make_tables(self.results).items():
            tables[name] = table.to_pandas()
            tables[name].attrs["units"] = {
                each.name: each.metadata[b"unit"].decode() for each in table.schema if each.metadata
            }
        return tables

    def _table(self, name: str, frame: int | None) -> pd.DataFrame:
        table = self._tables[name]
        if frame is None:
            return table.copy()
        count = self.results.tracks.frame_count
        if not 0 <= frame < count:
            raise IndexError(f"there is no frame {frame}: frames go from 0 to {count - 1}")
        return table.loc[table["frame"] == frame, :].reset_index(drop=True)


def run(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    settings: Mapping[str, object] | None = None,
    frames: tuple[int, int | None] = (0, None),
    progress: Progress = silent,
) -> Run:
    """Photographs or tracks to forces and a recording: what `rodsight run` does, with its defaults.

    experiment: its folder or its experiment.toml; out: folder of the results, default runs/<name>; settings: by the
    keys of experiment.toml, {"solver.kappa": 0.1}, laid over it; frames: first, and end or None. What is there already
    is not done again.
    Raises InputError for bad input, RunError where another process works in the folder or nothing can be solved.
    """
    began = time.perf_counter()
    loaded = load_experiment(Path(experiment), as_texts(settings or {}))
    folder = Path(out) if out is not None else Path("runs") / loaded.name
    at = RunFolder(loaded, folder, frames, progress)
    with owned(at):
        results = pipeline.solve(at)
        truth = pipeline.load_truth(at, results)
        pipeline.record(at, results, truth)
        pipeline.conclude(at, results, truth, began)
    return Run(at.file(RESULTS))


def open_run(path: str | PathLike[str]) -> Run:
    """Open the results of a run: its folder, or results.h5 itself, of any version. Raises FileNotFoundError."""
    file = Path(path) / RESULTS if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"{file}: there are no results")
    return Run(file)
