"""Rival inputs: what the input would be if one cause were true."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import Tracks, WallTracks
from ..inputs import Inputs
from .base_friction import coefficient_of

FRICTIONS = (0.12, 0.2, 0.35, 0.5, 0.8)  # coefficients between rods that are compared …
DISTINCT = 0.04  # … if they differ by so much from the given one
DRAGS = (0.05, 0.12)  # of a base, over the mean contact force, that are compared
SMOOTH, ROUGH = 0.02, 0.5  # coefficients at walls that are compared
STRETCHES = (-0.01, -0.003, 0.003, 0.01)  # of x relative to y
CLASS_ERRORS = (-0.02, 0.02)  # of the radii of a class
MOST_CLASSES = 6  # of radii: with more they are measured rod by rod


@dataclass(frozen=True, slots=True)
class Rival:
    """One alternative to the given input."""

    cause: str
    words: str  # the assumption
    change: Callable[[Inputs], Inputs]


def rivals_of(inputs: Inputs) -> Iterator[Rival]:
    """Give the alternatives to an input."""
    yield Rival("photographs_reversed", "the photographs are in reverse order", _reversed)
    if not inputs.material.friction_measured:
        for friction in FRICTIONS:
            if abs(friction - inputs.material.friction) > DISTINCT:
                yield Rival("friction", f"rods have a friction of about {friction:g}", _with_friction(friction))
    if np.isfinite(inputs.walls.usual_pressure(inputs.material.length)).any() and not inputs.material.base_friction:
        for fraction in DRAGS:
            coefficient = coefficient_of(inputs, fraction)
            words = f"the base slows each rod by {100.0 * fraction:.0f} % of the mean force"
            yield Rival("base_friction", words, _with_base(coefficient))
    if inputs.walls.count:
        given = inputs.material.wall_friction
        given = inputs.material.friction if given is None else given
        for friction in (SMOOTH, ROUGH):
            if abs(friction - given) > 2.0 * DISTINCT:
                yield Rival(
                    "wall_friction", f"walls have a friction of about {friction:g}", _with_wall_friction(friction)
                )
        for shift, words in ((1, "late"), (-1, "early")):
            yield Rival("walls_shifted", f"the walls are one photograph {words}", _with_walls_shifted(shift))
    for stretch in STRETCHES:
        yield Rival("stretched_picture", f"x is stretched by {-100.0 * stretch:g} %", _stretched(stretch))
    classes = np.unique(np.round(inputs.tracks.radius, 6))
    if 1 < len(classes) <= MOST_CLASSES:
        for error in CLASS_ERRORS:
            words = f"the largest rods are stated {-100.0 * error:+.0f} % wrong"
            yield Rival("class_radii", words, _with_class(float(classes[-1]), 1.0 + error))


def _reversed(inputs: Inputs) -> Inputs:
    tracks, walls = inputs.tracks, inputs.walls
    names = ("position", "rotation", "sigma", "zncc", "status")
    turned: dict[str, Array] = {name: getattr(tracks, name)[::-1].copy() for name in names}
    load = None if walls.load is None else walls.load[::-1].copy()
    cell = None if walls.cell is None else walls.cell[::-1].copy()
    back = replace(walls, endpoints=walls.endpoints[::-1].copy(), load=load, cell=cell)
    return replace(inputs, tracks=replace(tracks, **turned), walls=back)


def _with_friction(friction: float) -> Callable[[Inputs], Inputs]:
    return lambda inputs: replace(inputs, material=replace(inputs.material, friction=friction))


def _with_base(coefficient: float) -> Callable[[Inputs], Inputs]:
    return lambda inputs: inputs.with_base_friction(coefficient)


def _with_wall_friction(friction: float) -> Callable[[Inputs], Inputs]:
    return lambda inputs: replace(inputs, material=replace(inputs.material, wall_friction=friction))


def _with_walls_shifted(shift: int) -> Callable[[Inputs], Inputs]:
    def change(inputs: Inputs) -> Inputs:
        count = len(inputs.walls.endpoints)
        rows = np.clip(np.arange(count) + shift, 0, count - 1)
        return replace(inputs, walls=_with_endpoints(inputs.walls, inputs.walls.endpoints[rows]))

    return change


def _stretched(stretch: float) -> Callable[[Inputs], Inputs]:
    scale = np.array([1.0 + stretch, 1.0])

    def change(inputs: Inputs) -> Inputs:
        tracks: Tracks = replace(inputs.tracks, position=inputs.tracks.position * scale)
        return replace(inputs, tracks=tracks, walls=_with_endpoints(inputs.walls, inputs.walls.endpoints * scale))

    return change


def _with_class(radius: float, factor: float) -> Callable[[Inputs], Inputs]:
    def change(inputs: Inputs) -> Inputs:
        radii = inputs.tracks.radius
        same = np.isclose(radii, radius, atol=1e-6)
        return replace(inputs, tracks=replace(inputs.tracks, radius=np.where(same, factor * radii, radii)))

    return change


def _with_endpoints(walls: WallTracks, endpoints: Array) -> WallTracks:
    return replace(walls, endpoints=endpoints.copy())
