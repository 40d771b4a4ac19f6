"""Rods that no photograph shows: where they must be, from the holes that they leave and the neighbours that hold them.

A rod that bears force is held by its neighbours: one of the right radius touches three of them at once, in photograph
after photograph, which a rod of another radius or in another place does by chance only. Such places are looked for in
every hole, followed with the motion of what is around, and taken one after the other, the surest first: each makes the
holes beside it smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import Sides
from solver.inferred.surroundings import Surroundings

MISFIT = 5.0  # standard deviations of a gap within which a body touches the rod …
COARSE = 0.3  # of a radius: beyond it nothing tells a rod that touches from one that does not
SURFACE = 1e-3  # … the share of its radius …
OVERLAPS = 2.0  # … and, where grains are soft, their mean overlaps: they are distributed nearly as exp(−δ / ⟨δ⟩) …
DEEPEST = 5.0  # … up to so many of them, in the strongest contacts
TOUCHES_FREE = 2  # bodies that any rod can be made to touch
LEAST_HELD = 0.45  # mean number of touches beyond those, over photographs, that is no chance …
LEAST_TOUCHES = 5.0  # … and the least number in all photographs together
TOLERATED = 0.25  # share of the photographs in which the rod may overlap something
CROWDED = 0.5  # of the smaller radius: two rods nearer than that are one
STARTS = 4  # photographs in which places are looked for, spread evenly
TRIED = 12  # radii that are tried where rods come in no classes
PASSES = 6  # each sees what the one before it found
FEWEST_FRAMES, FEWEST_GRAINS = 3, 8


@dataclass(frozen=True, slots=True)
class UnseenRods:
    """Rods that were inferred."""

    radius: Array  # (u,) [m]
    position: Array  # (f, u, 2) [m]
    sigma: Array  # (f, u) [m] standard deviation of a position component
    held: Array  # (u,) bodies that it touches beyond two, mean over photographs

    @property
    def count(self) -> int:
        return len(self.radius)


@dataclass(frozen=True, slots=True)
class _Tolerance:
    """Gaps [m] within which a body touches a rod."""

    apart: float
    deep: float  # overlapping


@dataclass(frozen=True, slots=True)
class _Rod:
    radius: float
    position: Array  # (f, 2)
    sigma: Array  # (f,)
    held: float
    overlapping: float  # share of photographs


def infer_unseen(
    radius: Array,
    position: Array,
    present: NDArray[np.bool_],
    endpoints: Array,
    noise: float,
    sizes: Array | None = None,
    side: Sides = None,
    *,
    overlap: float = 0.0,
) -> UnseenRods:
    """Infer the rods of a packing that were never seen.

    radius (n,) [m]; position (f, n, 2) [m]; present (f, n); endpoints (f, w, 2, 2) [m]; noise [m]: standard deviation
    of a position component; sizes (q,) [m]: the radii that rods have, None: any; side (w,): which walls are
    circles; overlap [m]: mean overlap of touching grains where they are soft. Grains that are missing in some
    photographs only leave no hole that lasts.
    """
    shown = present.sum(axis=1) >= FEWEST_GRAINS  # a photograph that failed tells nothing
    position, present, endpoints = position[shown], present[shown], endpoints[shown]
    frames = len(position)
    rods: list[_Rod] = []
    if sizes is None:
        sizes = np.quantile(radius, np.linspace(0.0, 1.0, TRIED))
    exact = MISFIT * np.sqrt(2.0) * noise + SURFACE * float(radius.mean())
    tolerance = _Tolerance(exact + OVERLAPS * overlap, exact + DEEPEST * overlap)
    # Soft rods are looked for as if all were smaller by what they overlap on average: their gaps scatter about nothing.
    radius, sizes, noise = radius - 0.5 * overlap, sizes - 0.5 * overlap, float(np.hypot(noise, overlap / np.sqrt(2.0)))
    if frames >= FEWEST_FRAMES and endpoints.shape[1] and tolerance.apart < COARSE * float(np.min(sizes)):
        near: Array | None = None
        for _ in range(PASSES):
            around = Surroundings(*_with(radius, position, present, rods), endpoints, noise, side)
            new = _surest(_propose(around, sizes, near, tolerance), tolerance)
            if not new:
                break
            rods += new
            near = np.stack([each.position for each in new], axis=1)
    if not rods:
        return UnseenRods(np.empty(0), np.empty((len(shown), 0, 2)), np.empty((len(shown), 0)), np.empty(0))
    place, sigma = np.full((len(shown), len(rods), 2), np.nan), np.full((len(shown), len(rods)), np.nan)
    place[shown] = np.stack([each.position for each in rods], axis=1)
    sigma[shown] = np.stack([each.sigma for each in rods], axis=1)
    found = np.array([each.radius for each in rods]) + 0.5 * overlap
    return UnseenRods(found, place, sigma, np.array([each.held for each in rods]))


def _with(
    radius: Array, position: Array, present: NDArray[np.bool_], rods: list[_Rod]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    if not rods:
        return radius, position, present
    return (
        np.concatenate([radius, [each.radius for each in rods]]),
        np.concatenate([position, np.stack([each.position for each in rods], axis=1)], axis=1),
        np.concatenate([present, np.ones((len(present), len(rods)), bool)], axis=1),
    )


def _propose(around: Surroundings, sizes: Array, near: Array | None, tolerance: _Tolerance) -> list[_Rod]:
    """Every rod that would be held somewhere, followed through all photographs; near (f, q, 2): only around these."""
    proposed: list[_Rod] = []
    for k in np.unique(np.linspace(0, around.frame_count - 1, STARTS).round().astype(int)).tolist():
        for size in sizes.tolist():
            for place in around.find_places(
                k, size, tolerance.apart, tolerance.deep, None if near is None else near[k]
            ):
                if not any(_is_at(each, k, place, size) for each in proposed):
                    proposed.append(_follow(around, place, k, size, tolerance))
    return proposed


def _is_at(rod: _Rod, k: int, place: Array, size: float) -> bool:
    """Whether a rod has been followed to this very place."""
    return rod.radius == size and float(np.hypot(*(rod.position[k] - place))) < 0.02 * size


def _follow(around: Surroundings, place: Array, k: int, size: float, tolerance: _Tolerance) -> _Rod:
    """Follow a rod from its place in photograph k to all others."""
    frames = around.frame_count
    position, sigma = np.empty((frames, 2)), np.empty(frames)
    held, overlaps = np.zeros(frames), np.zeros(frames, bool)
    position[k], sigma[k] = around.hold(place, k, size)
    for to, since in [(to, to - 1) for to in range(k + 1, frames)] + [(to, to + 1) for to in range(k - 1, -1, -1)]:
        position[to], sigma[to] = around.hold(around.carry(position[since], since, to), to, size)
    for f in range(frames):
        gap = around.gaps(position[f], f, size)
        held[f] = np.count_nonzero((gap < tolerance.apart) & (gap > -tolerance.deep)) - TOUCHES_FREE
        overlaps[f] = gap.min(initial=np.inf) < -tolerance.deep
    return _Rod(size, position, sigma, float(np.maximum(held, 0.0).mean()), float(overlaps.mean()))


def _surest(proposed: list[_Rod], tolerance: _Tolerance) -> list[_Rod]:
    """Those that are held, none of which overlaps a surer one."""
    chosen: list[_Rod] = []
    least = max(LEAST_HELD, LEAST_TOUCHES / len(proposed[0].position)) if proposed else 0.0
    fit = [each for each in proposed if each.held >= least and each.overlapping <= TOLERATED]
    for rod in sorted(fit, key=lambda each: (-each.held, -each.radius)):
        free = True
        for other in chosen:
            apart = np.linalg.norm(rod.position - other.position, axis=1)
            together = apart < rod.radius + other.radius - tolerance.deep
            free &= together.mean() <= TOLERATED
        if free:
            chosen.append(rod)
    return chosen
