"""A run as a notebook sees it: tables of contacts, grains, frames and walls, with their units."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from .. import pipeline
from ..exchange.tidy_tables import TableName, make_table
from ..experiment.experiment import load_experiment
from ..progress import Progress, silent
from ..results.hdf5.store import load_results
from ..results.results import Results
from ..results.summary import summarize
from ..run_folder import RECORDING, RESULTS, owned
from ..run_folder import Run as RunFolder
from ..run_truth import load_truth, truth_of
from .inline import show_recording
from .settings import as_texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..figures.page import Width

if TYPE_CHECKING:
    import xarray


class Run:
    """What a run found out. Made by `rodsight.run`, `rodsight.open` and `rodsight.solve`.

    Tables are pandas.DataFrames in SI units, named in `.attrs["units"]`; what is not known is NaN. Nothing is read
    before it is asked for.

    Examples:
        >>> import rodsight
        >>> run = rodsight.open("runs/shear")
        >>> contacts = run.contacts(frame=3)
        >>> bearing = contacts[contacts["fn"] > contacts["fn"].mean()]  # the strong network
        >>> contacts.attrs["units"]["fn"]
        'N'
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
        exerts on j: f_n along the normal (nx, ny) from i to j, f_t along that normal turned by +90°. Raises IndexError
        for a frame that is not there.

        Examples:
            >>> run = rodsight.open("runs/shear")
            >>> list(run.contacts(frame=3).columns[:9])
            ['frame', 'time', 'i', 'j', 'with_wall', 'x', 'y', 'nx', 'ny']
            >>> walls = run.contacts(frame=3).query("with_wall")
            >>> sorted(set(walls["j"]))
            ['bottom', 'left', 'right', 'top']
        """
        return self._table("contacts", frame)

    def grains(self, frame: int | None = None) -> pd.DataFrame:
        """Grains in one frame, or in all: id, radius [m], pose [m, rad] and how well it is known.

        Examples:
            >>> grains = rodsight.open("runs/shear").grains(frame=3)
            >>> grains.attrs["units"]["theta"]
            'rad'
            >>> bool(grains["radius"].gt(0).all())
            True
        """
        return self._table("grains", frame)

    def frames(self) -> pd.DataFrame:
        """One row a frame: status, trust, residuals and the statistics of the packing.

        Examples:
            >>> frames = rodsight.open("runs/shear").frames()
            >>> believed = frames[frames["status"].isin(["settled", "settling"]) & (frames["trust"] > 0.8)]
            >>> frames["status"].iloc[0]
            'reset'
        """
        return self._table("frames", None)

    def walls(self, frame: int | None = None) -> pd.DataFrame:
        """Walls in one frame, or in all: ends [m], pressure [Pa], and the forces [N] on them, inferred and recorded.

        Examples:
            >>> walls = rodsight.open("runs/shear").walls(frame=0).set_index("wall")
            >>> float(walls.loc["top", "pressure"])
            50000.0
        """
        return self._table("walls", frame)

    def summary(self) -> dict[str, Any]:
        """The facts that a person reads at the end of `rodsight run`, as plain values.

        Examples:
            >>> rodsight.open("runs/shear").summary()["resets"]
            [0]
        """
        return summarize(self.results, None, {})

    def dataset(self) -> xarray.DataTree:
        """Everything, as an xarray.DataTree: named dimensions, labels, units; paths as in results.h5.

        `xarray.open_datatree("runs/shear/results.h5")` opens the file itself to the same. Contacts of all frames lie
        end to end; `frame_of_contact` says whose they are.

        Examples:
            >>> tree = rodsight.open("runs/shear").dataset()
            >>> tree["tracks/position"].dims
            ('frame', 'grain', 'xy')
            >>> tree["statistics/wall_force"].sel(wall="top", xy="y").attrs["units"]
            'N'
            >>> mean = tree["forces"].to_dataset()["fn"].groupby("frame_of_contact").mean()
            >>> mean.sizes == {"frame_of_contact": 5}
            True
        """
        from ..exchange.labelled_dataset import make_dataset

        return make_dataset(self.results)

    def graph(self, frame: int) -> Any:
        """Contacts of a frame as a networkx.Graph: nodes are ids of grains and names of walls, edges carry forces [N].

        Needs networkx (`pip install 'rodsight[graph]'`), and says so. Raises IndexError for a frame that is not there.

        Examples:
            >>> graph = rodsight.open("runs/shear").graph(frame=3)
            >>> graph.nodes["top"]["kind"]
            'wall'
            >>> graph.graph["units"]["fn"]
            'N'
        """
        from ..exchange.contact_graph import make_graph

        return make_graph(self.results, self._checked(frame))

    def view(self) -> Any:
        """Open the recording: below the cell of a notebook, else in the viewer.

        Returns what a notebook displays, None where a window was opened, or the sentence that says how to look at it.
        Raises FileNotFoundError for a run that has no recording, such as one of `rodsight.solve`.
        """
        file = None if self.file is None else self.file.with_name(RECORDING)
        if file is None or not file.is_file():
            raise FileNotFoundError("there is no recording of this run: rodsight.run and `rodsight record` make one")
        return show_recording(file)

    def figure(self, name: str = "forces", frame: int | None = None, *, width: Width = "single") -> Figure:
        """A figure for a paper, to be saved with `.savefig("x.pdf")`: light, at column width, with units.

        name: forces (the network), density (P(f)), rose, stress, time, or truth (inferred over true forces, where the
        experiment names a truth); frame: default the last settled one; width: single (85 mm) or double (175 mm).
        Raises ValueError for a figure that is not known or has no data, IndexError for a frame that is not there.

        Examples:
            >>> rodsight.open("runs/shear").figure("forces", frame=3).savefig("forces.pdf")
        """
        from ..figures.gallery import draw_figure

        truth = truth_of(self._source) if name == "truth" and isinstance(self._source, Path) else None
        return draw_figure(self.results, name, frame, width=width, truth=truth)

    def __repr__(self) -> str:
        tracks = self.results.tracks
        return f"<rodsight.Run {self.name!r}: {tracks.grain_count} grains, {tracks.frame_count} frames>"

    def _checked(self, frame: int) -> int:
        count = self.results.tracks.frame_count
        if not 0 <= frame < count:
            raise IndexError(f"there is no frame {frame}: frames go from 0 to {count - 1}")
        return frame

    @cached_property
    def _tables(self) -> dict[str, pd.DataFrame]:
        """Those that were asked for."""
        return {}

    def _table(self, name: TableName, frame: int | None) -> pd.DataFrame:
        if name not in self._tables:
            made = make_table(self.results, name)
            self._tables[name] = made.to_pandas()
            self._tables[name].attrs["units"] = {
                each.name: each.metadata[b"unit"].decode() for each in made.schema if b"unit" in (each.metadata or {})
            }
        table = self._tables[name]
        if frame is None:
            return table.copy()
        return table.loc[table["frame"] == self._checked(frame), :].reset_index(drop=True)


def run(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    settings: Mapping[str, object] | None = None,
    frames: tuple[int, int | None] = (0, None),
    progress: Progress = silent,
) -> Run:
    """Photographs or tracks to forces and a recording: what `rodsight run` does, with its defaults.

    experiment: its folder or its experiment.toml; out: folder of the results, default runs/NAME; settings: by the
    keys of experiment.toml, {"solver.kappa": 0.1}, laid over it; frames: first, and end or None. What is there already
    is not done again.
    Raises InputError for bad input, RunError where another process works in the folder or nothing can be solved.

    Examples:
        >>> run = rodsight.run("my_test", out="runs/shear", settings={"solver.sweeps": 50})
        >>> run.name
        'my_test'
    """
    began = time.perf_counter()
    loaded = load_experiment(Path(experiment), as_texts(settings or {}))
    folder = Path(out) if out is not None else Path("runs") / loaded.name
    at = RunFolder(loaded, folder, frames, progress)
    with owned(at):
        results = pipeline.solve(at)
        truth = load_truth(at, results)
        pipeline.record(at, results, truth)
        pipeline.conclude(at, results, truth, began)
    return Run(at.file(RESULTS))


def open_run(path: str | PathLike[str]) -> Run:
    """Open the results of a run: its folder, or results.h5 itself, of any version. Raises FileNotFoundError.

    Examples:
        >>> rodsight.open("runs/shear")
        <rodsight.Run 'my_test': 40 grains, 5 frames>
        >>> rodsight.open("runs/nothing")
        Traceback (most recent call last):
        FileNotFoundError: runs/nothing: there are no results
    """
    file = Path(path) / RESULTS if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"{file}: there are no results")
    return Run(file)
