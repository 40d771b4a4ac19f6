"""Runs in Python: tables of contacts, grains, frames and walls with their units."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import pandas as pd

from ..exchange.tidy_tables import TableName, make_table
from ..out_of_date import state_of_source
from ..process.counts import state_count
from ..process.errors import FigureError, InputError, MissingFileError, MissingFrameError
from ..process.frame_range import ALL_FRAMES
from ..results.hdf5.store import Provenance, load_results, origin_of, save_results
from ..results.manifest import Manifest
from ..results.results import Results
from ..results.summary import summarize
from ..run_folder import RECORDING
from ..run_truth import truth_of
from .arguments import as_whole
from .inline import show_recording

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from ..figures.figure_style import Width
    from ..inference.inputs import Inputs


class Run:
    """Results of a run. Made by `rodsight.run`, `rodsight.open` and `rodsight.solve`.

    Tables are pandas.DataFrames in SI units, named in `.attrs["units"]`; unknown values are NaN. Files are read on
    first access.

    Examples
    --------
    >>> import rodsight
    >>> run = rodsight.open("runs/shear")
    >>> contacts = run.contacts(frame=3)
    >>> bearing = contacts[contacts["fn"] > contacts["fn"].mean()]  # the strong network
    >>> contacts.attrs["units"]["fn"]
    'N'
    """

    def __init__(self, results: Results | Path, inputs: Inputs | None = None) -> None:
        """Make a run from results in memory with their inputs, or from their file, which is read on first access."""
        self._source, self.inputs = results, inputs

    @classmethod
    def in_memory(cls, results: Results, name: str, configuration: str, inputs: Inputs) -> Run:
        """Make a run of a sequence that was just solved, with all of its frames in memory."""
        frames, statistics = list(results.frames), list(results.statistics)
        named = replace(results, name=name, configuration=configuration, frames=frames, statistics=statistics)
        return cls(named, inputs)

    @cached_property
    def results(self) -> Results:
        """All results as arrays."""
        return self._source if isinstance(self._source, Results) else load_results(self._source)

    @property
    def name(self) -> str:
        """The experiment's name."""
        return self.results.name

    @property
    def file(self) -> Path | None:
        """Path of results.h5; None for a run in memory."""
        return None if isinstance(self._source, Results) else self._source

    def contacts(self, frame: int | None = None) -> pd.DataFrame:
        """Return contacts: bodies, point [m], normal, gap [m], forces with standard deviations [N], state.

        i and j are ids of grains; at a wall j is −1 and `wall` is its name, which is empty between grains. f_n > 0 is
        compression. Forces are those that i exerts on j: f_n along the normal (nx, ny) from i to j, f_t along that
        normal rotated by +90°.

        Parameters
        ----------
        frame : int, optional
            Default: all frames.

        Raises
        ------
        InputError
            If there is no such frame; it is an IndexError as well.

        Examples
        --------
        >>> run = rodsight.open("runs/shear")
        >>> list(run.contacts(frame=3).columns[:9])
        ['frame', 'time', 'i', 'j', 'wall', 'x', 'y', 'nx', 'ny']
        >>> sorted(set(run.contacts(frame=3).query("wall != ''")["wall"]))
        ['bottom', 'left', 'right', 'top']
        >>> grains = run.grains().rename(columns={"id": "j"})
        >>> pairs = run.contacts().query("j >= 0").merge(grains, on=["frame", "j"], suffixes=("", "_j"))
        >>> bool(pairs["radius"].gt(0).all())
        True
        """
        return self._table("contacts", frame)

    def grains(self, frame: int | None = None) -> pd.DataFrame:
        """Return grains of one frame or all: pose, stress, coordination number, motion since the frame before, D²min.

        Parameters
        ----------
        frame : int, optional
            Default: all frames.

        Notes
        -----
        - `stress_xx` … `stress_yy` [Pa], compression positive: σ = Σ f ⊗ R n / V over its own volume V = π R² L,
          f and n the forces and normals of its contacts (J. Weber 1966, A. E. H. Love 1927). The mean weighted with V,
          times the solid fraction, is the stress of the packing. `pressure` is half its trace.
        - `coordination_number`: Σ P(bears force) over its contacts, those with walls included.
        - `displacement_x`, `displacement_y` [m], `rotation` [rad]: since the frame before; `theta` [rad] since frame 0.
        - `strain_xx`, `strain_xy`, `strain_yy`: ½ ln(F Fᵀ) of the deformation gradient F that fits the motion of its
          neighbours best, since the frame before; extension positive. Neighbours are grains whose surfaces are less
          than one mean diameter apart.
        - `D2min` [m²]: (1/m) Σ |d′ − F d|² over its m neighbours, d and d′ their distances before and after
          (M. L. Falk & J. S. Langer, Phys. Rev. E 57, 7192, 1998, there without 1/m).

        Raises
        ------
        InputError
            If there is no such frame; it is an IndexError as well.

        Examples
        --------
        >>> grains = rodsight.open("runs/shear").grains(frame=3)
        >>> grains.attrs["units"]["theta"]
        'rad'
        >>> rattlers = grains[grains["coordination_number"] < 2]
        >>> plastic = grains.nlargest(5, "D2min")
        >>> grains.attrs["units"]["stress_xy"], grains.attrs["units"]["D2min"]
        ('Pa', 'm2')
        """
        return self._table("grains", frame)

    def frames(self) -> pd.DataFrame:
        """Return one row per frame: status, trust, residuals and statistics of the packing.

        Examples
        --------
        >>> frames = rodsight.open("runs/shear").frames()
        >>> trusted = frames[frames["status"].isin(["settled", "settling"]) & (frames["trust"] > 0.8)]
        >>> frames["status"].iloc[0]
        'reset'
        """
        return self._table("frames", None)

    def walls(self, frame: int | None = None) -> pd.DataFrame:
        """Return walls of one frame or all: ends [m], pressure [Pa], inferred and recorded forces [N].

        Examples
        --------
        >>> walls = rodsight.open("runs/shear").walls(frame=0).set_index("wall")
        >>> float(walls.loc["top", "pressure"])
        50000.0
        """
        return self._table("walls", frame)

    def summary(self) -> dict[str, Any]:
        """Return the summary of `rodsight run` as plain values.

        Examples
        --------
        >>> rodsight.open("runs/shear").summary()["resets"]
        [0]
        """
        return summarize(self.results, None, {}) | {"out_of_date": self.out_of_date}

    @cached_property
    def out_of_date(self) -> list[str]:
        """Reasons for which the run is out of date, such as "walls.csv has changed"; empty: it belongs to its input.

        Examples
        --------
        >>> rodsight.open("runs/shear").out_of_date
        []
        """
        return [] if self.file is None else state_of_source(self.file)

    def dataset(self) -> xarray.DataTree:
        """Return all results as an xarray.DataTree with dimensions, labels and units; paths as in results.h5.

        `xarray.open_datatree("runs/shear/results.h5")` gives the same. Contacts of all frames are concatenated;
        `frame_of_contact` is their frame.

        Examples
        --------
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
        """Return the contacts of a frame as a networkx.Graph: nodes are grains and walls, edges have forces [N].

        Raises
        ------
        InputError
            If there is no such frame, which is an IndexError as well, or networkx is not installed (`pip install
            'rodsight[graph]'`).

        Examples
        --------
        >>> graph = rodsight.open("runs/shear").graph(frame=3)
        >>> graph.nodes["top"]["kind"]
        'wall'
        >>> graph.graph["units"]["fn"]
        'N'
        """
        from ..exchange.contact_graph import make_graph

        return make_graph(self.results, self.checked_frame(frame))

    def save(self, file: str | PathLike[str]) -> Path:
        """Write the results to an HDF5 file, which `rodsight.open` and the commands read as any results.h5.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InputError
            If its folder does not exist, which is a FileNotFoundError as well, or the file is that of a run on the
            disk, which `rodsight.run` alone writes.

        Examples
        --------
        >>> run = rodsight.open("runs/shear")
        >>> without = rodsight.what_if(run, friction=0.2)
        >>> without.save("friction_0.2.h5").name
        'friction_0.2.h5'
        >>> rodsight.open("friction_0.2.h5").name
        'my_test (what if)'
        """
        path = Path(file)
        if not path.parent.is_dir():
            raise MissingFileError(path, "", "there is no such folder")
        if path.is_dir():
            raise InputError(path, "", "is a folder: name a file in it, such as results.h5")
        if Manifest(path.parent).piece(path.name):
            raise InputError(path, "", "belongs to a run on the disk: choose another name")
        origin = Provenance("", "", ALL_FRAMES, {}) if self.file is None else origin_of(self.file)
        save_results(path, self.results, origin)
        return path

    def view(self) -> Any:
        """Show the recording: below the cell of a notebook, otherwise in the viewer.

        Returns
        -------
        IPython.display.HTML or str or None
            HTML in a notebook; otherwise None after opening the viewer, or a sentence on how to view the recording.

        Raises
        ------
        InputError
            If the run has no recording, such as one of `rodsight.solve`; it is a FileNotFoundError as well.
        """
        file = None if self.file is None else self.file.with_name(RECORDING)
        if file is None or not file.is_file():
            raise MissingFileError(
                "", "", "there is no recording of this run: rodsight.run and `rodsight record` write one"
            )
        return show_recording(file)

    def figure(
        self, name: str = "forces", frame: int | None = None, *, width: Width = "single", against: Run | None = None
    ) -> Figure:
        """Draw a figure for a paper, to be saved with `.savefig("x.pdf")`.

        Parameters
        ----------
        name : {'forces', 'density', 'rose', 'stress', 'time', 'sheet', 'kinematics', 'fringes', 'truth', 'difference'}
            Force network, P(f), rose of contact directions, stress, curves over time, small networks of a long
            run, motion beyond the mean field, fringes beside the forces, inferred over true forces, or their difference
            as a map.
        frame : int, optional
            Default: the last settled frame.
        width : {'single', 'double'}
            85 or 175 mm.
        against : Run, optional
            Another run of the same packing, from which 'difference' is drawn; default: the truth of the experiment.

        Raises
        ------
        InputError
            If the figure is unknown or has no data, which is a ValueError as well, or there is no such frame, which is
            an IndexError as well.

        Examples
        --------
        >>> rodsight.open("runs/shear").figure("forces", frame=3).savefig("forces.pdf")
        """
        from ..figures.figure_style import Width
        from ..figures.gallery import NEED_TRUTH, draw_figure

        needs_truth = name in NEED_TRUTH and against is None
        truth = truth_of(self._source) if needs_truth and isinstance(self._source, Path) else None
        if against is not None and not isinstance(against, Run):
            raise InputError("figure", f"against = {against!r}", "is not a run: open it by rodsight.open")
        other = None if against is None else against.results
        number = None if frame is None else self.checked_frame(frame)
        if width not in get_args(Width):
            raise InputError("figure", f"width = {width!r}", f"is not one of {', '.join(get_args(Width))}")
        try:
            return draw_figure(self.results, name, number, width=width, truth=truth, against=other)
        except ValueError as error:
            raise FigureError("figure", repr(name), str(error)) from None

    def __repr__(self) -> str:
        tracks = self.results.tracks
        grains = state_count(tracks.grain_count, "grain")
        state = f", out of date: {'; '.join(self.out_of_date)}" if self.out_of_date else ""
        return f"<rodsight.Run {self.name!r}: {grains}, {state_count(tracks.frame_count, 'frame')}{state}>"

    def checked_frame(self, frame: int) -> int:
        """Return the frame. Raises InputError, which is an IndexError as well if there is no such frame.

        Examples
        --------
        >>> rodsight.open("runs/shear").checked_frame(7)
        Traceback (most recent call last):
        rodsight.process.errors.MissingFrameError: there is no frame 7: frames go from 0 to 4
        """
        number, count = as_whole("frame", frame), self.results.tracks.frame_count
        if not 0 <= number < count:
            raise MissingFrameError("", "", f"there is no frame {number}: frames go from 0 to {count - 1}")
        return number

    @cached_property
    def _tables(self) -> dict[str, pd.DataFrame]:
        """Tables made so far."""
        return {}

    def _table(self, name: TableName, frame: int | None) -> pd.DataFrame:
        if name not in self._tables:
            stored = make_table(self.results, name)
            self._tables[name] = stored.to_pandas()
            self._tables[name].attrs["units"] = {
                each.name: each.metadata[b"unit"].decode() for each in stored.schema if b"unit" in (each.metadata or {})
            }
        table = self._tables[name]
        if frame is None:
            return table.copy()
        return table.loc[table["frame"] == self.checked_frame(frame), :].reset_index(drop=True)
