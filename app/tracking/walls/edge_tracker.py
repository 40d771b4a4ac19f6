"""Tracking of bars by their inner edges, which plain, brushed, shiny and thin bars show as well as painted ones.

An edge shows the motion across the bar and its rotation; the motion along it is that of the places where bars meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from .inner_edge import Edge, find_edge, inward_normal, move_inward
from .surrounding_bars import MIN_ANGLE

REACHES = (8.0, 20.0, 60.0)  # [px] from the expected place, tried one after another
MIN_CONTRAST = 0.4  # of the edge, over that of the first photograph
MODEL_ERROR = 0.07  # [px] that profiles share: light on the bar, and what is seen between the rods beside it
NEAR_CORNER = 0.1  # of a bar's length, between its end and the place where it meets another


@dataclass(frozen=True, slots=True)
class EdgePoses:
    """w bars in one photograph, by their edges. Bars whose edge is not seen have NaN."""

    endpoints: Array  # (w, 2, 2) [m], each end moved across the bar only
    sigma: Array  # (w, 2) [m] of each end along the bar's normal
    fraction: Array  # (w,) of the edge that is seen


class EdgeTracker:
    """The edges of the bars of one reference photograph in other photographs."""

    def __init__(self, reference_image: Image, endpoints: Array, scale: Scale) -> None:
        """Find the edges beside the given bars.

        Parameters
        ----------
        reference_image : (H, W) array
            The first photograph [grey].
        endpoints : (w, 2, 2) array
            The bars' faces on it [m], the packing on the left of 0 → 1.
        scale : Scale
        """
        self.scale = scale
        self.endpoints = np.array(endpoints, dtype=np.float64)
        lines = scale.to_pixels(self.endpoints)
        self._edges = [find_edge(reference_image, line, REACHES[0]) for line in lines]
        # A face is given where its rods touch it, and may be a little off its edge: this much at either end.
        self._offset = [_away(edge.line, line) for edge, line in zip(self._edges, lines, strict=True)]

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which bars (w,) show an edge on the reference."""
        return np.array([edge.is_seen for edge in self._edges], np.bool_)

    def first(self) -> EdgePoses:
        """Return the bars on the reference itself."""
        fraction = np.array([edge.fraction for edge in self._edges], np.float64)
        return EdgePoses(self.endpoints.copy(), np.zeros((len(fraction), 2)), fraction)

    def follow(self, image: Image, history: Sequence[EdgePoses]) -> EdgePoses:
        """Find the bars in the next photograph. history: earlier frames, the most recent last, at least one."""
        w = len(self.endpoints)
        endpoints, sigma, fraction = np.full((w, 2, 2), np.nan), np.full((w, 2), np.nan), np.zeros(w)
        for k in np.flatnonzero(self.seen).tolist():
            known = [pose.endpoints[k] for pose in history if np.isfinite(pose.endpoints[k]).all()]
            steady = [2.0 * known[-1] - known[-2]] if len(known) > 1 else []
            found = self._find(image, k, [*steady, known[-1]])
            if found is None:
                continue
            line, edge = found
            endpoints[k] = self.scale.to_world(_feet(line, self.scale.to_pixels(known[-1])))
            variance = edge.sigma**2 + self._edges[k].sigma ** 2 + MODEL_ERROR**2
            sigma[k], fraction[k] = np.sqrt(variance) * self.scale.mean_size, edge.fraction
        return EdgePoses(endpoints, sigma, fraction)

    def _find(self, image: Image, k: int, expected: Sequence[Array]) -> tuple[Array, Edge] | None:
        """The face [px] of bar k near one of the expected places (2, 2) [m], and its edge."""
        least = MIN_CONTRAST * self._edges[k].contrast
        for reach in REACHES:
            for place in expected:
                line = self.scale.to_pixels(place)
                expected_edge = move_inward(line, -self._offset[k])
                edge = find_edge(image, expected_edge, reach)
                if np.abs(_away(edge.line, expected_edge)).max() > 0.5 * reach:  # some profiles end before it
                    edge = find_edge(image, edge.line, REACHES[0])
                if edge.is_seen and edge.contrast >= least:
                    return move_inward(edge.line, self._offset[k]), edge
        return None


def move_to_corners(endpoints: Array, rows: NDArray[np.bool_]) -> Array:
    """Move ends of some bars along them, as the places where they meet the others move.

    Parameters
    ----------
    endpoints : (f, w, 2, 2) array
        The bars; NaN where they were not found.
    rows : (w,) array
        The bars whose motion along themselves is unknown.

    Returns
    -------
    (f, w, 2, 2) array
        The bars; an end that is not near a place where two bars meet on the first frame is moved across its bar only.
    """
    moved = endpoints.copy()
    first = endpoints[0]
    for w in np.flatnonzero(rows).tolist():
        along = _direction(endpoints[:, w])
        start = endpoints[:, w, :1]
        moved[:, w] = start + np.einsum("fek,fk->fe", first[w] - start, along)[..., None] * along[:, None]
        length = float(np.linalg.norm(first[w, 1] - first[w, 0]))
        for end in (0, 1):
            met = np.array([_place_of_meeting(endpoints[:, w], endpoints[:, v]) for v in range(len(first)) if v != w])
            far = np.linalg.norm(met[:, 0] - first[w, end], axis=1) if len(met) else np.empty(0)
            if not (far < NEAR_CORNER * length).any():
                continue
            place = met[np.nanargmin(far)]
            beyond = float((first[w, end] - place[0]) @ along[0])
            there = np.isfinite(place).all(axis=1) & np.isfinite(along).all(axis=1)
            moved[there, w, end] = (place + beyond * along)[there]
    return moved


def _place_of_meeting(bar: Array, other: Array) -> Array:
    """Where the lines of two bars (f, 2, 2) meet (f, 2); NaN where they are nearly parallel or not found."""
    a, b = _direction(bar), _direction(other)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    cross = np.where(np.abs(cross) > np.sin(MIN_ANGLE), cross, np.nan)
    apart = other[:, 0] - bar[:, 0]
    reach = (apart[:, 0] * b[:, 1] - apart[:, 1] * b[:, 0]) / cross
    return np.asarray(bar[:, 0] + reach[:, None] * a)


def _direction(bar: Array) -> Array:
    """Unit vectors (f, 2) from end 0 to end 1 of bars (f, 2, 2)."""
    along = bar[:, 1] - bar[:, 0]
    return np.asarray(along / np.linalg.norm(along, axis=1)[:, None])


def _away(line: Array, points: Array) -> Array:
    """Distances (2,) of points (2, 2) from a line (2, 2) [px], positive towards the packing."""
    return np.asarray((points - line[0]) @ inward_normal(line))


def _feet(line: Array, points: Array) -> Array:
    """The points of a line (2, 2) nearest to points (2, 2)."""
    return np.asarray(points - _away(line, points)[:, None] * inward_normal(line))
