"""Pictures and films of a recording without a screen, by the viewer itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ...atomic import replacing, write_atomically
from ..parts import chunks_of
from .headless import HeadlessViewer, NoPictureError

PictureProgress = Callable[[int, int], None]  # pictures done, pictures in all


@dataclass(frozen=True, slots=True)
class Shown:
    """What a picture is of."""

    timeline: str = "frame"
    tab: str | None = None  # None: the one in front
    view: str | None = None  # of that tab; None: all of them
    size: tuple[int, int] = (1600, 1000)  # [px]


FRAMES_IN_FRONT = Shown()


def write_pictures(
    recording: Path,
    folder: Path,
    times: Sequence[int],
    shown: Shown = FRAMES_IN_FRONT,
    *,
    progress: PictureProgress | None = None,
) -> list[Path]:
    """Write a PNG for every one of the times on the timeline shown.

    Raises FileNotFoundError where there is no recording, NoPictureError where it cannot be drawn.
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
    shown: Shown = FRAMES_IN_FRONT,
    *,
    rate: float = 6.0,
    progress: PictureProgress | None = None,
) -> int:
    """Write an MP4 (MPEG-4 part 2) with a picture for every one of the times, `rate` a second; returns its size.

    Raises like write_pictures.
    """
    if not times:
        raise NoPictureError("a film needs at least one picture")
    with replacing(file) as part:
        # The container is known by the name's end, which must be that of a film.
        loose = part.with_name(f"{file.stem}.part.mp4")
        writer: cv2.VideoWriter | None = None
        try:
            for _, picture in _pictures(recording, times, shown, progress):
                image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
                assert image is not None
                height, width = (side - side % 2 for side in image.shape[:2])  # films have even sides
                if writer is None:
                    code = cv2.VideoWriter.fourcc(*"mp4v")
                    writer = cv2.VideoWriter(str(loose), code, rate, (width, height))
                    if not writer.isOpened():
                        raise NoPictureError(f"{file}: this OpenCV cannot write an MP4 of {width} × {height} pixels")
                writer.write(image[:height, :width])
            if writer is not None:
                writer.release()
            loose.replace(part)
        finally:
            loose.unlink(missing_ok=True)
    return file.stat().st_size


def timeline_values(recording: Path, timeline: str) -> tuple[int, int]:
    """First and last value of a timeline, read from the file."""
    least, most = [], []
    for chunk in chunks_of(recording, timeline=timeline):
        values = np.asarray(chunk.to_record_batch().column(timeline).to_pylist())
        least.append(int(values.min()))
        most.append(int(values.max()))
    if not least:
        raise NoPictureError(f"{recording} has no timeline {timeline!r}")
    return min(least), max(most)


def _pictures(
    recording: Path,
    times: Sequence[int],
    shown: Shown,
    progress: PictureProgress | None,
) -> Iterator[tuple[int, bytes]]:
    with HeadlessViewer(recording, width=shown.size[0], height=shown.size[1]) as viewer:
        if shown.tab is not None:
            viewer.show_tab(shown.tab)
        for done, value in enumerate(times, 1):
            viewer.set_time(shown.timeline, value)
            yield value, viewer.picture(shown.view)
            if progress is not None:
                progress(done, len(times))
