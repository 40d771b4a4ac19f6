"""Commands that write results for others: `export` to other formats, `share` for a small recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from rich.console import Console
from tyro.conf import Positional, arg

from ...exported_files import ExportKind, TableForm, Timeline, check_options
from ...process.counts import state_count
from ...process.errors import InputError
from ..arguments import Flag, Frames, Quiet, parse_frames, refuse_step, refuse_unused
from ..stored_results import recording_file, results_file, warn_out_of_date
from ..terminal import print_line, progress_of


def export(
    what: Annotated[ExportKind, Positional, arg(help="to write")],
    source: Annotated[Path, Positional, arg(metavar="RESULTS", help="a run's folder or file")],
    /,
    out: Annotated[
        Path | None, arg(metavar="PATH", help="folder, or file of a video; default: beside the results")
    ] = None,
    kind: Annotated[TableForm | None, arg(help="tables: format; default csv")] = None,
    frames: Annotated[str | None, arg(metavar="A:B", help="pictures, video: of the timeline")] = None,
    timeline: Annotated[Timeline | None, arg(help="pictures, video: from picture to picture; default frame")] = None,
    step: Annotated[int | None, arg(help="pictures, video: every so many values; default 1")] = None,
    tab: Annotated[str | None, arg(help="pictures, video: the tab to show; default Forces")] = None,
    view: Annotated[str | None, arg(help="pictures, video: one view alone, by its title")] = None,
    figure: Annotated[
        Literal["forces", "density", "rose", "stress", "time", "sheet", "kinematics", "fringes", "truth", "difference"]
        | None,
        arg(help="pictures, video: this figure of every frame, instead of the viewer"),
    ] = None,
    size: Annotated[
        str | None, arg(metavar="WxH", help="pictures, video: of the window [px]; default 1600x1000")
    ] = None,
    rate: Annotated[float | None, arg(help="video: pictures a second [1/s]; default 6")] = None,
    pixel_size: Annotated[float | None, arg(help="dic: side of a pixel [m]; default: the experiment's")] = None,
    frame: Annotated[int | None, arg(help="figures: of this frame; default: the last settled one")] = None,
    formats: Annotated[
        tuple[Literal["pdf", "svg", "png"], ...], arg(help="figures: kinds of files; default pdf svg")
    ] = (),
    width: Annotated[
        Literal["single", "double"] | None,
        arg(help="figures: columns of a page; default single, of the set paper double"),
    ] = None,
    figure_set: Annotated[
        Literal["results", "paper"] | None,
        arg(
            name="set",
            help="figures: of the results, or those of the paper: apparatus, frames from zero forces, consecutive "
            "networks, P(f) and stress against recorded ones; default results",
        ),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Write pictures, a video, figures for a paper, tables, files for ParaView, OVITO and networkx, tracker files.

    Tables come with columns.csv, the dictionary of their columns, and datapackage.json for a data repository. ParaView
    opens vtk/packing.pvd, OVITO ovito/frame_0000.vtm; they find the other files. An option that does not apply to the
    chosen kind is refused.

    The figures of the paper: rodsight export figures runs/shear --set paper

    Example: rodsight export video runs/shear --figure forces
    """
    given = {
        "--kind": kind, "--frames": frames, "--timeline": timeline, "--step": step, "--tab": tab, "--view": view,
        "--size": size, "--rate": rate, "--pixel-size": pixel_size, "--frame": frame, "--formats": formats or None,
        "--width": width, "--figure": figure, "--set": figure_set,
    }  # fmt: skip
    from ...exported_files import Drawing, draw_figure_frames, draw_pictures, write_data, write_run_figures
    from ...results.hdf5.store import load_results

    check_options(what, given)
    if figure is not None:
        refuse_unused("export", {"--timeline": timeline, "--tab": tab, "--view": view}, "with --figure")
    console = Console(quiet=quiet)
    warn_out_of_date(source)
    folder = source if source.is_dir() else source.parent
    if what in ("pictures", "video"):
        recording = source if source.suffix == ".rrd" else recording_file(folder)
        if figure is None and not recording.is_file():
            raise InputError(recording, "", "there is no such recording")
        times = None if frames is None else refuse_step(parse_frames(frames))
        drawing = Drawing(
            recording, timeline or "frame", times, 1 if step is None else step, tab, view,
            _window(size or "1600x1000"), 6.0 if rate is None else rate,
        )  # fmt: skip
        with progress_of(quiet) as progress:
            if figure is None:
                files = draw_pictures(drawing, out, progress, film=what == "video")
            else:
                files = draw_figure_frames(results_file(folder), out, figure, drawing, progress, film=what == "video")
        if what == "video":
            message = f"{files[0]}: {1e-6 * files[0].stat().st_size:.1f} MB."
        else:
            names = files[0].name if len(files) == 1 else f"{len(files)} pictures, {files[0].name} … {files[-1].name}"
            message = f"{files[0].parent}/: {names}."
    elif what == "figures":
        file = results_file(source)
        files = write_run_figures(file, out, formats or ("pdf", "svg"), frame, width, figure_set or "results")
        message = f"{files[0].parent}/: {', '.join(each.name for each in files)}."
    else:
        target = folder / what if out is None else out
        files = write_data(what, load_results(results_file(source)), target, form=kind or "csv", pixel_size=pixel_size)
        message = _name_files(target, files)
    print_line(console, message)
    return 0


def share(
    source: Annotated[
        Path | None,
        Positional,
        arg(metavar="RECORDING_OR_DIR", help="a recording, a run's folder, or with --html a folder of runs"),
    ] = None,
    /,
    frames: Frames = None,
    scale: Annotated[float, arg(help="of photographs, 0.5: half as wide and high")] = 1.0,
    html: Annotated[Flag, arg(help="one page with the viewer in it")] = False,
    although_out_of_date: Annotated[
        Flag, arg(help="share a run although its input has changed since it was computed")
    ] = False,
    repair: Annotated[Path | None, arg(metavar="FILE", help="repair a damaged recording instead")] = None,
    out: Annotated[Path | None, arg(metavar="FILE", help="file to write; default: beside the recording")] = None,
) -> int:
    """Make a small recording to send, or one HTML file that any browser opens.

    Example: rodsight share runs/shear --frames 0:12 --scale 0.5 --html
    """
    console = Console(soft_wrap=True)
    if (source is None) == (repair is None):
        raise InputError("share", "", "give either a run's folder or recording, or --repair FILE")
    if repair is not None:
        given = {"--frames": frames, "--scale": scale != 1.0, "--html": html}
        refuse_unused("share", given | {"--although-out-of-date": although_out_of_date}, "with --repair")
        return _repair(repair, out, console)
    assert source is not None
    recording = recording_file(source)
    if source.is_dir() and not recording.is_file() and html:
        return _share_several(
            source, refuse_step(parse_frames(frames)), scale, out, console, although=although_out_of_date
        )
    if not recording.is_file():
        raise InputError(recording, "", "there is no such recording")
    if not although_out_of_date:
        refuse_out_of_date(recording)
    return _share(recording, refuse_step(parse_frames(frames)), scale, html, out, console)


def refuse_out_of_date(recording: Path) -> None:
    """Raise InputError where the input of a recording's run has changed since it was computed."""
    from ...out_of_date import state_of_source

    reasons = state_of_source(recording)
    if reasons:
        raise InputError(
            recording, "", f"is out of date: {'; '.join(reasons)}; run the experiment again, or --although-out-of-date"
        )


def _name_files(target: Path, files: list[Path]) -> str:
    names = ", ".join(file.name for file in files[:3]) + (f" … {files[-1].name}" if len(files) > 3 else "")
    return f"{target}/: {names}."


def _window(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InputError("--size", text, "is not WIDTHxHEIGHT in pixels, such as 1600x1000")
    return int(width), int(height)


def _share(
    recording: Path, frames: tuple[int, int | None], scale: float, page: bool, out: Path | None, console: Console
) -> int:
    from tempfile import TemporaryDirectory

    from ...recording.archive.cards import make_card
    from ...recording.archive.share import share_recording
    from ...recording.viewing.single_page import write_single_page
    from ...run_folder import RECORDING

    first, stop = frames
    name = recording.parent.name if recording.name == RECORDING else recording.stem
    suffix = ".html" if page else ".rrd"
    file = out if out is not None else recording.with_name(f"{name or 'run'}-share{suffix}")
    if file.resolve() == recording.resolve():
        raise InputError(file, "", "is the recording itself: choose another --out")
    with TemporaryDirectory(prefix="rodsight-") as place:
        part = Path(place) / "part.rrd" if page else file
        try:
            report = share_recording(recording, part, first=first, stop=stop, scale=scale)
        except ValueError as error:
            raise InputError(recording, "", str(error)) from None
        extent = f"{_size(report.size)} of {_size(report.former_size)}, {state_count(report.frames, 'frame')}"
        if not page:
            print_line(console, f"{file}: {extent}. To view it: rodsight view {file}")
            return 0
        size = write_single_page([part], file, title=name or "Rodsight", cards=[make_card(part)])
    print_line(
        console,
        f"{file}: {_size(size)} with the viewer, the recording {extent}; any browser opens it, without network.",
    )
    return 0


def _share_several(
    folder: Path, frames: tuple[int, int | None], scale: float, out: Path | None, console: Console, *, although: bool
) -> int:
    """Write one page of all runs in a folder: a card for each, and one viewer for all."""
    from tempfile import TemporaryDirectory

    from ...recording.archive.cards import make_card
    from ...recording.archive.catalogue import RECORDING, find_recordings, read_catalogue
    from ...recording.archive.share import share_recording
    from ...recording.viewing.single_page import write_single_page

    recordings = [entry.file for entry in read_catalogue(find_recordings(folder)) if entry.properties is not None]
    if not recordings:
        raise InputError(folder, "", "holds no readable recording: neither recording.rrd nor runs with one")
    for recording in () if although else recordings:
        refuse_out_of_date(recording)
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
    print_line(
        console, f"{file}: {_size(size)}, {state_count(len(parts), 'run')} and one viewer; any browser opens it."
    )
    return 0


def _repair(damaged: Path, out: Path | None, console: Console) -> int:
    from ...recording.archive.repair import repair_recording

    if not damaged.is_file():
        raise InputError(damaged, "", "there is no such recording")
    stem = damaged.name.removesuffix(".part").removesuffix(".rrd")
    target = out if out is not None else damaged.with_name(f"{stem}-repaired.rrd")
    try:
        report = repair_recording(damaged, target)
    except OSError as error:
        raise InputError(damaged, "", str(error)) from None
    print_line(
        console,
        f"{target}: the forces of {state_count(report.frames, 'frame')} saved, {_size(report.size)} of "
        f"{_size(report.former_size)}. To view it: rodsight view {target}",
    )
    return 0


def _size(size: int) -> str:
    return f"{1e-6 * size:.1f} MB"
