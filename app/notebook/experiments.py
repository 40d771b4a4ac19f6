"""Experiments in Python: set up, checked, tracked, followed while the test runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack

import numpy as np
import pandas as pd

from .. import pipeline
from ..process.errors import InputError
from ..process.progress import Progress
from ..run_folder import hold_run
from ..tracks import Tracks, TrackStatus
from .arguments import arguments_named, as_frames, as_strings, is_number
from .made_runs import folder_of, run
from .run import Run

Settings = Mapping[str, object]
TRACK_UNITS = {"time": "s", "x": "m", "y": "m", "theta": "rad", "radius": "m", "sigma": "m"}


class InitOptions(TypedDict, total=False):
    """Values of a new experiment, as the flags of `rodsight init`, in SI units."""

    name: str
    pixel_size: float
    interval: float
    radii: tuple[float, ...]
    walls: str
    pressure: Mapping[str, float]
    material: Mapping[str, object]
    channel: Literal["grey", "red", "green", "blue"]
    region: tuple[int, int, int, int]
    follow: Literal["texture", "outline"]
    radius_range: tuple[float, float]
    frames: tuple[int, int | None] | tuple[int, int | None, int]
    lens: str | PathLike[str]
    grains: str | PathLike[str]


@arguments_named()
def init(folder: str | PathLike[str], photographs: str, **options: Unpack[InitOptions]) -> pd.DataFrame:
    """Set up an experiment from photographs, as `rodsight init`.

    Writes experiment.toml, grains.csv, walls.csv, and understood.png, a picture to check them by.

    Parameters
    ----------
    folder : path
        Folder of the experiment.
    photographs : str
        Pattern of the photographs, or name of a video, relative to the folder: "photos/*.png".
    **options
        - name : str; default: of the folder.
        - pixel_size : float, side of a pixel [m].
        - interval : float, time between photographs [s].
        - radii : tuple of float, known radius classes [m].
        - walls : 'auto' (default: found around the rods), 'none', or a table of their ends [m].
        - pressure : mapping of str to float, pressure on walls [Pa].
        - material : mapping, keys of [material]: density, length, friction.
        - channel : 'grey', 'red', 'green' or 'blue'; default: the one that shows the rods best.
        - region : tuple of int, first column and row, last column and row [px] of what is looked at.
        - follow : 'texture' or 'outline'; default: by trying both.
        - radius_range : tuple of float, least and greatest radius to look for [px].
        - frames : tuple of int, start, stop and step of the frames of a video.
        - lens : path, calibration of OpenCV.
        - grains : path, the rods as another program has found them: a label image, a table of ImageJ, or a table
          id,x,y,radius [px].

    Returns
    -------
    pandas.DataFrame
        Columns step, state (good, doubtful, missing) and message: what is still needed, and remarks.

    Raises
    ------
    InputError
        A value is wrong, or the experiment exists already; nothing is written then.

    Examples
    --------
    >>> rodsight.init("nothing", "*.jpg")
    Traceback (most recent call last):
    rodsight.process.errors.InputError: nothing: photographs.files = '*.jpg': no file matches
    """
    from ..workbench.setup.initialise import SetupFlags, initialise

    place = Path(folder)
    unknown = sorted(set(options) - InitOptions.__annotations__.keys())
    if unknown:
        raise InputError("init", unknown[0], f"is not an option: there are {', '.join(InitOptions.__annotations__)}")
    given: dict[str, Any] = dict(options)
    if "frames" in given:
        given["frames"] = as_frames(given["frames"])
    given |= {name: Path(given[name]) for name in ("lens", "grains") if name in given}
    found = initialise(place, SetupFlags(photographs, **given))
    rows = [
        (step.name, step.mark.value, message) for step in found.steps.values() for message in (step.messages or [""])
    ]
    return pd.DataFrame(rows, columns=["step", "state", "message"])


def check(
    experiment: str | PathLike[str],
    *,
    predict: bool = True,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> pd.Series:
    """Validate an experiment without computing, and predict the accuracy of its forces, as `rodsight check`.

    Parameters
    ----------
    experiment : path
        Folder of the experiment, or its experiment.toml.
    predict : bool
        Predict the accuracy, from the first twelve photographs or frames of given tracks.
    settings : mapping, optional
        Values by the keys of experiment.toml, which they override.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Returns
    -------
    pandas.Series
        name, frames, photographs, grains, walls, boundaries; expected_correlation of the normal forces with
        expected_low and expected_high (coverage of two thirds); sufficient: whether r of .9 or more is expected and no
        cause of wrong forces is named; notes; diagnosis: these causes; tracked: grains with a pose, of given tracks;
        unused: columns of tables that are not used; prediction in sentences.

    Raises
    ------
    InputError
        The input is invalid: file, row or key, value, and what is expected.

    Examples
    --------
    >>> found = rodsight.check("my_test")
    >>> found["grains"], found["frames"], found["walls"]
    (40, 5, ('bottom', 'right', 'top', 'left'))
    >>> 0.5 < found["expected_correlation"] < 1.0
    True
    """
    from ..input_check import check_input

    report = check_input(folder_of(experiment, "runs", settings, progress=progress), predict=predict)
    return pd.Series({name: getattr(report, name) for name in report.__dataclass_fields__}, dtype=object)


def track(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    frames: tuple[int, int | None] = (0, None),
    report: bool = False,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Track the grains through the photographs, as `rodsight track`; stored tracks of the same input are reused.

    Parameters
    ----------
    experiment : path
        Folder of the experiment, or its experiment.toml.
    out : path, optional
        Folder of the results; default runs/NAME.
    frames : tuple
        First frame, and end or None.
    report : bool
        Write tracking_report.html on the quality of tracking into the folder of the results.
    settings : mapping, optional
        Values by the keys of experiment.toml.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Returns
    -------
    pandas.DataFrame
        Columns frame, time [s], id, x, y [m], theta [rad], radius [m], sigma [m] (standard deviation of a position
        component), zncc, status, as `rodsight.solve` reads them. Lost grains have no row.

    Raises
    ------
    InputError
        The input is invalid, or a report is requested of given tracks.

    Examples
    --------
    >>> tracks = rodsight.track("my_test", out="runs/shear")
    >>> len(tracks), tracks.attrs["units"]["theta"]
    (200, 'rad')
    """
    folder = folder_of(experiment, out, settings, frames, progress)
    if report and folder.experiment.config.photographs is None:
        raise InputError(folder.experiment.file, "report", "needs photographs, but these tracks come from a table")
    with hold_run(folder):
        tracks, walls = pipeline.track(folder)
        if report:
            pipeline.report_tracking(folder, tracks, walls)
    return _table(tracks)


def follow(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    idle: float | None = None,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> Iterator[Run]:
    """Follow a running test, as `rodsight run --follow`: photographs are tracked and solved as they arrive.

    Parameters
    ----------
    experiment : path
        Folder of the experiment, or its experiment.toml.
    out : path, optional
        Folder of the results; default runs/NAME.
    idle : float, optional
        Time without a photograph after which to end [s]; default: never.
    settings : mapping, optional
        Values by the keys of experiment.toml.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Yields
    ------
    Run
        The frames solved so far, after every arrival; at the end the complete run with its recording. Suspect and
        failed frames have that status in `run.frames()`.

    Raises
    ------
    InputError
        The experiment has no photographs, interval or walls.
    RunError
        Another process works in the folder.

    Examples
    --------
    >>> for run in rodsight.follow("my_test", idle=60.0):
    ...     print(run.frames()[["frame", "status", "trust"]].tail(1))
    Traceback (most recent call last):
    rodsight.process.errors.InputError: my_test/experiment.toml: --follow: needs [photographs] and [walls]
    """
    from ..following.follow import follow as follow_photographs

    if idle is not None and not (is_number(idle) and idle > 0.0):
        raise InputError("idle", str(idle), "is not a positive number of seconds")
    folder, texts = folder_of(experiment, out, settings, progress=progress), as_strings(settings or {})
    with hold_run(folder):
        for results in follow_photographs(
            folder, tuple(texts), idle=idle, alarm=lambda frame, text: None, report=lambda text: None
        ):
            frames, statistics = list(results.frames), list(results.statistics)
            yield Run(replace(results, frames=frames, statistics=statistics))
    yield run(experiment, out=folder.folder, settings=settings, progress=folder.progress)


def _table(tracks: Tracks) -> pd.DataFrame:
    """Return the poses as a table: one row per frame and present grain."""
    frame, grain = np.nonzero(tracks.present)
    columns: dict[str, Any] = {
        "frame": frame, "time": tracks.time[frame], "id": tracks.id[grain],
        "x": tracks.position[frame, grain, 0], "y": tracks.position[frame, grain, 1],
        "theta": tracks.rotation[frame, grain], "radius": tracks.radius[grain],
        "sigma": tracks.sigma[frame, grain], "zncc": tracks.zncc[frame, grain],
        "status": [TrackStatus(each).name.lower() for each in tracks.status[frame, grain].tolist()],
    }  # fmt: skip
    table = pd.DataFrame(columns)
    table.attrs["units"] = dict(TRACK_UNITS)
    return table
