"""Rods that no photograph shows, inferred from holes of the packing and from neighbours that would hold them.

A rod that bears force is held by its neighbours: with the right radius it touches at least three of them at once, in
every photograph, which a rod of another radius or at another place does only by chance: the chance counts once while
the packing around stays as it is. Such places are searched in every hole, tracked with the motion of their neighbours,
and accepted one after the other, those with most contacts first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import Sides
from ..even_subset import even_subset
from .surroundings import Surroundings

MISFIT = 5.0  # standard deviations of a gap: tolerance of contact with the rod …
COARSE = 0.3  # of a radius: with a larger tolerance contacts cannot be detected
SURFACE = 1e-3  # … plus this fraction of its radius …
OVERLAPS = 2.0  # … plus, for soft grains, mean overlaps, which are distributed nearly as exp(−δ / ⟨δ⟩) …
DEEPEST = 5.0  # … mean overlaps in the strongest contacts
TOUCHES_FREE = 2  # bodies that any rod can touch by its choice of place
LEAST_HELD = 0.45  # mean number of further contacts per photograph that is significant …
LEAST_TOUCHES = 5.0  # … and their least number in all photographs together
# A chance contact in a packing at rest is the same contact in all photographs. Where fewer are found in those between
# which the grains around rearrange (of 49 rods left out, two kinds, seeds 20, 42, 61 to 63: one), …
LEAST_REARRANGED = 4
FIRMLY_HELD = 1.5  # … the mean number must be that of several contacts at once
TOLERATED = 0.25  # fraction of photographs in which the rod may overlap another body
STARTS = 4  # photographs in which places are searched, evenly spaced
TRIED = 12  # trial radii where rods have no classes
PASSES = 6  # each with the rods of the one before
FEWEST_FRAMES, FEWEST_GRAINS = 3, 8


@dataclass(frozen=True, slots=True)
class UnseenRodSettings:
    """What is known of the rods."""

    noise: float  # [m] standard deviation of a position component
    sizes: Array | None = None  # (q,) [m] radii of the rods; None: any
    overlap: float = 0.0  # [m] mean overlap of touching grains where they are soft


@dataclass(frozen=True, slots=True)
class UnseenRods:
    """Inferred rods."""

    radius: Array  # (u,) [m]
    position: Array  # (f, u, 2) [m]
    sigma: Array  # (f, u) [m] standard deviation of a position component
    held: Array  # (u,) contacts beyond two, mean over photographs

    @property
    def count(self) -> int:
        return len(self.radius)


@dataclass(frozen=True, slots=True)
class _Tolerance:
    """Greatest gap and overlap [m] of a body that touches a rod."""

    apart: float
    deep: float  # overlapping
    exact: float  # apart, of hard grains


@dataclass(frozen=True, slots=True)
class _Rod:
    radius: float
    position: Array  # (f, 2)
    sigma: Array  # (f,)
    contacts: Array  # (f,) beyond two
    overlapping: float  # fraction of photographs

    @property
    def held(self) -> float:
        return float(self.contacts.mean())


def infer_unseen(
    radius: Array,
    position: Array,
    present: NDArray[np.bool_],
    endpoints: Array,
    settings: UnseenRodSettings,
    side: Sides = None,
) -> UnseenRods:
    """Infer the rods of a packing that no photograph shows.

    Parameters
    ----------
    radius : array (n,)
        Radii [m].
    position : array (f, n, 2)
        Centres [m].
    present : bool array (f, n)
        Whether each grain is present; grains missing in some photographs leave no lasting hole.
    endpoints : array (f, w, 2, 2)
        Ends of the walls [m].
    settings : UnseenRodSettings
        Noise, radius classes and overlap.
    side : array (w,), optional
        Which walls are circles.

    Returns
    -------
    UnseenRods
        None with fewer than three photographs, without walls, or where noise hides contacts.
    """
    noise, sizes, overlap = settings.noise, settings.sizes, settings.overlap
    shown = present.sum(axis=1) >= FEWEST_GRAINS  # without failed photographs
    position, present, endpoints = position[shown], present[shown], endpoints[shown]
    frames = len(position)
    rods: list[_Rod] = []
    if sizes is None:
        sizes = np.quantile(radius, np.linspace(0.0, 1.0, TRIED))
    exact = MISFIT * np.sqrt(2.0) * noise + SURFACE * float(radius.mean())
    tolerance = _Tolerance(exact + OVERLAPS * overlap, exact + DEEPEST * overlap, exact)
    # Soft rods are reduced by half the mean overlap, so that their gaps vary about zero.
    radius, sizes, noise = radius - 0.5 * overlap, sizes - 0.5 * overlap, float(np.hypot(noise, overlap / np.sqrt(2.0)))
    if frames >= FEWEST_FRAMES and endpoints.shape[1] and tolerance.apart < COARSE * float(np.min(sizes)):
        near: Array | None = None
        for _ in range(PASSES):
            around = Surroundings(*_with(radius, position, present, rods), endpoints, noise, side)
            new = _select_supported(around, _propose(around, sizes, near, tolerance), tolerance)
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
    """List all rods with at least three contacts in some photograph, tracked; near (f, q, 2): only around these."""
    proposed: list[_Rod] = []
    for k in even_subset(around.frame_count, STARTS).tolist():
        for size in sizes.tolist():
            for place in around.find_places(
                k, size, tolerance.apart, tolerance.deep, None if near is None else near[k]
            ):
                if not any(_is_at(each, k, place, size) for each in proposed):
                    proposed.append(_track(around, place, k, size, tolerance))
    return proposed


def _is_at(rod: _Rod, k: int, place: Array, size: float) -> bool:
    """Return whether a rod was tracked to this place."""
    return rod.radius == size and float(np.hypot(*(rod.position[k] - place))) < 0.02 * size


def _track(around: Surroundings, place: Array, k: int, size: float, tolerance: _Tolerance) -> _Rod:
    """Track a rod from its place in photograph k through all others."""
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
    return _Rod(size, position, sigma, np.maximum(held, 0.0), float(overlaps.mean()))


def _is_held_anew(around: Surroundings, rod: _Rod, tolerance: _Tolerance) -> bool:
    """Return whether a rod has enough contacts in the photographs between which the grains around it rearrange."""
    return bool(rod.contacts[around.find_changed(rod.position, tolerance.exact)].sum() >= LEAST_REARRANGED)


def _select_supported(around: Surroundings, proposed: list[_Rod], tolerance: _Tolerance) -> list[_Rod]:
    """Select rods with enough contacts, none of which overlaps one with more."""
    chosen: list[_Rod] = []
    least = max(LEAST_HELD, LEAST_TOUCHES / len(proposed[0].position)) if proposed else 0.0
    fit = [
        each for each in proposed
        if each.held >= least and each.overlapping <= TOLERATED
        and (each.held >= FIRMLY_HELD or _is_held_anew(around, each, tolerance))
    ]  # fmt: skip
    for rod in sorted(fit, key=lambda each: (-each.held, -each.radius)):
        free = True
        for other in chosen:
            apart = np.linalg.norm(rod.position - other.position, axis=1)
            together = apart < rod.radius + other.radius - tolerance.deep
            free &= together.mean() <= TOLERATED
        if free:
            chosen.append(rod)
    return chosen
