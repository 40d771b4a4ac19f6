"""Writes the legends below the packing: forces by width and colour, gaps and other quantities by colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ..look import entities
from ..look.axes import log_texts, round_step
from ..look.canvas import Canvas
from ..look.colours import ADDED, BOUNDARY, FORBIDDEN, INK, LOST, NEW_CONTACT, SLIDING, Rgba, packed_one
from ..look.scene import Scene
from .contact_changes import gap_colours, gap_range
from .forces.contact_colours import COLOURINGS
from .residual_maps import DECADES, residual_colours

PIECES = 48
TICKS_BELOW, NOTES_BELOW = 0.10, 0.42  # of the height of the legend, from its line to the texts
_POWERS = ("grains 10⁻⁴", "0.001", "0.01", "0.1", "1")  # labels of the decades of the unbalance map
_CHANGES = ("lines 10⁻⁶", "10⁻⁵", "10⁻⁴", "0.001", "0.01")  # labels of the decades of the change map


def log_legends(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log all legends, static."""
    log_force_legend(stream, scene)
    _log_scale_bar(stream, scene.canvas)
    _log_gap_legend(stream, scene)
    power = np.linspace(DECADES[0], DECADES[1], PIECES)
    decades = int(DECADES[1] - DECADES[0])
    log_ramp_legend(
        stream, scene.canvas, entities.MAP_LEGEND, entities.MAP_LEGEND_TICKS, residual_colours(10.0**power),
        [(k / decades, text) for k, text in enumerate(_POWERS[-decades - 1 :])],
        [(k / decades, text, INK) for k, text in enumerate(_CHANGES[-decades - 1 :])],
    )  # fmt: skip
    fraction = np.linspace(0.0, 1.0, PIECES)
    for name, colouring in COLOURINGS.items():
        path = f"{entities.COLOUR_LEGENDS}/{name}"
        colours = colouring.colours(fraction)
        log_ramp_legend(stream, scene.canvas, path, f"{path}/ticks", colours, colouring.texts(scene))


def log_force_legend(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log a wedge from zero force to the top of the range, with the mean marked."""
    style, top = scene.style, scene.style.range.top
    fn = np.linspace(0.0, top, PIECES + 1)[1:]
    stream.log(
        entities.FORCE_LEGEND,
        rr.LineStrips2D(_pieces(scene.canvas), radii=style.radii(fn), colors=style.colours(fn), draw_order=50.0),
        static=True,
    )
    mean = style.range.mean
    values = [(0.0, "0"), (mean, f"mean {mean:.3g} N"), (0.5 * (top + mean), f"{0.5 * (top + mean):.3g}")]
    values.append((top, f"≥ {top:.3g} N"))
    notes = [(0.2, "point: sliding contact", SLIDING), (0.62, "dim edge: 95 % of f_n", INK)]
    if scene.tracks.boundary is not None:
        notes.append((0.96, "rim: boundary", BOUNDARY))
    places = [(value / top, text) for value, text in values]
    _log_ticks(stream, scene.canvas, entities.FORCE_LEGEND_TICKS, places)
    _log_ticks(stream, scene.canvas, entities.FORCE_LEGEND_NOTES, [], notes)


def _log_scale_bar(stream: rr.RecordingStream, canvas: Canvas) -> None:
    """Log a bar of a round length in the corner above the grains."""
    pixel = canvas.scale.pixel_size * canvas.shrink
    length = round_step(0.25 * canvas.width * pixel)
    start = np.array([canvas.left + 0.6 * canvas.grain_radius, canvas.top + 0.5 * canvas.grain_radius])
    end = start + np.array([length / pixel, 0.0])
    stream.log(
        entities.SCALE_BAR,
        rr.LineStrips2D(
            [np.stack([start, end]).astype(np.float32)], radii=np.float32(0.1 * canvas.grain_radius),
            colors=packed_one(INK), draw_order=50.0,
        ),
        static=True,
    )  # fmt: skip
    label = f"{1e3 * length:g} mm" if length < 1.0 else f"{length:g} m"
    log_texts(stream, entities.SCALE_BAR_LENGTH, [(0.5 * (start + end), label, INK)])


def _log_gap_legend(stream: rr.RecordingStream, scene: Scene) -> None:
    reach = gap_range(scene)
    gap = np.linspace(-reach, reach, PIECES)
    stream.log(
        entities.GAP_LEGEND,
        rr.LineStrips2D(
            _pieces(scene.canvas),
            radii=np.float32(0.22 * scene.canvas.grain_radius),
            colors=gap_colours(gap, reach),
            draw_order=50.0,
        ),
        static=True,
    )
    micrometres = 1e6 * reach
    texts = [(0.0, f"overlap {micrometres:g} µm"), (0.5, "touching"), (1.0, f"open {micrometres:g} µm")]
    notes = [
        (0.02, "new", NEW_CONTACT), (0.2, "lost", LOST), (0.48, "added by a reviewer", ADDED),
        (0.88, "forbidden by one", FORBIDDEN),
    ]  # fmt: skip
    _log_ticks(stream, scene.canvas, entities.GAP_LEGEND_TICKS, texts, notes)


def log_ramp_legend(
    stream: rr.RecordingStream,
    canvas: Canvas,
    path: str,
    ticks: str,
    colours: NDArray[np.uint32],
    texts: list[tuple[float, str]],
    notes: Sequence[tuple[float, str, Rgba]] = (),
) -> None:
    """Log a line of colours with texts, static.

    Parameters
    ----------
    stream : RecordingStream
        The stream.
    canvas : Canvas
        Bounds of the packing view.
    path, ticks : str
        Entities of the line and of the texts.
    colours : array (PIECES,)
        Colours along the line.
    texts : list of (float, str)
        Fraction of the length and text, below the line.
    notes : sequence of (float, str, Rgba)
        Fraction of the length, text and colour, below the texts.
    """
    strips = rr.LineStrips2D(
        _pieces(canvas), radii=np.float32(0.22 * canvas.grain_radius), colors=colours, draw_order=50.0
    )
    stream.log(path, strips, static=True)
    _log_ticks(stream, canvas, ticks, texts, notes)


def _span(canvas: Canvas) -> tuple[float, float, float]:
    """Return left end, right end and height of the line of a legend [px]."""
    middle, half = 0.5 * (canvas.left + canvas.right), 0.36 * canvas.width
    return middle - half, middle + half, canvas.bottom + 0.18 * canvas.legend_height


def _pieces(canvas: Canvas) -> NDArray[np.float32]:
    """Return a horizontal line in pieces (PIECES, 2, 2) [px]."""
    left, right, y = _span(canvas)
    x = np.linspace(left, right, PIECES + 1)
    ends: Array = np.stack([x[:-1], x[1:]], axis=1)
    return np.stack([ends, np.full_like(ends, y)], axis=2).astype(np.float32)


def _log_ticks(
    stream: rr.RecordingStream,
    canvas: Canvas,
    path: str,
    texts: list[tuple[float, str]],
    notes: Sequence[tuple[float, str, Rgba]] = (),
) -> None:
    left, right, y = _span(canvas)
    lines = [(fraction, TICKS_BELOW, text, INK) for fraction, text in texts]
    lines += [(fraction, NOTES_BELOW, text, colour) for fraction, text, colour in notes]
    placed = [
        (np.array([left + fraction * (right - left), y + below * canvas.legend_height]), text, colour)
        for fraction, below, text, colour in lines
    ]
    log_texts(stream, path, placed)
