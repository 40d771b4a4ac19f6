"""Draws a legend below a packing: a line of colours with texts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from . import entities
from .axes import log_texts
from .canvas import Canvas
from .colours import INK, Rgba
from .values import strips

PIECES = 48
TICKS_BELOW, NOTES_BELOW = 0.10, 0.42  # of the height of the legend, from its line to the texts


def log_ramp_legend(
    stream: rr.RecordingStream,
    canvas: Canvas,
    path: str,
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
    path : str
        Entity of the line; that of the texts is below it.
    colours : array (PIECES,)
        Colours along the line.
    texts : list of (float, str)
        Fraction of the length and text, below the line.
    notes : sequence of (float, str, Rgba)
        Fraction of the length, text and colour, below the texts.
    """
    stream.log(path, strips(legend_pieces(canvas), 0.22 * canvas.grain_radius, colours, 50.0), static=True)
    log_legend_texts(stream, canvas, path + entities.TICKS, texts, notes)


def legend_span(canvas: Canvas) -> tuple[float, float, float]:
    """Return left end, right end and height of the line of a legend [px]."""
    middle, half = 0.5 * (canvas.left + canvas.right), 0.36 * canvas.width
    return middle - half, middle + half, canvas.bottom + 0.18 * canvas.legend_height


def legend_pieces(canvas: Canvas) -> NDArray[np.float32]:
    """Return a horizontal line in pieces (PIECES, 2, 2) [px]."""
    left, right, y = legend_span(canvas)
    x = np.linspace(left, right, PIECES + 1)
    ends: Array = np.stack([x[:-1], x[1:]], axis=1)
    return np.stack([ends, np.full_like(ends, y)], axis=2).astype(np.float32)


def log_legend_texts(
    stream: rr.RecordingStream,
    canvas: Canvas,
    path: str,
    texts: list[tuple[float, str]],
    notes: Sequence[tuple[float, str, Rgba]] = (),
) -> None:
    left, right, y = legend_span(canvas)
    lines = [(fraction, TICKS_BELOW, text, INK) for fraction, text in texts]
    lines += [(fraction, NOTES_BELOW, text, colour) for fraction, text, colour in notes]
    placed = [
        (np.array([left + fraction * (right - left), y + below * canvas.legend_height]), text, colour)
        for fraction, below, text, colour in lines
    ]
    log_texts(stream, path, placed)
