"""Rods that no photograph shows, inferred from holes of the packing and from neighbours that would hold them.

A rod that bears force is held by its neighbours: with the right radius it touches at least three of them at once, in
every photograph, which a rod of another radius or at another place does only by chance: the chance counts once while
the packing around stays as it is. Such places are searched in every hole, tracked with the motion of their neighbours,
and accepted one after the other, those with most contacts first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import Sides
from ..even_subset import even_subset
from .surroundings import Surroundings, gaps

MISFIT = 5.0  # standard deviations of a gap: tolerance of contact with the rod …
COARSE = 0.3  # of a radius: with a larger tolerance contacts cannot be detected
SURFACE = 1e-3  # … plus this fraction of its radius …
OVERLAPS = 2.0  # … plus, for soft grains, mean overlaps, which are distributed nearly as exp(−δ / ⟨δ⟩) …
DEEPEST = 5.0  # … mean overlaps in the strongest contacts
TOUCHES_FREE = 2  # bodies that any rod can touch by its choice of place
LEAST_HELD = 0.45  # mean number of further contacts per photograph that is significant …
LEAST_TOUCHES = 5.0  # … and their least number in all photographs together
# A chance contact in a packing at rest is the same contact in all photographs. Where fewer are found in those between
# which the bodies that touch rearrange, …
LEAST_REARRANGED = 4
ALWAYS_HELD, LEAST_REARRANGED_HELD = 1.0, 3  # … or where a further one is there on average, …
FIRMLY_HELD = 1.5  # … the mean number must be that of several contacts at once
# Standard deviations of a gap that the bodies which touch a rod leave: of 61 rods left out of eight packings (seeds 20,
# 22, 42, 43) 60 leave less; a natural pore that moves with its neighbours leaves 2.6 to 4.6.
GAP_MISFIT = 2.4
TOLERATED = 0.25  # fraction of photographs in which the rod may overlap another body
STARTS = 4  # photographs in which places are searched, evenly spaced
# A size that is unknown is chosen so that three bodies touch. Bodies that a rod holds apart agree on it to SIZE_MISFIT
# standard deviations, in photographs between which these bodies move by MOVED_APART tolerances (45 false and 86 true
# rods of four kinds, 200 rods, seeds 20 and 22: all but 2 of the false ones are left out, and 5 of the true ones).
SIZE_MISFIT, MOVED_APART = 1.9, 2.0
BEYOND_SIZES = 0.02  # by which an unseen rod of unknown size may be smaller or larger than all others
LEAST_FOLLOWED = 0.25  # mean number of further contacts from which on the unknown size of a rod is fitted
LEAST_FREE = 0.5  # mean number of free grains that touch a rod: between walls and boundary alone it holds nothing
PASSES = 6  # each with the rods of the one before
FEWEST_FRAMES, FEWEST_GRAINS = 3, 8


@dataclass(frozen=True, slots=True)
class UnseenRodSettings:
    """What is known of the rods."""

    noise: float  # [m] standard deviation of a position component
    sizes: Array | None = None  # (q,) [m] radii of the rods; None: any
    overlap: float = 0.0  # [m] mean overlap of touching grains where they are soft
    boundary: NDArray[np.bool_] | None = None  # (n,) grains whose motion is imposed; None: none


@dataclass(frozen=True, slots=True)
class UnseenRods:
    """Inferred rods."""

    radius: Array  # (u,) [m]
    position: Array  # (f, u, 2) [m]
    sigma: Array  # (f, u) [m] standard deviation of a position component
    held: Array  # (u,) contacts beyond two, mean over photographs
    sought: bool  # False: too few photographs, no walls, or noise hides contacts

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
    of_known_size: bool = True

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
    exact = MISFIT * np.sqrt(2.0) * noise + SURFACE * float(radius.mean())
    tolerance = _Tolerance(exact + OVERLAPS * overlap, exact + DEEPEST * overlap, exact)
    # Soft rods are reduced by half the mean overlap, so that their gaps vary about zero.
    radius, noise = radius - 0.5 * overlap, float(np.hypot(noise, overlap / np.sqrt(2.0)))
    known = None if sizes is None else sizes - 0.5 * overlap
    possible = radius if known is None else known
    limits = float(possible.min()), float(possible.max())
    sought = frames >= FEWEST_FRAMES and endpoints.shape[1] > 0 and tolerance.apart < COARSE * limits[0]
    if sought:
        near: Array | None = None
        free = np.ones(len(radius), np.bool_) if settings.boundary is None else ~settings.boundary

        def surround(rods: list[_Rod]) -> Surroundings:
            every = np.append(free, np.ones(len(rods), np.bool_))
            return Surroundings(*_with(radius, position, present, rods), endpoints, noise, side, every)

        left: list[_Rod] = []
        for _ in range(PASSES):
            around = surround(rods)
            if known is None:
                proposed = _propose_of_any_size(around, limits, near, tolerance)
            else:
                proposed = _propose(around, known, near, tolerance)
            left += proposed
            new = _select_supported(around, proposed, tolerance)
            if not new:
                new = _select_pair(surround, rods, left, tolerance)
            if not new:
                break
            rods += new
            near = np.stack([each.position for each in new], axis=1)
    if not rods:
        return UnseenRods(np.empty(0), np.empty((len(shown), 0, 2)), np.empty((len(shown), 0)), np.empty(0), sought)
    place, sigma = np.full((len(shown), len(rods), 2), np.nan), np.full((len(shown), len(rods)), np.nan)
    place[shown] = np.stack([each.position for each in rods], axis=1)
    sigma[shown] = np.stack([each.sigma for each in rods], axis=1)
    found = np.array([each.radius for each in rods]) + 0.5 * overlap
    return UnseenRods(found, place, sigma, np.array([each.held for each in rods]), sought)


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


def _propose_of_any_size(
    around: Surroundings, limits: tuple[float, float], near: Array | None, tolerance: _Tolerance
) -> list[_Rod]:
    """List rods of unknown size between limits [m], as `_propose`; three bodies determine the size of each.

    One contact less counts, as the size was chosen by it.
    """
    sizes = (1.0 - BEYOND_SIZES) * limits[0], (1.0 + BEYOND_SIZES) * limits[1]
    proposed: list[_Rod] = []
    for k in even_subset(around.frame_count, STARTS).tolist():
        for place, size in around.find_circles(k, sizes, tolerance.deep, None if near is None else near[k]):
            if any(_is_at(each, k, place, size, tolerance.apart) for each in proposed):
                continue
            rod = _track(around, place, k, size, tolerance)
            if rod.held < LEAST_FOLLOWED or rod.overlapping > TOLERATED:
                continue
            rod = _track(around, rod.position[k], k, _fit_size(around, rod, tolerance)[0], tolerance)
            if rod.overlapping > TOLERATED:
                continue
            contacts = rod.contacts.copy()
            contacts[k] = max(contacts[k] - 1.0, 0.0)
            proposed.append(replace(rod, contacts=contacts, of_known_size=False))
    return proposed


def _fit_size(around: Surroundings, rod: _Rod, tolerance: _Tolerance) -> tuple[float, float]:
    """Fit the radius [m] of a tracked rod to its contacts in all photographs: a weighted mean near the median.

    Also return by how much photographs differ from it, in terms of a gap [m].
    """
    found = [around.fit_size(place, k, rod.radius, tolerance.apart) for k, place in enumerate(rod.position)]
    size, weight = np.array(found).T
    if not weight.any():
        return rod.radius, np.inf
    order = np.argsort(size)
    middle = size[order][np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum())]
    near = np.abs(size - middle) < tolerance.apart
    mean = float(np.average(size[near], weights=weight[near]))
    shown = weight > 0.0
    return mean, float(np.sqrt(np.mean(weight[shown] * (size[shown] - mean) ** 2)))


def _is_at(rod: _Rod, k: int, place: Array, size: float, within: float = 0.0) -> bool:
    """Return whether a rod of this size, within a difference [m], was tracked to this place."""
    return abs(rod.radius - size) <= within and float(np.hypot(*(rod.position[k] - place))) < 0.02 * size + within


def _track(around: Surroundings, place: Array, k: int, size: float, tolerance: _Tolerance) -> _Rod:
    """Track a rod from its place in photograph k through all others, or until it overlaps others too often."""
    frames = around.frame_count
    position, sigma = np.full((frames, 2), np.nan), np.full(frames, np.nan)
    held, overlaps = np.zeros(frames), np.zeros(frames, bool)
    later, earlier = [(to, to - 1) for to in range(k + 1, frames)], [(to, to + 1) for to in range(k - 1, -1, -1)]
    for to, since in [(k, k), *later, *earlier]:
        start = place if to == k else around.carry(position[since], since, to)
        bodies = around.bodies(start, to, size)
        position[to], sigma[to] = around.hold(bodies, start, size)
        gap = gaps(bodies, position[to], size)
        held[to] = np.count_nonzero((gap < tolerance.apart) & (gap > -tolerance.deep)) - TOUCHES_FREE
        overlaps[to] = gap.min(initial=np.inf) < -tolerance.deep
        if overlaps.mean() > TOLERATED:
            break
    return _Rod(size, position, sigma, np.maximum(held, 0.0), float(overlaps.mean()))


def _is_held_anew(around: Surroundings, rod: _Rod, tolerance: _Tolerance) -> bool:
    """Return whether a rod has enough contacts in the photographs between which the bodies around it rearrange."""
    within = (tolerance.deep, tolerance.apart)
    least = tolerance.exact if rod.of_known_size else MOVED_APART * tolerance.exact
    anew = around.count_rearranged(rod.position, rod.radius, within, least)
    if rod.of_known_size:
        return anew >= (LEAST_REARRANGED_HELD if rod.held >= ALWAYS_HELD else LEAST_REARRANGED)
    misfit = _fit_size(around, rod, tolerance)[1]
    return anew >= LEAST_REARRANGED and misfit <= SIZE_MISFIT * np.sqrt(2.0) * around.noise


def _gap_misfit(around: Surroundings, rod: _Rod, tolerance: _Tolerance) -> float:
    """Root mean square [m] of the gaps to bodies that touch a rod, beyond the two that any place can touch.

    0 of soft grains: the gaps of rods that bear forces are overlaps of all sizes.
    """
    if tolerance.deep > tolerance.exact:
        return 0.0
    square: list[float] = []
    for k, place in enumerate(rod.position):
        gap = gaps(around.bodies(place, k, rod.radius), place, rod.radius)
        touching = gap[np.abs(gap) < tolerance.apart]
        if len(touching) > TOUCHES_FREE:
            square.append(float((touching**2).sum()) / (len(touching) - TOUCHES_FREE))
    return float(np.sqrt(np.mean(square))) if square else 0.0


def _is_supported(around: Surroundings, rod: _Rod, tolerance: _Tolerance) -> bool:
    """Return whether a rod overlaps no other, and has contacts enough that chance does not explain."""
    return bool(
        rod.held >= max(LEAST_HELD, LEAST_TOUCHES / around.frame_count)
        and rod.overlapping <= TOLERATED
        and around.count_free(rod.position, rod.radius, (tolerance.deep, tolerance.apart)) >= LEAST_FREE
        and (rod.held >= FIRMLY_HELD or _is_held_anew(around, rod, tolerance))
        and _gap_misfit(around, rod, tolerance) <= GAP_MISFIT * np.sqrt(2.0) * around.noise
    )


def _select_pair(
    surround: Callable[[list[_Rod]], Surroundings], rods: list[_Rod], proposed: list[_Rod], tolerance: _Tolerance
) -> list[_Rod]:
    """Select two rods that touch each other and are supported together, but not by the known bodies alone.

    Of several pairs the one with most contacts is selected.
    """
    left: list[_Rod] = []
    for rod in sorted(proposed, key=lambda each: -each.held):
        new = not any(_is_at(each, 0, rod.position[0], rod.radius, tolerance.apart) for each in left)
        if new and rod.overlapping <= TOLERATED and all(_are_apart(rod, each, tolerance) for each in rods):
            left.append(rod)
    best: list[_Rod] = []
    for one, two in combinations(left, 2):
        gap = np.linalg.norm(one.position - two.position, axis=1) - one.radius - two.radius
        if np.median(np.abs(gap)) > tolerance.deep:
            continue
        beside_two = surround([*rods, two])
        first = _track(beside_two, one.position[0], 0, one.radius, tolerance)
        if first.overlapping > TOLERATED:
            continue
        beside_first = surround([*rods, first])
        second = _track(beside_first, two.position[0], 0, two.radius, tolerance)
        supported = _is_supported(beside_two, first, tolerance) and _is_supported(beside_first, second, tolerance)
        if supported and first.held + second.held > sum(each.held for each in best):
            best = [first, second]
    return best


def _are_apart(one: _Rod, other: _Rod, tolerance: _Tolerance) -> bool:
    """Return whether two rods can be there at once."""
    distance = np.linalg.norm(one.position - other.position, axis=1)
    together = distance < one.radius + other.radius - tolerance.deep
    return bool(together.mean() <= TOLERATED)


def _select_supported(around: Surroundings, proposed: list[_Rod], tolerance: _Tolerance) -> list[_Rod]:
    """Select rods with enough contacts, none of which overlaps one with more."""
    chosen: list[_Rod] = []
    fit = [each for each in proposed if _is_supported(around, each, tolerance)]
    for rod in sorted(fit, key=lambda each: (-each.held, -each.radius)):
        if all(_are_apart(rod, each, tolerance) for each in chosen):
            chosen.append(rod)
    return chosen
