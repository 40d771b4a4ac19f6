"""Writes the legends below the packing: forces by width and colour, gaps and other quantities by colour."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...drawing.uncertainty import WIDEST, line_gaps
from ..look import entities
from ..look.axes import log_texts, round_step
from ..look.canvas import Canvas
from ..look.colours import ADDED, BACKGROUND, BOUNDARY, FORBIDDEN, INK, LOST, NEW_CONTACT, SLIDING, packed_one
from ..look.ramp_legend import PIECES, legend_pieces, legend_span, log_legend_texts, log_ramp_legend
from ..look.scene import Scene
from ..look.values import strips
from .contact_changes import gap_colours, gap_range
from .forces.contact_colours import COLOURINGS
from .forces.force_uncertainty import gap_strokes
from .residual_maps import DECADES, residual_colours

# Lines that explain gaps: place over the length of the wedge, σ / f_n, text.
GAP_KEY = ((0.0, 0.0, "σ / f_n < 20 %"), (0.28, 0.4, "40 %"), (0.54, WIDEST, "80 % or more"))
KEY_BELOW = 0.47
_POWERS = ("grains 10⁻⁴", "0.001", "0.01", "0.1", "1")  # labels of the decades of the map of force residuals
_CHANGES = ("lines 10⁻⁶", "10⁻⁵", "10⁻⁴", "0.001", "0.01")  # labels of the decades of the change map


def log_legends(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log all legends, static."""
    log_force_legend(stream, scene)
    log_scale_bar(stream, scene.canvas)
    _log_gap_legend(stream, scene)
    power = np.linspace(DECADES[0], DECADES[1], PIECES)
    decades = int(DECADES[1] - DECADES[0])
    log_ramp_legend(
        stream, scene.canvas, entities.MAP_LEGEND, residual_colours(10.0**power),
        [(k / decades, text) for k, text in enumerate(_POWERS[-decades - 1 :])],
        [(k / decades, text, INK) for k, text in enumerate(_CHANGES[-decades - 1 :])],
    )  # fmt: skip
    fraction = np.linspace(0.0, 1.0, PIECES)
    for name, colouring in COLOURINGS.items():
        path = f"{entities.COLOUR_LEGENDS}/{name}"
        colours = colouring.colours(fraction)
        log_ramp_legend(stream, scene.canvas, path, colours, colouring.texts(scene))


def log_force_legend(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log a wedge from zero force to the top of the range, with the mean marked."""
    style, top = scene.style, scene.style.range.top
    fn = np.linspace(0.0, top, PIECES + 1)[1:]
    stream.log(entities.FORCE_LEGEND, style.strips(legend_pieces(scene.canvas), fn, 50.0), static=True)
    mean, unit = style.range.mean, scene.force_unit
    values = [(0.0, "0"), (mean, f"mean {mean:.3g} {unit}"), (0.5 * (top + mean), f"{0.5 * (top + mean):.3g}")]
    values.append((top, f"≥ {top:.3g} {unit}"))
    places = [(value / top, text) for value, text in values]
    log_legend_texts(stream, scene.canvas, entities.FORCE_LEGEND + entities.TICKS, places)
    notes = [(0.98, "point: sliding", SLIDING)]
    if scene.tracks.boundary is not None:
        notes.append((0.75, "rim: boundary", BOUNDARY))
    log_legend_texts(stream, scene.canvas, entities.FORCE_LEGEND_NOTES, [], notes)
    _log_gap_key(stream, scene)


def _log_gap_key(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log lines of a force of 1.5 times the mean, sure and uncertain, below the wedge."""
    canvas, style = scene.canvas, scene.style
    left, right, y = legend_span(canvas)
    level = y + KEY_BELOW * canvas.legend_height
    force = np.full(len(GAP_KEY), 1.5 * style.range.mean)
    start = np.array([left + place * (right - left) for place, *_ in GAP_KEY])
    ends = np.stack([start, start + 4.0 * canvas.grain_radius], axis=1)
    lines = np.stack([ends, np.full_like(ends, level)], axis=2)
    gaps = line_gaps(lines, np.array([relative for _, relative, _ in GAP_KEY]), canvas.grain_radius)
    radii = style.radii(force)
    strokes, width = gap_strokes(gaps, radii[gaps.row], canvas.grain_radius)
    colours = np.append(style.colours(force), np.full(len(strokes), packed_one(BACKGROUND), np.uint32))
    drawn = strips(np.concatenate([lines, strokes]), np.append(radii, width), colours, 50.0)
    stream.log(entities.UNCERTAINTY_LEGEND, drawn, static=True)
    below = np.array([0.0, 0.02 * canvas.legend_height])
    texts = [
        (line.mean(axis=0) + below, text, INK) for line, (_, _, text) in zip(lines, GAP_KEY, strict=True)
    ]  # fmt: skip
    log_texts(stream, entities.UNCERTAINTY_LEGEND + entities.TICKS, texts)


def scale_bar_of(canvas: Canvas) -> tuple[float, str]:
    """Return length [px] and label of a bar of a round length."""
    pixel = canvas.scale.pixel_size * canvas.shrink
    length = round_step(0.25 * canvas.width * pixel)
    return length / pixel, f"{1e3 * length:g} mm" if length < 1.0 else f"{length:g} m"


def log_scale_bar(stream: rr.RecordingStream, canvas: Canvas) -> None:
    """Log a bar of a round length above the grains."""
    length, label = scale_bar_of(canvas)
    start = np.array([canvas.left + 0.6 * canvas.grain_radius, canvas.top - 0.8 * canvas.header_height])
    end = start + np.array([length, 0.0])
    bar = strips(np.stack([start, end])[None], 0.1 * canvas.grain_radius, INK, 50.0)
    stream.log(entities.SCALE_BAR, bar, static=True)
    log_texts(stream, entities.SCALE_BAR_LENGTH, [(0.5 * (start + end), label, INK)])


def _log_gap_legend(stream: rr.RecordingStream, scene: Scene) -> None:
    reach = gap_range(scene)
    gap = np.linspace(-reach, reach, PIECES)
    line = strips(legend_pieces(scene.canvas), 0.22 * scene.canvas.grain_radius, gap_colours(gap, reach), 50.0)
    stream.log(entities.GAP_LEGEND, line, static=True)
    micrometres = 1e6 * reach
    texts = [(0.0, f"overlap {micrometres:g}"), (0.5, "touching"), (1.0, f"open {micrometres:g} µm")]
    notes = [
        (0.0, "new", NEW_CONTACT), (0.25, "- - lost", LOST), (0.57, "added", ADDED),
        (0.97, "- - forbidden", FORBIDDEN),
    ]  # fmt: skip
    log_legend_texts(stream, scene.canvas, entities.GAP_LEGEND + entities.TICKS, texts, notes)
