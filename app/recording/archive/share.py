"""Writes a small recording to send: selected frames, smaller photographs, the same tabs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from ...process.atomic import replacing
from ..files.writing import writing
from ..look import entities
from ..parts import parts_of, read_chunks
from ..tabs.blueprint import make_blueprint
from ..tabs.layout_property import PROPERTY, read_layout, send_layout
from ..viewing.viewer import run_tool

JPEG_QUALITY = 70  # of photographs made smaller


@dataclass(frozen=True, slots=True)
class SharedRecording:
    """The recording as it was written."""

    path: Path
    size: int  # [bytes]
    former_size: int  # [bytes] of the source recording
    frames: int


def share_recording(
    source: Path | str, target: Path | str, *, first: int = 0, stop: int | None = None, scale: float = 1.0
) -> SharedRecording:
    """Write some frames of a recording to a new file.

    Frames and sweeps keep their numbers.

    Parameters
    ----------
    source, target : Path or str
        The recording and the new file.
    first, stop : int
        The frames first … stop − 1; stop None: up to the last.
    scale : float
        Factor in (0, 1] by which photographs are made smaller.

    Returns
    -------
    SharedRecording
        Size and number of frames.

    Raises
    ------
    ValueError
        If the scale or the frames are out of range.
    OSError
        If the viewer's tool could not compress the file.
    """
    source, target = Path(source), Path(target)
    if not 0.0 < scale <= 1.0:
        raise ValueError(f"the scale of the photographs must be in (0, 1], not {scale:g}")
    layout = read_layout(source)
    stop = layout.frame_count if stop is None else stop
    if not 0 <= first < stop <= layout.frame_count:
        raise ValueError(f"{first}:{stop} is not a range of the frames 0:{layout.frame_count}")
    entry = RrdReader(str(source)).recordings()[0]
    size = sum(each.stat().st_size for each in parts_of(source))
    chunks = list(read_chunks(source))
    sweeps = _sweeps_of(chunks, first, stop)
    layout = replace(layout, frame_count=stop - first)
    with replacing(target) as part:
        loose = part.with_name(part.name + ".loose.rrd")
        stream = rr.RecordingStream(
            entities.APPLICATION_ID, recording_id=f"{entry.recording_id}-{first}-{stop}", send_properties=False
        )
        try:
            with writing(stream, loose, make_blueprint(layout)):
                stream.set_log_time_enabled(False)
                rr.send_chunks(_chosen(chunks, first, stop, sweeps, scale), recording=stream)
                send_layout(stream, layout)
            run_tool("optimize", loose, "-o", part)
        finally:
            loose.unlink(missing_ok=True)
    return SharedRecording(target, target.stat().st_size, size, stop - first)


def _sweeps_of(chunks: list[Chunk], first: int, stop: int) -> tuple[int, int]:
    """Return the first value of `sweep` of the frames first … stop − 1, and the first value after them."""
    frames, sweeps = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    for chunk in chunks:
        if {entities.FRAME, entities.SWEEP} <= set(chunk.timeline_names):
            batch = chunk.to_record_batch()
            frames.append(_integers(batch, entities.FRAME))
            sweeps.append(_integers(batch, entities.SWEEP))
    frame, sweep = np.concatenate(frames), np.concatenate(sweeps)
    inside = (frame >= first) & (frame < stop)
    if not inside.any():
        raise ValueError(f"the recording holds no row of the frames {first}:{stop}")
    return int(sweep[inside].min()), int(sweep[inside].max()) + 1


def _chosen(chunks: list[Chunk], first: int, stop: int, sweeps: tuple[int, int], scale: float) -> Iterator[Chunk]:
    for chunk in chunks:
        if chunk.entity_path == f"/__properties/{PROPERTY}":
            continue  # the number of frames differs
        if _is_picture_outside(chunk.entity_path, first, stop):
            continue
        timelines = set(chunk.timeline_names)
        if not timelines & {entities.FRAME, entities.SWEEP}:
            yield chunk
            continue
        batch = chunk.to_record_batch()
        line, (low, high) = (entities.FRAME, (first, stop)) if entities.FRAME in timelines else (entities.SWEEP, sweeps)
        at = _integers(batch, line)
        kept = (at >= low) & (at < high)
        if not kept.any():
            continue
        if not kept.all():
            batch = batch.filter(pa.array(kept))
            chunk = Chunk.from_record_batch(batch)[0]
        if chunk.entity_path == entities.PHOTOGRAPH and scale < 1.0:
            yield from _smaller_photographs(batch, scale)
        else:
            yield chunk


def _is_picture_outside(path: str, first: int, stop: int) -> bool:
    """Return whether an entity is the static picture of a frame that is not shared."""
    head, _, frame = path.rpartition("/")
    return head == entities.FILM_FRAMES and not first <= int(frame) < stop


def _smaller_photographs(batch: pa.RecordBatch, scale: float) -> Iterator[Chunk]:
    """Yield the photographs of a chunk at smaller size, with a transform that stretches them to their former area."""
    column = next(name for name in batch.schema.names if name.endswith("EncodedImage:blob"))
    blobs = batch.column(column)
    for row in range(batch.num_rows):
        if not blobs[row].is_valid:
            continue
        coded = blobs[row].values[0].values.to_numpy().astype(np.uint8)
        picture = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise ValueError(f"the photograph of frame {_integers(batch, entities.FRAME)[row]} cannot be decoded")
        height, width = picture.shape
        shape = max(round(width * scale), 1), max(round(height * scale), 1)
        small = cv2.resize(picture, shape, interpolation=cv2.INTER_AREA)
        done, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not done:
            raise ValueError(f"a photograph of {shape[0]} × {shape[1]} pixels could not be encoded")
        kept = batch.slice(row, 1).drop_columns([column])
        yield Chunk.from_record_batch(kept)[0]
        stretch = [width / shape[0], height / shape[1], 1.0]
        yield Chunk.from_columns(
            entities.PHOTOGRAPH,
            _time_columns(batch.slice(row, 1)),
            [*rr.EncodedImage.columns(blob=[data.tobytes()]), *rr.Transform3D.columns(scale=[stretch])],
        )


def _time_columns(batch: pa.RecordBatch) -> list[rr.TimeColumn]:
    columns = [
        rr.TimeColumn(name, sequence=_integers(batch, name))
        for name in (entities.FRAME, entities.SWEEP, entities.STRAIN)
        if name in batch.schema.names
    ]
    if entities.TIME in batch.schema.names:
        columns.append(rr.TimeColumn(entities.TIME, duration=_integers(batch, entities.TIME).astype("timedelta64[ns]")))
    return columns


def _integers(batch: pa.RecordBatch, name: str) -> np.ndarray:
    return batch.column(name).cast(pa.int64()).to_numpy(zero_copy_only=False)
