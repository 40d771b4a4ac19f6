"""What `rodsight export` does: results and recordings in forms that other tools and people read."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from rich.console import Console

from ..errors import InputError
from ..exchange.dic_files import write_sequence
from ..exchange.tidy_tables import write_tables
from ..exchange.vtk_polydata import write_polydata
from ..experiment.config import ExperimentFile
from ..experiment.units import Scale
from ..pipeline import RECORDING, RESULTS
from ..progress import Progress
from ..results.results import Results
from ..results.store import load_results
from .frame_range import parse_frames

What = Literal["pictures", "video", "tables", "vtk", "dic"]


def export(
    what: What,
    source: Path,
    out: Path | None,
    *,
    console: Console,
    progress: Progress,
    kind: Literal["csv", "parquet"] = "csv",
    timeline: Literal["frame", "sweep"] = "frame",
    times: str | None = None,
    step: int = 1,
    tab: str | None = None,
    view: str | None = None,
    size: str = "1600x1000",
    rate: float = 6.0,
    pixel_size: float | None = None,
) -> int:
    """Write what was asked for beside the results, or to `out`. Exit status 0."""
    folder = source if source.is_dir() else source.parent
    if what in ("pictures", "video"):
        recording = folder / RECORDING if source.suffix != ".rrd" else source
        if not recording.is_file():
            raise InputError(recording, "", "there is no such recording")
        return _draw(what == "video", recording, out, timeline, times, step, tab, view, size, rate, console, progress)
    results = load_results(folder / RESULTS if source.is_dir() else source)
    target = out if out is not None else folder / what
    if what == "tables":
        files = write_tables(results, target, kind)
    elif what == "vtk":
        files = write_polydata(results, target)
    else:
        files = write_sequence(results.tracks, _scale_of(results, pixel_size), target)
    shown = ", ".join(file.name for file in files[:3]) + (f" … {files[-1].name}" if len(files) > 3 else "")
    console.print(f"{target}/: {shown}.", markup=False, highlight=False, soft_wrap=True)
    return 0


def _draw(
    film: bool,
    recording: Path,
    out: Path | None,
    timeline: str,
    times: str | None,
    step: int,
    tab: str | None,
    view: str | None,
    size: str,
    rate: float,
    console: Console,
    progress: Progress,
) -> int:
    from ..recording.viewing.headless import NoPictureError
    from ..recording.viewing.pictures import Shown, timeline_values, write_film, write_pictures

    if step < 1:
        raise InputError("--step", str(step), "is not a positive number")
    if not 0.0 < rate <= 120.0:
        raise InputError("--rate", str(rate), "is not between 0 and 120 pictures a second")
    try:
        first, last = timeline_values(recording, timeline)
        begin, end = parse_frames(times)
        if times is not None and not first <= begin <= (last if end is None else end - 1) <= last:
            raise InputError("--frames", times, f"is not a range of {first}:{last + 1} on the timeline {timeline}")
        chosen = range(max(begin, first), last + 1 if end is None else end, step)
        shown = Shown(timeline, tab, view, _size(size))

        def told(done: int, total: int) -> None:
            progress("drawing", done, total)

        if film:
            file = out if out is not None else recording.with_suffix(".mp4")
            written = write_film(recording, file, chosen, shown, rate=rate, progress=told)
            text = f"{file}: {len(chosen)} pictures, {1e-6 * written:.1f} MB."
        else:
            folder = out if out is not None else recording.parent / "pictures"
            files = write_pictures(recording, folder, chosen, shown, progress=told)
            text = f"{folder}/: {len(files)} pictures, {files[0].name} … {files[-1].name}."
    except NoPictureError as error:
        raise InputError("export", "", str(error)) from None
    console.print(text, markup=False, highlight=False, soft_wrap=True)
    return 0


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and 100 <= int(width) <= 8192 and 100 <= int(height) <= 8192):
        raise InputError("--size", text, "is not WIDTHxHEIGHT in pixels from 100 to 8192")
    return int(width), int(height)


def _scale_of(results: Results, pixel_size: float | None) -> Scale:
    """The scale of the photographs; their height, where it is not known, puts the packing just inside."""
    import tomllib

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
