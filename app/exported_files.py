"""Files of a run for other programs and for papers: tables, VTK, OVITO, graphs, tracker files, figures, pictures, film.

The command `export` and `rodsight.export` call these functions.
"""

from __future__ import annotations

import io
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from .process.errors import InputError
from .process.progress import Progress

if TYPE_CHECKING:
    from .experiment.units import Scale
    from .figures.figure_style import Width
    from .figures.gallery import FigureSet, FileKind
    from .figures.paper.paper_set import Picture
    from .results.results import Results, TruthContacts

ExportKind = Literal["pictures", "video", "figures", "tables", "vtk", "ovito", "graph", "dic"]
TableForm = Literal["csv", "parquet"]
Timeline = Literal["frame", "sweep"]
# Kinds to which each option applies; out and quiet apply to all.
KINDS_OF_OPTION: dict[str, tuple[ExportKind, ...]] = {
    "kind": ("tables",),
    **dict.fromkeys(("frames", "timeline", "step", "tab", "view", "size", "figure"), ("pictures", "video")),
    "rate": ("video",),
    "pixel_size": ("dic",),
    **dict.fromkeys(("frame", "formats", "width", "set"), ("figures",)),
}
CHOICES = {
    "kind": get_args(TableForm), "timeline": get_args(Timeline), "formats": ("pdf", "svg", "png"),
    "width": ("single", "double"),
}  # fmt: skip
SMALLEST, LARGEST = 100, 8192  # [px] width and height of a picture


def check_options(what: ExportKind, given: Mapping[str, object]) -> None:
    """Raise InputError for an option that does not apply to a kind, or a value that is none of its choices.

    Parameters
    ----------
    what : ExportKind
        What is to be written.
    given : mapping of str to object
        Values by option, spelt as in Python or on the command line; None: not given.
    """
    for option, value in given.items():
        if value is None:
            continue
        name = option.removeprefix("--").replace("-", "_")
        if what not in KINDS_OF_OPTION[name]:
            kinds = " and ".join(KINDS_OF_OPTION[name])
            raise InputError("export", f"{option} with {what}", f"applies to {kinds} only")
        for each in value if isinstance(value, tuple | list) else (value,):
            if name in CHOICES and each not in CHOICES[name]:
                raise InputError("export", f"{option} {each!r}", f"is not one of {', '.join(CHOICES[name])}")


@dataclass(frozen=True, slots=True)
class Drawing:
    """Pictures of a recording to draw."""

    recording: Path
    timeline: str
    times: tuple[int, int | None] | None  # first and end on the timeline; None: all
    step: int
    tab: str | None
    view: str | None
    size: tuple[int, int]  # [px] width and height
    rate: float  # [1/s] pictures of a film

    def __post_init__(self) -> None:
        if self.step < 1:
            raise InputError("--step", str(self.step), "is not a positive number")
        if not 0.0 < self.rate <= 120.0:
            raise InputError("--rate", str(self.rate), "is not between 0 and 120 pictures a second")
        if not all(SMALLEST <= side <= LARGEST for side in self.size):
            size = "x".join(map(str, self.size))
            raise InputError("--size", size, f"is not WIDTHxHEIGHT in pixels from {SMALLEST} to {LARGEST}")


def write_data(
    kind: ExportKind,
    results: Results,
    target: Path,
    *,
    form: TableForm = "csv",
    pixel_size: float | None = None,
) -> list[Path]:
    """Write results in a data format into a folder; return the files.

    Parameters
    ----------
    kind : {'tables', 'vtk', 'ovito', 'graph', 'dic'}
    results : Results
    target : Path
        Folder to write to.
    form : {'csv', 'parquet'}
        Of tables.
    pixel_size : float, optional
        Side of a pixel [m], for dic; default: the experiment's.
    """
    from .exchange.contact_graph import write_graphs
    from .exchange.dic_files import write_sequence
    from .exchange.ovito_files import write_ovito
    from .exchange.tidy_tables import write_tables
    from .exchange.vtk_polydata import write_polydata

    writers: dict[str, Callable[[], list[Path]]] = {
        "tables": lambda: write_tables(results, target, form),
        "dic": lambda: write_sequence(results.tracks, _scale_of(results, pixel_size), target, results.walls),
        "vtk": lambda: write_polydata(results, target),
        "ovito": lambda: write_ovito(results, target),
        "graph": lambda: write_graphs(results, target),
    }
    return writers[kind]()


def draw_pictures(drawing: Drawing, out: Path | None, progress: Progress, *, film: bool) -> list[Path]:
    """Draw a recording as a film, or as pictures; return the files.

    Raises
    ------
    InputError
        A value is out of range, or the pictures cannot be drawn here.
    """
    from .recording.viewing.headless import NoPictureError
    from .recording.viewing.pictures import PictureSettings, timeline_values, write_film, write_pictures

    recording = drawing.recording
    try:
        first, last = timeline_values(recording, drawing.timeline)
        begin, end = drawing.times or (0, None)
        if drawing.times is not None and not first <= begin <= (last if end is None else end - 1) <= last:
            given = f"{begin}:{'' if end is None else end}"
            raise InputError("--frames", given, f"is not a range of {first}:{last + 1} on the timeline "
                             f"{drawing.timeline}")  # fmt: skip
        chosen = range(max(begin, first), last + 1 if end is None else end, drawing.step)
        shown = PictureSettings(drawing.timeline, drawing.tab, drawing.view, drawing.size)

        def report(done: int, total: int) -> None:
            progress("drawing", done, total)

        if film:
            file = out if out is not None else recording.with_suffix(".mp4")
            write_film(recording, file, chosen, shown, rate=drawing.rate, progress=report)
            return [file]
        folder = out if out is not None else recording.parent / "pictures"
        return write_pictures(recording, folder, chosen, shown, progress=report)
    except NoPictureError as error:
        raise InputError("export", "", str(error)) from None


def draw_figure_frames(
    file: Path, out: Path | None, figure: str, drawing: Drawing, progress: Progress, *, film: bool
) -> list[Path]:
    """Draw a figure of every frame of a run as a film, or as pictures; return the files. Needs no viewer.

    Parameters
    ----------
    file : Path
        results.h5.
    out : Path, optional
        The film, or the folder of the pictures.
    figure : str
        Name of a figure: forces, density, rose, stress, time, truth, difference.
    drawing : Drawing
        Frames, step, width [px] and rate; the other values are not used.
    progress : Progress
    film : bool
        A film instead of pictures.

    Raises
    ------
    InputError
        A value is out of range, or the figure cannot be drawn.
    """
    from .figures.gallery import NEED_TRUTH
    from .process.atomic import write_atomically
    from .recording.viewing.film_file import encode_film
    from .recording.viewing.headless import NoPictureError
    from .results.hdf5.store import load_results
    from .run_truth import truth_of
    from .solver.frame_forces import FrameStatus

    results, truth = load_results(file), truth_of(file) if figure in NEED_TRUTH else None
    begin, end = drawing.times or (0, None)
    chosen = range(len(results.frames))[begin : end : drawing.step]
    frames = [k for k in chosen if results.frames[k].status is not FrameStatus.FAILED]
    if not frames:
        raise InputError("--frames", f"{begin}:{'' if end is None else end}", "names no frame with forces")

    def pictures() -> Iterator[bytes]:
        for done, k in enumerate(frames, 1):
            yield _figure_as_png(results, figure, k, truth, drawing.size[0])
            progress("drawing", done, len(frames))

    try:
        if film:
            target = out if out is not None else file.with_name(f"{figure}.mp4")
            encode_film(target, pictures(), drawing.rate)
            return [target]
        folder = out if out is not None else file.parent / "pictures"
        files = [folder / f"{figure}_{k:06d}.png" for k in frames]
        folder.mkdir(parents=True, exist_ok=True)
        for each, picture in zip(files, pictures(), strict=True):
            write_atomically(each, picture)
        return files
    except (ValueError, NoPictureError) as error:
        raise InputError("--figure", figure, str(error)) from None


def _figure_as_png(results: Results, figure: str, frame: int, truth: TruthContacts | None, width: int) -> bytes:
    from .figures.figure_style import paper_style
    from .figures.gallery import draw_figure

    drawn = draw_figure(results, figure, frame, width="double", truth=truth)
    stream = io.BytesIO()
    with paper_style():
        drawn.savefig(stream, format="png", dpi=width / float(drawn.get_size_inches()[0]))
    return stream.getvalue()


def write_run_figures(
    file: Path,
    out: Path | None,
    formats: tuple[FileKind, ...],
    frame: int | None,
    width: Width | None = None,
    figures: FigureSet = "results",
) -> list[Path]:
    """Write the figures of a run, also against the truth if there is one; return the files.

    Parameters
    ----------
    file : Path
        results.h5.
    out : Path, optional
        Folder; default: figures beside the results, or figures/paper.
    formats : tuple of str
        Kinds of files.
    frame : int, optional
        The frame to draw.
    width : str, optional
        Columns; default: single, of the paper's set double.
    figures : {'results', 'paper'}
        Which set.

    Raises
    ------
    InputError
        There is no such frame, or a figure cannot be drawn.
    """
    from .figures.gallery import write_figures, write_paper_set
    from .results.hdf5.store import load_results
    from .run_truth import truth_of

    results, truth = load_results(file), truth_of(file)
    try:
        if figures == "paper":
            folder = file.parent / "figures" / "paper" if out is None else out
            return write_paper_set(
                results, folder, formats, frame=frame, width=width or "double", truth=truth,
                pictures=_end_pictures(file, results),
            )  # fmt: skip
        folder = file.parent / "figures" if out is None else out
        return write_figures(results, folder, formats, frame=frame, width=width or "single", truth=truth)
    except (IndexError, ValueError) as error:
        raise InputError("export figures", "" if frame is None else f"--frame {frame}", str(error)) from None


def _end_pictures(file: Path, results: Results) -> list[Picture]:
    """Return the photographs of the first and the last frame; none where the run has none or they are missing."""
    import numpy as np

    from .experiment.experiment import load_experiment
    from .experiment.scaling import make_scale
    from .figures.paper.paper_set import Picture
    from .results.hdf5.store import origin_of
    from .run_folder import find_experiment

    try:
        origin = origin_of(file)
        experiment = load_experiment(find_experiment(file, origin))
        section = experiment.config.photographs
        if section is None:
            return []
        photographs = experiment.photographs()
        scale = make_scale(section, photographs.shape[0], results.calibration)
        pictures = []
        for frame in (0, results.tracks.frame_count - 1):
            grey = photographs[origin.frames.start + frame * origin.frames.step]
            rows, columns = grey.shape
            (left, top), (right, bottom) = scale.to_world(np.array([[-0.5, -0.5], [columns - 0.5, rows - 0.5]]))
            pictures.append(Picture(frame, grey, (float(left), float(right), float(bottom), float(top))))
        return pictures
    except InputError:
        return []


def _scale_of(results: Results, pixel_size: float | None) -> Scale:
    """Return the scale of the photographs; an unknown height is chosen to contain the packing."""
    from .experiment.config.experiment_file import ExperimentFile
    from .experiment.units import Scale

    if pixel_size is None:
        section = ExperimentFile.model_validate(tomllib.loads(results.configuration)).photographs
        given = section.pixel_size if section is not None else None
        pixel_size = given[0] if isinstance(given, tuple) else given
    if pixel_size is None:
        raise InputError("--pixel-size", "", "is missing: these grains were not tracked in photographs")
    if not pixel_size > 0.0:
        raise InputError("--pixel-size", str(pixel_size), "is not positive")
    tracks = results.tracks
    top = tracks.position[tracks.present][:, 1].max() + tracks.radius.max()
    return Scale(pixel_size, int(top / pixel_size) + 2)
