"""Colours of the views: fixed ones, and ramps of quantities other than the force."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...drawing.ramps import make_ramp

Rgba = tuple[int, int, int, int]
Marker = Literal["circle", "square", "diamond", "cross", "up", "plus", "down", "asterisk", "left"]

BACKGROUND: Rgba = (13, 14, 18, 255)
INK: Rgba = (214, 218, 226, 255)  # text and axes
FAINT: Rgba = (92, 97, 108, 255)  # grid lines
OUTLINE: Rgba = (150, 158, 172, 120)  # grains
WEAK: Rgba = (150, 152, 158, 200)  # contacts below the weak level
OPEN: Rgba = (120, 122, 130, 90)  # contacts without force
WALL: Rgba = (120, 128, 142, 255)
BOUNDARY: Rgba = (226, 205, 162, 255)  # grains with prescribed motion
LOADED_WALL: Rgba = (222, 227, 236, 255)
SLIDING: Rgba = (64, 214, 222, 255)  # for the tangential state only
SUSPECT: Rgba = (255, 186, 73, 255)
LOST: Rgba = (255, 82, 130, 255)
INFERRED: Rgba = (96, 168, 255, 255)  # a rod that no photograph shows
NEW_CONTACT: Rgba = (112, 250, 147, 255)
ADDED: Rgba = (196, 130, 255, 255)  # by a reviewer
FORBIDDEN: Rgba = (255, 214, 80, 255)  # by a reviewer
# Curves: CIE76 differences of 28 and more under all kinds of colour blindness; of the first four, steps of 13 in
# lightness for grey. Where more than four are drawn together, MARKERS distinguish them in grey.
SERIES: tuple[Rgba, ...] = (
    (216, 198, 65, 255), (28, 122, 250, 255), (155, 255, 180, 255), (229, 129, 176, 255),
    (180, 165, 255, 255), (180, 60, 75, 255), (105, 90, 165, 255), (210, 0, 0, 255),
)  # fmt: skip
# Shapes of Rerun for the points of a curve, each with the characters that stand for it in a key. There are no more
# colours than shapes, and the numbers of both have no common divisor: a pair of both repeats after 72 curves.
MARKERS: dict[Marker, str] = {
    "circle": "o", "square": "[]", "diamond": "<>", "cross": "x", "up": "^", "plus": "+", "down": "v", "asterisk": "*",
    "left": "<",
}  # fmt: skip

# Signed quantities: lightness is monotonic, so that less and more differ without hue.
# Overlap cream, touching orange, open blue.
_GAP_PATH = ((0.97, 0.04, 106.0), (0.87, 0.12, 85.0), (0.72, 0.14, 55.0), (0.56, 0.09, 330.0), (0.42, 0.12, 265.0))
# Slate, violet, magenta, rose, pale: large residuals and uncertainties are bright.
_UNCERTAINTY_PATH = (
    (0.36, 0.045, 260.0), (0.46, 0.10, 285.0), (0.58, 0.19, 330.0), (0.74, 0.15, 5.0), (0.95, 0.03, 60.0),
)  # fmt: skip
# Ambiguous yellow to blue where two bodies certainly touch; lightness is monotonic, so that it is readable in grey.
_PROBABILITY_PATH = ((0.93, 0.13, 103.0), (0.81, 0.12, 70.0), (0.67, 0.05, 10.0), (0.47, 0.075, 240.0))
# Less, deep blue; equal, grey; more, bright yellow.
_DIFFERENCE_PATH = (
    (0.41, 0.235, 264.0), (0.52, 0.12, 260.0), (0.62, 0.0, 0.0), (0.75, 0.08, 60.0), (0.905, 0.10, 88.0),
)  # fmt: skip


def style_of_series(row: int) -> tuple[Rgba, Marker]:
    """Return colour and marker of a curve among any number of them."""
    markers: tuple[Marker, ...] = tuple(MARKERS)
    return SERIES[row % len(SERIES)], markers[row % len(markers)]


def packed(colours: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Convert colours (k, 4) to 0xRRGGBBAA (k,), the form stored in the recording."""
    red, green, blue, alpha = np.asarray(colours, np.uint32).T
    return red << 24 | green << 16 | blue << 8 | alpha


def packed_one(colour: Rgba) -> np.uint32:
    """Convert one colour to 0xRRGGBBAA."""
    return packed(np.array([colour], np.uint8))[0]


GAP_RAMP = make_ramp(_GAP_PATH)
UNCERTAINTY_RAMP = make_ramp(_UNCERTAINTY_PATH)
PROBABILITY_RAMP = make_ramp(_PROBABILITY_PATH)
DIFFERENCE_RAMP = make_ramp(_DIFFERENCE_PATH)
