"""Commands that hand results on: share a recording, export forms that other tools and people read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from ...errors import InputError
from ..arguments import Frames, Quiet, parse_frames
from ..terminal import progress_of, tell

if TYPE_CHECKING:
    from ...experiment.units import Scale
    from ...figures.gallery import FileKind
    from ...figures.page import Width
    from ...progress import Progress
    from ...results.results import Results


@dataclass(frozen=True, slots=True)
class Drawing:
    """Which pictures of a recording are drawn, and how."""

    recording: Path
    timeline: str
    times: str | None  # A:B on the timeline
    step: int
    tab: str | None
    view: str | None
    size: str  # WxH
    rate: float  # [1/s] pictures of a film


def export(
    what: Annotated[
        Literal["pictures", "video", "figures", "tables", "vtk", "ovito", "graph", "dic"],
        tyro.conf.Positional,
        tyro.conf.arg(help="to write"),
    ],
    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS", help="a run's folder or file")],
    /,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="PATH", help="folder, or file of a video; default: beside the results")
    ] = None,
    kind: Annotated[Literal["csv", "parquet"], tyro.conf.arg(help="of tables")] = "csv",
    frames: Annotated[str | None, tyro.conf.arg(metavar="A:B", help="pictures, video: of the timeline")] = None,
    timeline: Annotated[
        Literal["frame", "sweep"], tyro.conf.arg(help="pictures, video: what goes on from one to the next")
    ] = "frame",
    step: Annotated[int, tyro.conf.arg(help="pictures, video: every so many values")] = 1,
    tab: Annotated[str | None, tyro.conf.arg(help="pictures, video: the tab to show")] = None,
    view: Annotated[str | None, tyro.conf.arg(help="pictures, video: one view alone, by its title")] = None,
    size: Annotated[str, tyro.conf.arg(metavar="WxH", help="pictures, video: of the window [px]")] = "1600x1000",
    rate: Annotated[float, tyro.conf.arg(help="video: pictures a second [1/s]")] = 6.0,
    pixel_size: Annotated[
        float | None, tyro.conf.arg(help="dic: side of a pixel [m]; default: the experiment's")
    ] = None,
    frame: Annotated[int | None, tyro.conf.arg(help="figures: of this frame; default: the last settled one")] = None,
    formats: Annotated[tuple[Literal["pdf", "svg", "png"], ...], tyro.conf.arg(help="figures: kinds of files")] = (
        "pdf",
        "svg",
    ),
    width: Annotated[Literal["single", "double"], tyro.conf.arg(help="figures: columns of a page")] = "single",
    quiet: Quiet = False,
) -> int:
    """Write pictures, a video, figures for a paper, tables, files for ParaView, OVITO and networkx, tracker files.

    Tables come with columns.csv, the dictionary of their columns, and datapackage.json for a data repository. ParaView
    opens vtk/packing.pvd, OVITO ovito/frame_0000.vtm, and finds the others.

    Example: rodsight export video runs/shear --view "Force network"
    """
    from ...exchange.contact_graph import write_graphs
    from ...exchange.dic_files import write_sequence
    from ...exchange.ovito_files import write_ovito
    from ...exchange.tidy_tables import write_tables
    from ...exchange.vtk_polydata import write_polydata
    from ...results.hdf5.store import load_results
    from ...run_folder import RECORDING, RESULTS

    console = Console(quiet=quiet)
    folder = source if source.is_dir() else source.parent
    if what in ("pictures", "video"):
        recording = folder / RECORDING if source.suffix != ".rrd" else source
        if not recording.is_file():
            raise InputError(recording, "", "there is no such recording")
        drawing = Drawing(recording, timeline, frames, step, tab, view, size, rate)
        with progress_of(quiet) as progress:
            told = _draw(drawing, out, progress, film=what == "video")
        tell(console, told)
        return 0
    if what == "figures":
        told = _write_figures(folder / RESULTS if source.is_dir() else source, out, formats, frame, width)
        tell(console, told)
        return 0
    results = load_results(folder / RESULTS if source.is_dir() else source)
    target = out if out is not None else folder / what
    if what == "tables":
        files = write_tables(results, target, kind)
    elif what == "vtk":
        files = write_polydata(results, target)
    elif what == "ovito":
        files = write_ovito(results, target)
    elif what == "graph":
        files = write_graphs(results, target)
    else:
        files = write_sequence(results.tracks, _scale_of(results, pixel_size), target)
    shown = ", ".join(file.name for file in files[:3]) + (f" … {files[-1].name}" if len(files) > 3 else "")
    tell(console, f"{target}/: {shown}.")
    return 0


def share(
    source: Annotated[
        Path | None,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="RECORDING_OR_DIR", help="a recording, a run's folder, or with --html a folder of runs"),
    ] = None,
    /,
    frames: Frames = None,
    scale: Annotated[float, tyro.conf.arg(help="of photographs, 0.5: half as wide and high")] = 1.0,
    html: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="one page with the viewer in it")] = False,
    repair: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help="mend a damaged recording instead")] = None,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="what to write; default: beside the recording")
    ] = None,
) -> int:
    """Make a small recording to send, or one HTML file that any browser opens.

    Example: rodsight share runs/shear --frames 0:12 --scale 0.5 --html
    """
    from ...run_folder import RECORDING

    console = Console(soft_wrap=True)
    if (source is None) == (repair is None):
        raise InputError("share", "", "give either a run's folder or recording, or --repair FILE")
    if repair is not None:
        return _repair(repair, out, console)
    assert source is not None
    recording = source / RECORDING if source.is_dir() else source
    if source.is_dir() and not recording.is_file() and html:
        return _share_several(source, parse_frames(frames), scale, out, console)
    if not recording.is_file():
        raise InputError(recording, "", "there is no such recording")
    return _share(recording, parse_frames(frames), scale, html, out, console)


def _draw(drawing: Drawing, out: Path | None, progress: Progress, *, film: bool) -> str:
    """Write the film, or the pictures; returns what to tell."""
    from ...recording.viewing.headless import NoPictureError
    from ...recording.viewing.pictures import Shown, timeline_values, write_film, write_pictures

    recording, step = drawing.recording, drawing.step
    if step < 1:
        raise InputError("--step", str(step), "is not a positive number")
    if not 0.0 < drawing.rate <= 120.0:
        raise InputError("--rate", str(drawing.rate), "is not between 0 and 120 pictures a second")
    try:
        first, last = timeline_values(recording, drawing.timeline)
        begin, end = parse_frames(drawing.times)
        if drawing.times is not None and not first <= begin <= (last if end is None else end - 1) <= last:
            raise InputError(
                "--frames", drawing.times, f"is not a range of {first}:{last + 1} on the timeline {drawing.timeline}"
            )
        chosen = range(max(begin, first), last + 1 if end is None else end, step)
        shown = Shown(drawing.timeline, drawing.tab, drawing.view, _window(drawing.size))

        def told(done: int, total: int) -> None:
            progress("drawing", done, total)

        if film:
            file = out if out is not None else recording.with_suffix(".mp4")
            written = write_film(recording, file, chosen, shown, rate=drawing.rate, progress=told)
            text = f"{file}: {len(chosen)} pictures, {1e-6 * written:.1f} MB."
        else:
            folder = out if out is not None else recording.parent / "pictures"
            files = write_pictures(recording, folder, chosen, shown, progress=told)
            text = f"{folder}/: {len(files)} pictures, {files[0].name} … {files[-1].name}."
    except NoPictureError as error:
        raise InputError("export", "", str(error)) from None
    return text


def _write_figures(
    file: Path,
    out: Path | None,
    formats: tuple[FileKind, ...],
    frame: int | None,
    width: Width,
) -> str:
    """Write the figures of a run, that against the truth where its experiment names one; returns what to tell."""
    from ...figures.gallery import write_figures
    from ...results.hdf5.store import load_results
    from ...run_truth import truth_of

    folder = file.parent / "figures" if out is None else out
    results, truth = load_results(file), truth_of(file)
    try:
        files = write_figures(results, folder, formats, frame=frame, width=width, truth=truth)
    except (IndexError, ValueError) as error:
        raise InputError("--frame", str(frame), str(error)) from None
    return f"{folder}/: {', '.join(each.name for each in files)}."


def _window(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 100 <= int(width) <= 8192 and 100 <= int(height) <= 8192):
        raise InputError("--size", text, "is not WIDTHxHEIGHT in pixels from 100 to 8192")
    return int(width), int(height)


def _scale_of(results: Results, pixel_size: float | None) -> Scale:
    """The scale of the photographs; their height, where it is not known, puts the packing just inside."""
    import tomllib

    from ...experiment.config.experiment_file import ExperimentFile
    from ...experiment.units import Scale

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


def _share(
    recording: Path, frames: tuple[int, int | None], scale: float, page: bool, out: Path | None, console: Console
) -> int:
    from ...recording.files.cards import make_card
    from ...recording.files.share import share_recording
    from ...recording.viewing.single_page import write_single_page
    from ...run_folder import RECORDING

    first, stop = frames
    name = recording.parent.name if recording.name == RECORDING else recording.stem
    target = out if out is not None and not page else recording.with_name(f"{name or 'run'}-share.rrd")
    if target.resolve() == recording.resolve():
        raise InputError(target, "", "is the recording itself: choose another --out")
    try:
        report = share_recording(recording, target, first=first, stop=stop, scale=scale)
    except ValueError as error:
        raise InputError(recording, "", str(error)) from None
    told = f"{target}: {_size(report.size)} of {_size(report.former_size)}, {report.frames} frames."
    tell(console, f"{told} To look at it: rodsight view {target}")
    if page:
        file = out if out is not None else target.with_suffix(".html")
        size = write_single_page([target], file, title=name or "Rodsight", cards=[make_card(target)])
        tell(
            console,
            f"{file}: {_size(size)}, viewer included; any browser opens it, also without network or server.",
        )
    return 0


def _share_several(
    folder: Path, frames: tuple[int, int | None], scale: float, out: Path | None, console: Console
) -> int:
    """Write one page of all runs in a folder: a card for each, and one viewer for all."""
    from tempfile import TemporaryDirectory

    from ...recording.files.cards import make_card
    from ...recording.files.catalogue import RECORDING, find_recordings, read_entries
    from ...recording.files.share import share_recording
    from ...recording.viewing.single_page import write_single_page

    recordings = [entry.file for entry in read_entries(find_recordings(folder)) if entry.properties is not None]
    if not recordings:
        raise InputError(folder, "", "holds no recording that can be read: neither recording.rrd nor runs with one")
    name = folder.resolve().name
    file = out if out is not None else folder / f"{name}-share.html"
    with TemporaryDirectory(prefix="rodsight-") as place:
        parts = [Path(place) / f"{k}.rrd" for k in range(len(recordings))]
        for recording, part in zip(recordings, parts, strict=True):
            try:
                share_recording(recording, part, first=frames[0], stop=frames[1], scale=scale)
            except ValueError as error:
                raise InputError(recording, "", str(error)) from None
        cards = [
            make_card(part, recording.parent.name if recording.name == RECORDING else recording.stem)
            for recording, part in zip(recordings, parts, strict=True)
        ]
        size = write_single_page(parts, file, title=name, cards=cards)
    tell(console, f"{file}: {_size(size)}, {len(parts)} runs and one viewer; any browser opens it.")
    return 0


def _repair(damaged: Path, out: Path | None, console: Console) -> int:
    from ...recording.files.repair import repair_recording

    if not damaged.is_file():
        raise InputError(damaged, "", "there is no such recording")
    stem = damaged.name.removesuffix(".part").removesuffix(".rrd")
    target = out if out is not None else damaged.with_name(f"{stem}-repaired.rrd")
    try:
        report = repair_recording(damaged, target)
    except OSError as error:
        raise InputError(damaged, "", str(error)) from None
    tell(
        console,
        f"{target}: the forces of {report.frames} frames saved, {_size(report.size)} of {_size(report.former_size)}. "
        f"To look at it: rodsight view {target}",
    )
    return 0


def _size(size: int) -> str:
    return f"{1e-6 * size:.1f} MB"
