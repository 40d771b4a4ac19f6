"""Polygons of a mask from strokes of a brush."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

Polygon = list[tuple[float, float]]
TOLERANCE = 0.6  # [px] by which the outline of a stroke may be simplified
STEP = 4  # pixels of the drawing for one of the photograph


def outline_of_stroke(points: Sequence[Sequence[float]], radius: float) -> list[Polygon]:
    """Return the outline of a stroke of a round brush; a closed stroke covers what it encloses.

    Parameters
    ----------
    points
        The way of the brush [px].
    radius
        Radius of the brush [px].
    """
    way = np.array(points, np.float64)
    margin = radius + 2.0
    low = np.floor(way.min(axis=0) - margin)
    wide, high = np.ceil(way.max(axis=0) + margin - low)
    step = STEP if max(wide, high) < 2000.0 else 1
    drawn = np.zeros((int(step * high) + 1, int(step * wide) + 1), np.uint8)
    places = np.rint(step * (way - low)).astype(np.int32)
    cv2.polylines(drawn, [places], False, 255, max(round(2.0 * step * radius), 1))
    for x, y in places.tolist():
        cv2.circle(drawn, (x, y), max(round(step * radius), 1), 255, -1)
    outlines, _ = cv2.findContours(drawn, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    found = []
    for each in outlines:
        simple = cv2.approxPolyDP(each, TOLERANCE * step, True).reshape(-1, 2) / step + low
        if len(simple) > 2:
            found.append([(round(float(x), 1), round(float(y), 1)) for x, y in simple])
    return found
