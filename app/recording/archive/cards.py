"""A recording as a card of a page: its name, a picture of its last force network and its main results.

The picture is drawn as SVG from the recording, so that it is shown before, and without, a viewer.
"""

from __future__ import annotations

import html
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from ...process.counts import state_count
from ..look import entities
from ..look.canvas import Canvas
from ..look.colours import BACKGROUND, INK, OUTLINE, Rgba
from ..look.printable_text import printable
from ..tabs.layout_property import read_layout
from .catalogue import Value, read_properties

TEXT = 0.04  # height of a text over the width of the packing
KEY = 0.55  # of the legend below the packing: line and values
MAX_LINES = 4000  # contacts or grains in a picture, the widest first: it is a few centimetres wide


def make_card(recording: Path, name: str | None = None) -> str:
    """Return the card of a recording as HTML.

    Parameters
    ----------
    recording : Path
        The recording.
    name : str, optional
        Heading of the card; None: the name of the experiment.

    Returns
    -------
    str
        The card.

    Raises
    ------
    ValueError
        If the recording was not written by this version.
    OSError
        If the recording cannot be read.
    """
    canvas = read_layout(recording).canvas
    known = read_properties(recording)
    experiment = str(known.get("experiment:name", recording.stem))
    named = html.escape(printable(name or experiment))
    facts = "".join(f"<li>{html.escape(fact)}</li>" for fact in _facts(known))
    return f"{_network(recording, canvas)}<h2>{named}</h2><ul>{facts}</ul>"


def _facts(known: dict[str, Value]) -> list[str]:
    """Return the main results of a run, a few words each."""
    facts = []
    if {"experiment:frames", "experiment:grains"} <= set(known):
        counted = (("experiment:grains", "grain"), ("experiment:frames", "photograph"))
        facts.append(", ".join(state_count(int(known[name] or 0), noun) for name, noun in counted))
    frames, fraction = known.get("experiment:frames"), known.get("outcome:settled_share")
    if isinstance(frames, int) and isinstance(fraction, float):
        suspect = known.get("outcome:suspect_frames") or 0
        facts.append(f"{state_count(round(fraction * frames), 'frame')} settled, {suspect} suspect")
    median, least = known.get("outcome:trust_median"), known.get("outcome:trust_least")
    if isinstance(median, float) and isinstance(least, float):
        facts.append(f"trust {median:.2f} (least {least:.2f})")
    return facts


def _network(recording: Path, canvas: Canvas) -> str:
    """Return the force network of the last frame as SVG, with its caption, scale bar and key of forces."""
    forces, gaps = _last(recording, entities.FORCES), _last(recording, entities.FORCE_UNCERTAINTY)
    walls, grains = _last(recording, entities.WALLS), _last(recording, entities.GRAINS)
    lines = [*_lines(walls), *sorted(_lines(forces), key=lambda line: line[1])[-MAX_LINES:]]
    over = [*_lines(gaps), *_lines(_static(recording, entities.SCALE_BAR))]
    over += _lines(_static(recording, entities.FORCE_LEGEND))
    texts = [
        *_texts(_last(recording, entities.CAPTION), canvas),
        *_texts(_static(recording, entities.SCALE_BAR_LENGTH), canvas),
        *_texts(_static(recording, entities.FORCE_LEGEND + entities.TICKS), canvas),
    ]
    circles = list(zip(grains.get("Ellipses2D:centers", []), grains.get("Ellipses2D:half_sizes", []), strict=True))
    top, height = canvas.top - canvas.header_height, canvas.height + canvas.header_height + KEY * canvas.legend_height
    box = f"{canvas.left:.0f} {top:.0f} {canvas.width:.0f} {height:.0f}"
    thin = 0.04 * canvas.grain_radius
    return "".join([
        f'<svg viewBox="{box}" style="background:{_hex(BACKGROUND)}" stroke-linecap="round" fill="none">',
        f'<g stroke="{_hex(OUTLINE)}" stroke-opacity="0.5" stroke-width="{thin:.2f}">',
        *(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size[0]:.1f}"/>' for (x, y), size in circles[:MAX_LINES]),
        "</g>",
        *_paths(lines),
        '<g class="gaps and keys">',
        *_paths(over),
        "</g>",
        *texts,
        "</svg>",
    ])  # fmt: skip


def _paths(lines: list[tuple[str, float, str]]) -> list[str]:
    return [f'<path d="{d}" stroke="{colour}" stroke-width="{2.0 * radius:.1f}"/>' for d, radius, colour in lines]


def _lines(shown: dict[str, Any]) -> list[tuple[str, float, str]]:
    """Return path, radius [px] and colour of every line of an entity."""
    strips = shown.get("LineStrips2D:strips", [])
    radii = shown.get("LineStrips2D:radii", [])
    colours = [f"#{colour:08x}" for colour in shown.get("LineStrips2D:colors", [])]
    paths = ["M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in strip) for strip in strips]
    radii = radii * len(paths) if len(radii) == 1 else radii  # one for all
    colours = colours * len(paths) if len(colours) == 1 else colours
    return list(zip(paths, radii, colours, strict=True))


def _texts(shown: dict[str, Any], canvas: Canvas) -> list[str]:
    """Return the labels of an entity as SVG texts below their points, as the viewer draws them."""
    size = TEXT * canvas.width
    found = []
    for (x, y), label in zip(shown.get("Points2D:positions", []), shown.get("Points2D:labels", []), strict=True):
        for number, line in enumerate(label.split("\n")):
            place = f'x="{x:.0f}" y="{y + size * (1.1 + 1.2 * number):.0f}"'
            found.append(f'<text {place} font-size="{size:.1f}" text-anchor="middle" fill="{_hex(INK)}">'
                         f"{html.escape(line)}</text>")  # fmt: skip
    return found


def _static(recording: Path, entity: str) -> dict[str, Any]:
    """Return the components of an entity without time."""
    shown: dict[str, Any] = {}
    for chunk in RrdReader(str(recording)).store().stream().filter(content=entity).to_chunks():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and entities.FRAME not in batch.schema.names:
            for row in batch.to_pylist():
                shown |= {name: value for name, value in row.items() if value is not None}
    return shown


def _last(recording: Path, entity: str) -> dict[str, Any]:
    """Return the components of an entity in the last frame."""
    batches = []
    for chunk in RrdReader(str(recording)).store().stream().filter(content=entity).to_chunks():
        batch = chunk.to_record_batch()
        if {entities.FRAME, entities.SWEEP} <= set(batch.schema.names):
            batches.append(batch)
    last = max((int(_frames(batch).max()) for batch in batches if batch.num_rows), default=0)
    rows = []
    for batch in batches:
        rows += batch.filter(pa.array(_frames(batch) == last)).to_pylist()
    shown: dict[str, Any] = {}
    for row in sorted(rows, key=lambda row: row[entities.SWEEP]):
        shown |= {name: value for name, value in row.items() if value is not None}
    return shown


def _frames(batch: pa.RecordBatch) -> NDArray[np.int64]:
    return batch.column(entities.FRAME).cast(pa.int64()).to_numpy(zero_copy_only=False)


def _hex(colour: Rgba) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour[:3])
