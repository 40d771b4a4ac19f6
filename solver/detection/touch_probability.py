"""Probability that two bodies touch, from their measured gaps in a window of photographs.

A single photograph cannot distinguish a contact from a gap smaller than the noise; a sequence can. Every candidate
pair is a hidden Markov chain: it touches or is open by one of a number of gaps, and between photographs its gap changes
by about the relative displacement of neighbours. The forward-backward smoother combines all photographs of the window.
Radii and centres must be free of constant errors, which are not noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..bodies.motion import Snapshot
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, detect_contacts, measure_contacts
from ..contacts.pairs import join_keys, split_keys
from ..part_settings import ContactProbabilitySettings
from .displacement import displacement_scale
from .touch_probability_kernels import CLOSES, DECAY, OPENS, STAYS_OPEN, smooth_candidates

OPEN_STATES = 48  # open gaps, spaced quadratically: finest near zero
STAY = 0.95  # probability that a contact persists over one interval
LIKELIHOOD_FLOOR = 1e-12  # of a measurement in any state, so that no single outlier decides
LOWEST_GAP = -5.0  # [σ_g] deeper overlaps are clipped to this one and never are outliers
FIRST_TOUCH = 0.5  # prior probability of touching
LEAST_SIGMA = 1e-6  # [mean radius] of a gap: below the resolution of any photograph
BACK, AHEAD = 4, 3  # frames of a window before and after its frame


@dataclass(frozen=True, slots=True)
class TouchCandidates:
    """Pairs that may touch in some frame of a window, ordered by key."""

    i: NDArray[np.int32]  # (c,)
    j: NDArray[np.int32]  # (c,) j >= number of grains is a wall
    gap: Array  # (f, c) [m] measured; NaN where a grain is missing
    sigma: Array  # (f, c) [m] standard deviation of the gap

    @property
    def count(self) -> int:
        return len(self.i)


@dataclass(frozen=True, slots=True)
class SmoothedGaps:
    """Posterior of the candidates' true gaps, given all photographs of a window."""

    touch: Array  # (f, c) P(touch)
    mean: Array  # (f, c) [m] of the true gap; NaN without measurements
    variance: Array  # (f, c) [m²] of the true gap


def window_of(frame: int, frame_count: int) -> range:
    """Return the frames k − BACK … k + AHEAD of the window of frame k, cut at the ends of the sequence."""
    return range(max(frame - BACK, 0), min(frame + AHEAD + 1, frame_count))


def probable_contacts(
    grains: Grains,
    window: Sequence[Snapshot],
    row: int,
    settings: ContactProbabilitySettings | None = None,
    *,
    frame: Snapshot | None = None,
) -> tuple[Contacts, Array]:
    """Find the pairs that probably touch in one frame of a window.

    Parameters
    ----------
    grains
        Grains with their radii.
    window
        Consecutive snapshots as measured.
    row
        The frame, counted in the window.
    settings
        Noise and selection; defaults where not given.
    frame
        The same snapshot with missing grains interpolated (`interpolate_lost_grains`); P(touch) of their pairs comes
        from the other photographs.

    Returns
    -------
    contacts
        Pairs with P(touch) above `settings.least`; those of a missing grain are omitted.
    touch : (c,)
        P(touch).
    """
    settings = settings or ContactProbabilitySettings()
    frame = window[row] if frame is None else frame
    position = np.stack([snapshot.position for snapshot in window])
    present = np.stack([snapshot.present for snapshot in window])
    sigma = np.repeat([[snapshot.sigma] for snapshot in window], grains.count, axis=1).astype(np.float64)
    walls = [snapshot.walls for snapshot in window]
    seen = np.where(present[:, :, None], position, np.nan)
    candidates = find_touch_candidates(grains, position, present, sigma, walls, settings)
    scale = np.array(
        [displacement_scale(seen[f], seen[f + 1], 0.5 * (sigma[f] + sigma[f + 1])) for f in range(len(window) - 1)]
    )
    touch = touch_probability(candidates.gap, candidates.sigma, scale, settings)[row]
    there = np.concatenate([frame.present, np.ones(walls[row].count, dtype=bool)])
    keep = (touch > settings.least) & there[candidates.i] & there[candidates.j]
    found = measure_contacts(grains, frame.position, walls[row], candidates.i[keep], candidates.j[keep])
    return found, touch[keep]


def find_touch_candidates(
    grains: Grains,
    position: Array,
    present: NDArray[np.bool_],
    sigma: Array,
    walls: Sequence[Walls],
    settings: ContactProbabilitySettings,
) -> TouchCandidates:
    """Find the pairs with a small gap in any frame of the window, and measure them in all frames.

    Parameters
    ----------
    grains
        Grains with their radii.
    position : (f, n, 2)
        Positions [m].
    present : (f, n) bool
        Grains seen in every frame.
    sigma : (f, n)
        Standard deviation of a position component [m].
    walls
        Walls of every frame.
    settings
        Noise and selection.
    """
    n = grains.count
    size = n + (walls[0].count if walls else 0)
    near = [
        detect_contacts(grains, position[f], present[f], walls[f], _reach(sigma[f][present[f]], settings))
        for f in range(len(position))
    ]
    i, j = (each.astype(np.int32) for each in split_keys(join_keys(*(contacts.key for contacts in near)), size))

    gap = np.empty((len(position), len(i)))
    gap_sd = np.empty_like(gap)
    wall = j >= n
    partner = np.where(wall, 0, j)
    for f in range(len(position)):
        gap[f] = measure_contacts(grains, np.where(present[f][:, None], position[f], np.nan), walls[f], i, j).gap
        variance = sigma[f] ** 2 + settings.radius_sd**2
        gap_sd[f] = np.sqrt(variance[i] + np.where(wall, 0.0, variance[partner]) + settings.overlap**2)
    gap_sd = np.maximum(gap_sd, LEAST_SIGMA * grains.radius.mean())
    return TouchCandidates(i, j, gap, gap_sd)


def touch_probability(
    gap: Array, sigma: Array, scale: Array, settings: ContactProbabilitySettings | None = None
) -> Array:
    """Return P(touch) of every candidate in every frame of the window (f, c); arguments as of `smooth_gaps`."""
    settings = settings or ContactProbabilitySettings()
    return smooth_gaps(gap, sigma, scale, settings).touch


def smooth_gaps(gap: Array, sigma: Array, scale: Array, settings: ContactProbabilitySettings) -> SmoothedGaps:
    """Compute P(touch) and the posterior of the true gaps from all photographs of a window.

    Parameters
    ----------
    gap : (f, c)
        Measured gaps [m], NaN where unknown.
    sigma : (f, c)
        Standard deviation of the measured gaps [m].
    scale : (f − 1,)
        Scale s of the relative displacement of neighbours in each interval [m].
    settings
        Overlap and selection.

    Raises
    ------
    ValueError
        A sigma of a known gap or a scale is not positive, or the number of scales is wrong.

    Notes
    -----
    Forward-backward smoother over a touching state (g = 0) and 48 open states g_q. Emission N(measured gap + overlap/2;
    g, σ_g), at least 1e-12. Transitions: touch → touch 0.95, touch → g ∝ exp(−g/s), g → g' Laplace(s),
    g → touch ½ exp(−g/s).
    """
    frames, candidates = gap.shape
    known = np.isfinite(gap)
    if scale.shape != (frames - 1,):
        raise ValueError(f"scale must hold one length per interval, ({frames - 1},), not {scale.shape}")
    if not np.all(sigma[known] > 0) or not np.all(scale > 0):
        raise ValueError("every sigma and every scale must be positive")
    touch = np.full((frames, candidates), FIRST_TOUCH)
    mean, variance = np.full((2, frames, candidates), np.nan)
    if not known.any():
        return SmoothedGaps(touch, mean, variance)
    widest = max(6.0 * float(scale.max(initial=0.0)), 12.0 * float(np.median(sigma[known])))
    state_gap, width = _states(widest)
    steps = [find_transition(state_gap, width, s) for s in scale]
    transition = np.stack(steps) if frames > 1 else np.empty((0, 4, len(width)))
    start = np.concatenate([[FIRST_TOUCH], (1.0 - FIRST_TOUCH) * width[1:] / width[1:].sum()])
    states = len(state_gap)
    smooth_candidates(
        gap + 0.5 * settings.overlap, sigma, LOWEST_GAP, state_gap, start,
        transition, width, STAY, LIKELIHOOD_FLOOR,
        np.empty((frames, states)), np.empty((frames, states)), np.empty((2, states)), np.empty((3, states)), touch,
        settings.overlap**2 + width**2 / 12.0, np.maximum(sigma**2 - settings.overlap**2, (1e-3 * sigma) ** 2),
        mean, variance,
    )  # fmt: skip
    return SmoothedGaps(touch, mean - 0.5 * settings.overlap, variance)


def _reach(sigma: Array, settings: ContactProbabilitySettings) -> float:
    widest = float(np.max(sigma, initial=0.0))
    # Part of the measured overlap is errors of the radii, which produce gaps equally often.
    return settings.reach * float(np.hypot(widest, settings.overlap / np.sqrt(2.0))) + (
        settings.margin + 3.0 * settings.radius_sd
    )


def _states(widest: float) -> tuple[Array, Array]:
    """Return the gaps of the states (q,) [m] and the widths of their intervals (q,) [m]; state 0 touches."""
    edge = widest * (np.arange(OPEN_STATES + 1) / OPEN_STATES) ** 2
    middle = widest * ((np.arange(OPEN_STATES) + 0.5) / OPEN_STATES) ** 2
    return np.concatenate([[0.0], middle]), np.concatenate([[0.0], np.diff(edge)])


def find_transition(state_gap: Array, width: Array, scale: float) -> Array:
    """Return the transition of one interval as rows (4, q) of the kernel; scale [m]: s of the Laplace law."""
    rows = np.zeros((4, len(state_gap)))
    rows[DECAY, 2:] = np.exp(-np.diff(state_gap[1:]) / scale)
    opened = np.exp(-(state_gap - state_gap[1])[1:] / scale) * width[1:]
    rows[OPENS, 1:] = (1.0 - STAY) * opened / opened.sum()
    # A gap that closes by more than its size touches: the mass of the Laplace law below zero.
    rows[CLOSES, 1:] = 0.5 * np.exp(-state_gap[1:] / scale)
    moved = np.exp(-np.abs(state_gap[1:, None] - state_gap[None, 1:]) / scale) * width[None, 1:]
    rows[STAYS_OPEN, 1:] = (1.0 - rows[CLOSES, 1:]) / moved.sum(axis=1)
    return rows
