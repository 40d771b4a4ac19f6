"""Rival inputs: what the input would be if one cause of wrong geometry were true."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import Tracks, WallTracks
from ..inputs import Inputs

STRETCHES = (-0.01, -0.003, 0.003, 0.01)  # of x relative to y
RADIUS_ERRORS = (-0.02, 0.02)  # of all radii
CLASS_ERRORS = (-0.02, 0.02)  # of the radii of a class
MOST_CLASSES = 6  # of radii: with more they are measured rod by rod


@dataclass(frozen=True, slots=True)
class Rival:
    """One alternative to the given input."""

    cause: str
    words: str  # the assumption
    change: Callable[[Inputs], Inputs]
    size: float  # of the error that it assumes, with its sense
    gap: float = 0.0  # over a diameter, mean gap of touching hard rods in the given input if it is true; 0: any


def rivals_of(inputs: Inputs) -> Iterator[Rival]:
    """Give the alternatives to an input."""
    for stretch in STRETCHES:
        yield Rival("stretched_picture", f"x is stretched by {-100.0 * stretch:g} %", _stretched(stretch), stretch)
    for error in RADIUS_ERRORS:
        yield Rival("all_radii", f"all radii are stated {_wrong_by(error)}", _with_radii(1.0 + error), error, error)
    classes = np.unique(np.round(inputs.tracks.radius, 6))
    if 1 < len(classes) <= MOST_CLASSES:
        for error in CLASS_ERRORS:
            words = f"the largest rods are stated {_wrong_by(error)}"
            yield Rival("class_radii", words, _with_class(float(classes[-1]), 1.0 + error), error)


def _wrong_by(error: float) -> str:
    """State how wrong a radius is that has to be multiplied by 1 + error."""
    return f"{100.0 * abs(error):.0f} % too {'large' if error < 0.0 else 'small'}"


def _stretched(stretch: float) -> Callable[[Inputs], Inputs]:
    scale = np.array([1.0 + stretch, 1.0])

    def change(inputs: Inputs) -> Inputs:
        tracks: Tracks = replace(inputs.tracks, position=inputs.tracks.position * scale)
        return replace(inputs, tracks=tracks, walls=_with_endpoints(inputs.walls, inputs.walls.endpoints * scale))

    return change


def _with_radii(factor: float) -> Callable[[Inputs], Inputs]:
    return lambda inputs: replace(inputs, tracks=replace(inputs.tracks, radius=factor * inputs.tracks.radius))


def _with_class(radius: float, factor: float) -> Callable[[Inputs], Inputs]:
    def change(inputs: Inputs) -> Inputs:
        radii = inputs.tracks.radius
        same = np.isclose(radii, radius, atol=1e-6)
        return replace(inputs, tracks=replace(inputs.tracks, radius=np.where(same, factor * radii, radii)))

    return change


def _with_endpoints(walls: WallTracks, endpoints: Array) -> WallTracks:
    return replace(walls, endpoints=endpoints.copy())
