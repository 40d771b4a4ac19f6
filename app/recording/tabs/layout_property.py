"""Stores the layout of a recording as a property, so that its blueprint can be made again from the file."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ...experiment.units import Scale
from ..look.canvas import Canvas
from .blueprint import RecordingLayout

PROPERTY = "tabs"


def send_layout(stream: rr.RecordingStream, layout: RecordingLayout) -> None:
    """Store the layout in the recording; of the scale only pixel size and height, which define the bounds of a view."""
    canvas = layout.canvas
    straight = Scale(canvas.scale.pixel_size, canvas.scale.height)
    stored = asdict(replace(layout, canvas=replace(canvas, scale=straight)))
    stream.send_property(PROPERTY, rr.AnyValues(json=json.dumps(stored)))


def read_layout(path: Path | str) -> RecordingLayout:
    """Read the layout of a recording; raise ValueError if it has none."""
    for chunk in RrdReader(str(path)).store().stream().filter(content=f"/__properties/{PROPERTY}").to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            if row.get("json"):
                stored = json.loads(row["json"][0])
                canvas = stored.pop("canvas")
                try:
                    return RecordingLayout(Canvas(Scale(**canvas.pop("scale")), **canvas), **stored)
                except TypeError:  # its fields are those of another version
                    break
    raise ValueError(f"{path} has no layout of this version: run `rodsight record` again")
