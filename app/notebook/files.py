"""Files of other programs in Python: imported as experiments, exported from runs."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, get_args

import pandas as pd

from ..exchange.foreign.format_names import FileFormat
from ..exported_files import (
    Drawing,
    ExportKind,
    TableForm,
    Timeline,
    check_options,
    draw_pictures,
    write_data,
    write_run_figures,
)
from ..process.errors import InputError, naming
from ..run_folder import RECORDING
from .arguments import arguments_named, as_mapping, is_number
from .comparisons import Source, as_run
from .shown_progress import shown_progress

DRAWN = ("pictures", "video")
FIGURES = "figures"
DATA_FRAME, WALL_FRAME = "data frame", "data frame of walls"  # their names in messages
BELOW_HEADER = 2  # line of a written table that holds its first row


class ImportOptions(TypedDict, total=False):
    """How to read the files, as the options of `rodsight import`."""

    form: FileFormat
    pixel_size: float
    y_down: bool
    height: float
    degrees: bool
    radius: float
    interval: float
    precision: float
    walls: str | PathLike[str] | pd.DataFrame
    pressure: Mapping[str, float]
    load: Mapping[str, float]
    corner_radius: float
    pairs: str | PathLike[str]


class ExportOptions(TypedDict, total=False):
    """Options of `rodsight export`, each for some kinds."""

    kind: TableForm
    pixel_size: float
    frames: tuple[int, int | None]
    timeline: Timeline
    step: int
    tab: str
    view: str
    size: tuple[int, int]
    rate: float
    frame: int
    formats: tuple[Literal["pdf", "svg", "png"], ...]
    width: Literal["single", "double"]


@arguments_named()
def import_table(
    source: str | PathLike[str] | pd.DataFrame,
    folder: str | PathLike[str],
    columns: Mapping[str, str | int] | None = None,
    **options: Unpack[ImportOptions],
) -> pd.DataFrame:
    """Convert a table of another program to an experiment folder, as `rodsight import`.

    Parameters
    ----------
    source : path or data frame
        Table, or folder of files, depending on the form.
    folder : path
        Folder of the new experiment.
    columns : mapping of str to str or int, optional
        Names of columns, or their numbers from 1, by role: frame, id, x, y, theta, radius or diameter, time.
    **options
        - form : 'table' (default), 'trackpy', 'trackmate', 'rodtracker', 'lammps', 'yade', 'mercury', 'pegs', 'dic'.
        - pixel_size : float, the files' unit of length [m]; default: metres.
        - y_down : bool, y points down, as in pictures; height [px] of a photograph: y is measured from its last row.
        - degrees : bool, theta is in degrees.
        - radius : float, of all grains without one, in the files' unit.
        - interval : float, time between photographs, or of a step [s].
        - precision : float, standard deviation of a position, in the files' unit.
        - walls : 'box', 'outer', 'none', or a table frame,wall,x1,y1,x2,y2: a data frame, or its file.
        - pressure : mapping of str to float, on walls [Pa]; load : the same in newtons.
        - corner_radius : float, of the corner discs of a frame, in the files' unit.
        - pairs : path, pair forces of a simulation [N] as truth.

    Returns
    -------
    pandas.DataFrame
        The imported tracks: frame, id, x, y [m], theta [rad], radius [m]. `.attrs["remarks"]`: what was assumed, or
        could not be converted.

    Raises
    ------
    InputError
        The files cannot be read, or the folder holds an experiment already.

    Examples
    --------
    >>> import pandas as pd
    >>> spots = pd.DataFrame({"t": [0, 0, 1, 1], "rod": [1, 2, 1, 2], "X": [0.1, 0.12, 0.1, 0.12], "Y": [0.1] * 4})
    >>> roles = {"frame": "t", "id": "rod", "x": "X", "y": "Y"}
    >>> tracks = rodsight.import_table(spots, "from_spots", roles, radius=0.01, walls="box")
    >>> len(tracks), rodsight.check("from_spots", predict=False)["walls"]
    (4, ('bottom', 'right', 'top', 'left'))
    """
    from ..exchange.foreign.import_files import ImportRequest, import_files

    known = ImportOptions.__annotations__
    for name in options:
        if name not in known:
            raise InputError("import_table", name, f"is not an option: there are {', '.join(known)}")
    form: FileFormat = options.get("form", "table")
    others: dict[str, Any] = {name: each for name, each in options.items() if name != "form"}
    if "pairs" in others:
        others["pairs"] = Path(others["pairs"])
    for name in ("pressure", "load"):
        others[name] = _numbers_by_wall(name, others.get(name, {}))
    roles = as_mapping("columns", columns or {}, 'roles to columns, such as {"x": "X", "y": "Y"}')
    roles = {role: str(each) for role, each in roles.items()}
    with tempfile.TemporaryDirectory(prefix="rodsight-") as place:
        file = _as_file("source", source, Path(place) / DATA_FRAME)
        if "walls" in others:
            others["walls"] = str(_as_file("walls", others["walls"], Path(place) / WALL_FRAME))
        files = [naming(Path(place) / name, name, first_row=BELOW_HEADER) for name in (DATA_FRAME, WALL_FRAME)]
        with files[0], files[1]:
            imported, _ = import_files(ImportRequest(form, file, roles, **others), Path(folder))
    tracks = imported.tracks
    frame, grain = tracks.present.nonzero()
    table = pd.DataFrame(
        {
            "frame": frame, "id": tracks.id[grain], "x": tracks.position[frame, grain, 0],
            "y": tracks.position[frame, grain, 1], "theta": tracks.rotation[frame, grain],
            "radius": tracks.radius[grain],
        }
    )  # fmt: skip
    table.attrs["units"] = {"x": "m", "y": "m", "theta": "rad", "radius": "m"}
    table.attrs["remarks"] = list(imported.remarks)
    return table


def _as_file(name: str, value: object, file: Path) -> Path:
    """Return the path that is given, or write a data frame to a file. Raises InputError for what is neither."""
    if isinstance(value, pd.DataFrame):
        value.to_csv(file, index=False)
        return file
    if not isinstance(value, str | PathLike):
        raise InputError("import_table", f"{name} = {type(value).__name__}", "is neither a path nor a data frame")
    return Path(value)


def _numbers_by_wall(name: str, value: object) -> dict[str, float]:
    given = as_mapping(f"import_table: {name}", value, 'walls to numbers, such as {"top": 50e3}')
    for wall, number in given.items():
        if not is_number(number):
            raise InputError("import_table", f"{name} = {{{wall!r}: {number!r}}}", "is not a number")
    return {str(wall): float(number) for wall, number in given.items()}


@arguments_named()
def export(
    what: ExportKind, results: Source, out: str | PathLike[str] | None = None, **options: Unpack[ExportOptions]
) -> list[Path]:
    """Write a run for another program or for a paper, as `rodsight export`.

    Parameters
    ----------
    what : {'tables', 'vtk', 'ovito', 'graph', 'dic', 'figures', 'pictures', 'video'}
        vtk is for ParaView, graph (GraphML) for networkx, Gephi and igraph.
    results : Run or path
    out : path, optional
        Folder, or file of a video; default: beside the results, which a run in memory does not have.
    **options
        - kind : 'csv' (default) or 'parquet'; of tables.
        - pixel_size : float [m]; of dic.
        - frames (first, end), timeline ('frame' or 'sweep'), step, tab, view, size (width, height) [px]; of pictures
          and video; rate [1/s] of video.
        - frame, formats ('pdf', 'svg', 'png'), width ('single' or 'double'); of figures.

    Returns
    -------
    list of pathlib.Path
        The files.

    Raises
    ------
    InputError
        The kind is unknown, an option is wrong, or the run has no file or recording that is needed.

    Examples
    --------
    >>> [file.name for file in rodsight.export("tables", "runs/shear", "tables")][:2]
    ['contacts.csv', 'grains.csv']
    """
    run = as_run(results)
    if what not in get_args(ExportKind):
        raise InputError("export", repr(what), f"is not a kind: there are {', '.join(get_args(ExportKind))}")
    for name in options:
        if name not in ExportOptions.__annotations__:
            raise InputError("export", name, f"is not an option: there are {', '.join(ExportOptions.__annotations__)}")
    check_options(what, options)
    target = None if out is None else Path(out)
    if run.file is None and (target is None or what in (*DRAWN, FIGURES)):
        raise InputError("export", what, "needs a run with a folder, or for data the argument out")
    if what in DRAWN:
        assert run.file is not None
        recording = run.file.with_name(RECORDING)
        if not recording.is_file():
            raise InputError(recording, "", "there is no such recording")
        drawing = Drawing(
            recording, options.get("timeline", "frame"), options.get("frames"), options.get("step", 1),
            options.get("tab"), options.get("view"), options.get("size", (1600, 1000)), options.get("rate", 6.0),
        )  # fmt: skip
        return draw_pictures(drawing, target, shown_progress(), film=what == "video")
    if what == FIGURES:
        assert run.file is not None
        formats: Any = options.get("formats", ("pdf", "svg"))
        given: Any = (formats,) if isinstance(formats, str) else tuple(formats)
        return write_run_figures(run.file, target, given, options.get("frame"), options.get("width", "single"))
    if target is None:
        assert run.file is not None
        target = run.file.parent / what
    return write_data(what, run.results, target, form=options.get("kind", "csv"), pixel_size=options.get("pixel_size"))
