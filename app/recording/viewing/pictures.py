"""Pictures and films of a recording, drawn by the viewer without a screen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...process.atomic import write_atomically
from ..parts import read_chunks
from .film_file import encode_film
from .headless import HeadlessViewer, NoPictureError

DEFAULT_TAB = "Forces"
PictureProgress = Callable[[int, int], None]  # pictures done, pictures in all


@dataclass(frozen=True, slots=True)
class PictureSettings:
    """Timeline, tab, view and size of the pictures."""

    timeline: str = "frame"
    tab: str | None = None  # None: the forces, or the one in front of a recording without that tab
    view: str | None = None  # of that tab; None: all views
    size: tuple[int, int] = (1600, 1000)  # [px]


DEFAULT_PICTURE = PictureSettings()


def write_pictures(
    recording: Path,
    folder: Path,
    times: Sequence[int],
    shown: PictureSettings = DEFAULT_PICTURE,
    *,
    progress: PictureProgress | None = None,
) -> list[Path]:
    """Write a PNG for each time of a timeline.

    Parameters
    ----------
    recording : Path
        The recording.
    folder : Path
        Folder of the pictures; it is created.
    times : sequence of int
        Values on the timeline of `shown`.
    shown : PictureSettings
        Timeline, tab, view and size.
    progress : callable, optional
        Called with the pictures done and their total number.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    FileNotFoundError
        If there is no recording.
    NoPictureError
        If it cannot be drawn.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for value, picture in _pictures(recording, times, shown, progress):
        files.append(folder / f"{shown.timeline}_{value:06d}.png")
        write_atomically(files[-1], picture)
    return files


def write_film(
    recording: Path,
    file: Path,
    times: Sequence[int],
    shown: PictureSettings = DEFAULT_PICTURE,
    *,
    rate: float = 6.0,
    progress: PictureProgress | None = None,
) -> int:
    """Write a film with a picture for each time of a timeline; the suffix of its file selects the format.

    Parameters
    ----------
    recording : Path
        The recording.
    file : Path
        The film, .mp4 or .webm.
    times : sequence of int
        Values on the timeline of `shown`.
    shown : PictureSettings
        Timeline, tab, view and size.
    rate : float
        Pictures per second.
    progress : callable, optional
        Called with the pictures done and their total number.

    Returns
    -------
    int
        Size of the film [bytes].

    Raises
    ------
    FileNotFoundError
        If there is no recording.
    NoPictureError
        If there is no time, or a picture or the film cannot be made.
    """
    if not times:
        raise NoPictureError("a film needs at least one picture")
    return encode_film(file, (picture for _, picture in _pictures(recording, times, shown, progress)), rate)


def timeline_values(recording: Path, timeline: str) -> tuple[int, int]:
    """Return the first and last value of a timeline, read from the file; raise NoPictureError if there is none."""
    first, last = [], []
    for chunk in read_chunks(recording, timeline=timeline):
        values = np.asarray(chunk.to_record_batch().column(timeline).to_pylist())
        first.append(int(values.min()))
        last.append(int(values.max()))
    if not first:
        raise NoPictureError(f"{recording} has no timeline {timeline!r}")
    return min(first), max(last)


def _pictures(
    recording: Path,
    times: Sequence[int],
    shown: PictureSettings,
    progress: PictureProgress | None,
) -> Iterator[tuple[int, bytes]]:
    with HeadlessViewer(recording, width=shown.size[0], height=shown.size[1], plain=True) as viewer:
        tab = DEFAULT_TAB if shown.tab is None and DEFAULT_TAB in viewer.tabs else shown.tab
        if tab is not None:
            viewer.show_tab(tab)
        for done, value in enumerate(times, 1):
            viewer.set_time(shown.timeline, value)
            yield value, viewer.picture(shown.view)
            if progress is not None:
                progress(done, len(times))
