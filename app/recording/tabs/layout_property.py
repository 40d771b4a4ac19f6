"""The layout of a recording as one of its properties, so that its blueprint can be made again from the file alone."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path

import rerun as rr
from rerun.chunk import RrdReader

from ...experiment.units import Scale
from ..look.canvas import Canvas
from .blueprint import Layout

PROPERTY = "tabs"


def send_layout(stream: rr.RecordingStream, layout: Layout) -> None:
    """Store the layout in the recording; of the scale only what frames a view, its lens stays behind."""
    canvas = layout.canvas
    straight = Scale(canvas.scale.pixel_size, canvas.scale.height)
    stored = asdict(replace(layout, canvas=replace(canvas, scale=straight)))
    stream.send_property(PROPERTY, rr.AnyValues(json=json.dumps(stored)))


def read_layout(path: Path | str) -> Layout:
    """The layout of a recording; raises ValueError where it holds none."""
    for chunk in RrdReader(str(path)).store().stream().filter(content=f"/__properties/{PROPERTY}").to_chunks():
        for row in chunk.to_record_batch().to_pylist():
            if row.get("json"):
                stored = json.loads(row["json"][0])
                canvas = stored.pop("canvas")
                try:
                    return Layout(Canvas(Scale(**canvas.pop("scale")), **canvas), **stored)
                except TypeError:  # it says more, or less, than this version knows
                    break
    raise ValueError(f"{path} does not say how it is laid out: it is not a recording of this version")
