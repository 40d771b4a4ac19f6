"""What `rodsight share` does: a small recording, a page that needs nothing else, a damaged file mended."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from ..errors import InputError
from .frame_range import parse_frames

RECORDING = "recording.rrd"


def share(
    source: Path | None,
    *,
    frames: str | None,
    scale: float,
    page: bool,
    damaged: Path | None,
    out: Path | None,
    console: Console,
) -> int:
    """Make what was asked for and tell its size. Exit status 0."""
    if (source is None) == (damaged is None):
        raise InputError("share", "", "give either a run's folder or recording, or --repair FILE")
    if damaged is not None:
        return _repair(damaged, out, console)
    assert source is not None
    recording = source / RECORDING if source.is_dir() else source
    if not recording.is_file():
        raise InputError(recording, "", "there is no such recording")
    return _share(recording, frames, scale, page, out, console)


def _share(recording: Path, frames: str | None, scale: float, page: bool, out: Path | None, console: Console) -> int:
    from ..recording.files.share import share_recording
    from ..recording.viewing.single_page import write_single_page

    first, stop = parse_frames(frames)
    name = recording.parent.name if recording.name == RECORDING else recording.stem
    target = out if out is not None and not page else recording.with_name(f"{name or 'run'}-share.rrd")
    if target.resolve() == recording.resolve():
        raise InputError(target, "", "is the recording itself: choose another --out")
    try:
        report = share_recording(recording, target, first=first, stop=stop, scale=scale)
    except ValueError as error:
        raise InputError(recording, "", str(error)) from None
    told = f"{target}: {_size(report.size)} of {_size(report.former_size)}, {report.frames} frames."
    console.print(f"{told} To look at it: rodsight view {target}", markup=False, highlight=False, soft_wrap=True)
    if page:
        file = out if out is not None else target.with_suffix(".html")
        size = write_single_page(target, file, title=name or "Rodsight")
        console.print(
            f"{file}: {_size(size)}, viewer included; any browser opens it, also without network or server.",
            markup=False, highlight=False, soft_wrap=True,
        )  # fmt: skip
    return 0


def _repair(damaged: Path, out: Path | None, console: Console) -> int:
    from ..recording.files.repair import repair_recording

    if not damaged.is_file():
        raise InputError(damaged, "", "there is no such recording")
    stem = damaged.name.removesuffix(".part").removesuffix(".rrd")
    target = out if out is not None else damaged.with_name(f"{stem}-repaired.rrd")
    try:
        report = repair_recording(damaged, target)
    except OSError as error:
        raise InputError(damaged, "", str(error)) from None
    console.print(
        f"{target}: the forces of {report.frames} frames saved, {_size(report.size)} of {_size(report.former_size)}. "
        f"To look at it: rodsight view {target}",
        markup=False, highlight=False, soft_wrap=True,
    )  # fmt: skip
    return 0


def _size(size: int) -> str:
    return f"{1e-6 * size:.1f} MB"
