"""Probability that two bodies touch, from their measured gaps in a window of photographs.

A single photograph cannot tell a contact from a gap smaller than its noise; a history can. Every
candidate pair is a hidden Markov chain: it touches, or it is open by one of a few gaps, and
from one photograph to the next it moves by about as much as neighbours do. The forward-backward
smoother then weighs all photographs of the window together. Radii and centres must be free of constant errors:
an error that stays is not noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, detect_contacts, measure_contacts
from solver.contacts.pairs import join_keys, split_keys
from solver.detection.displacement import displacement_scale
from solver.detection.touch_probability_kernels import CLOSES, DECAY, OPENS, SPREADS, smooth_candidates

OPEN_STATES = 48  # open gaps, spaced quadratically: fine where touching is decided
STAY = 0.95  # probability that a contact lasts one interval
LIKELIHOOD_FLOOR = 1e-12  # of a measurement in any state: no single outlier decides
LOWEST_GAP = -5.0  # [σ_g] a deeper overlap says no more than this one: it is clipped, never an outlier
FIRST_TOUCH = 0.5  # probability of touching before anything is measured
LEAST_SIGMA = 1e-6  # [mean radius] of a gap: less than any photograph can show
BACK, AHEAD = 4, 3  # frames of a window before and after its own


@dataclass(frozen=True, slots=True)
class ContactProbabilitySettings:
    """What the measured gaps are worth."""

    overlap: float = 0.0  # [m] typical elastic overlap of a contact that bears force
    radius_sd: float = 0.0  # [m] standard deviation of a grain's radius
    margin: float = 20e-6  # [m] a pair beyond margin + reach · σ (overlap, 3 radius_sd) in every frame is out
    reach: float = 6.0  # [σ]
    least: float = 3e-3  # a pair with less probability is dropped

    def __post_init__(self) -> None:
        if min(self.overlap, self.radius_sd, self.margin, self.reach, self.least) < 0:
            raise ValueError("no contact probability setting may be negative")


@dataclass(frozen=True, slots=True)
class Candidates:
    """Pairs that might touch in some frame of a window, ordered by key."""

    i: NDArray[np.int32]  # (c,)
    j: NDArray[np.int32]  # (c,) j >= number of grains is a wall
    gap: Array  # (f, c) [m] measured; NaN where a grain is missing
    sigma: Array  # (f, c) [m] standard deviation of the gap

    @property
    def count(self) -> int:
        return len(self.i)


@dataclass(frozen=True, slots=True)
class SmoothedGaps:
    """What a window of photographs makes of its candidates."""

    touch: Array  # (f, c) P(touch)
    mean: Array  # (f, c) [m] of the true gap; NaN where nothing is known
    variance: Array  # (f, c) [m²] of the true gap


def window_of(frame: int, frame_count: int) -> range:
    """Give the frames whose photographs decide about a frame: k − 4 … k + 3, cut at the ends."""
    return range(max(frame - BACK, 0), min(frame + AHEAD + 1, frame_count))


def probable_contacts(
    grains: Grains,
    window: Sequence[Snapshot],
    row: int,
    settings: ContactProbabilitySettings | None = None,
    *,
    frame: Snapshot | None = None,
) -> tuple[Contacts, Array]:
    """Find the pairs that probably touch in one frame of a window, with their P(touch) (c,).

    window: consecutive snapshots, as measured; row: the frame asked about, counted in the window. Pairs below
    `settings.least` and pairs of a missing grain are left out. `frame`: the same snapshot with stand-ins for
    missing grains (`bridge_lost`); their pairs are then judged by the other photographs and measured here.
    """
    settings = settings or ContactProbabilitySettings()
    frame = window[row] if frame is None else frame
    position = np.stack([snapshot.position for snapshot in window])
    present = np.stack([snapshot.present for snapshot in window])
    sigma = np.repeat([[snapshot.sigma] for snapshot in window], grains.count, axis=1).astype(np.float64)
    walls = [snapshot.walls for snapshot in window]
    seen = np.where(present[:, :, None], position, np.nan)
    candidates = find_candidates(grains, position, present, sigma, walls, settings)
    scale = np.array(
        [displacement_scale(seen[f], seen[f + 1], 0.5 * (sigma[f] + sigma[f + 1])) for f in range(len(window) - 1)]
    )
    touch = touch_probability(candidates.gap, candidates.sigma, scale, settings)[row]
    there = np.concatenate([frame.present, np.ones(walls[row].count, dtype=bool)])
    keep = (touch > settings.least) & there[candidates.i] & there[candidates.j]
    found = measure_contacts(grains, frame.position, walls[row], candidates.i[keep], candidates.j[keep])
    return found, touch[keep]


def find_candidates(
    grains: Grains,
    position: Array,
    present: NDArray[np.bool_],
    sigma: Array,
    walls: Sequence[Walls],
    settings: ContactProbabilitySettings,
) -> Candidates:
    """Find the pairs that come near each other in any frame of the window, and measure them in all.

    position (f, n, 2) [m]; present (f, n); sigma (f, n) [m], standard deviation of a position component;
    walls: f of them.
    """
    n = grains.count
    size = n + (walls[0].count if walls else 0)
    near = [
        detect_contacts(grains, position[f], present[f], walls[f], _reach(sigma[f][present[f]], settings))
        for f in range(len(position))
    ]
    i, j = (each.astype(np.int32) for each in split_keys(join_keys(*(contacts.key for contacts in near)), size))

    gap = np.empty((len(position), len(i)))
    deviation = np.empty_like(gap)
    wall = j >= n
    partner = np.where(wall, 0, j)
    for f in range(len(position)):
        gap[f] = measure_contacts(grains, np.where(present[f][:, None], position[f], np.nan), walls[f], i, j).gap
        variance = sigma[f] ** 2 + settings.radius_sd**2
        deviation[f] = np.sqrt(variance[i] + np.where(wall, 0.0, variance[partner]) + settings.overlap**2)
    deviation = np.maximum(deviation, LEAST_SIGMA * grains.radius.mean())
    return Candidates(i, j, gap, deviation)


def touch_probability(
    gap: Array, sigma: Array, scale: Array, settings: ContactProbabilitySettings | None = None
) -> Array:
    """Give P(touch) of every candidate in every frame of the window (f, c).

    gap (f, c) [m] as measured, NaN where unknown; sigma (f, c) [m], its standard deviation; scale (f − 1,) [m], the
    typical relative displacement of neighbours in each interval. Errors: ValueError where a sigma of a known
    gap or a scale is not positive.
    """
    settings = settings or ContactProbabilitySettings()
    return smooth_gaps(gap, sigma, scale, settings).touch


def smooth_gaps(gap: Array, sigma: Array, scale: Array, settings: ContactProbabilitySettings) -> SmoothedGaps:
    """Weigh all photographs of a window together: P(touch), and what they make of the true gaps.

    Arguments and errors as of `touch_probability`.
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
    # Part of what is measured as overlap are errors of radii, which leave gaps as often.
    return settings.reach * float(np.hypot(widest, settings.overlap / np.sqrt(2.0))) + (
        settings.margin + 3.0 * settings.radius_sd
    )


def _states(widest: float) -> tuple[Array, Array]:
    """Gaps of the states (q,) [m] and the width of the interval each stands for (q,) [m]; state 0 touches."""
    edge = widest * (np.arange(OPEN_STATES + 1) / OPEN_STATES) ** 2
    middle = widest * ((np.arange(OPEN_STATES) + 0.5) / OPEN_STATES) ** 2
    return np.concatenate([[0.0], middle]), np.concatenate([[0.0], np.diff(edge)])


def find_transition(state_gap: Array, width: Array, scale: float) -> Array:
    """How states follow one another in one interval, in rows (4, q) as the kernel reads them."""
    rows = np.zeros((4, len(state_gap)))
    rows[DECAY, 2:] = np.exp(-np.diff(state_gap[1:]) / scale)
    opened = np.exp(-(state_gap - state_gap[1])[1:] / scale) * width[1:]
    rows[OPENS, 1:] = (1.0 - STAY) * opened / opened.sum()
    # A gap that would close by more than itself touches: the Laplace law's mass below zero.
    rows[CLOSES, 1:] = 0.5 * np.exp(-state_gap[1:] / scale)
    moved = np.exp(-np.abs(state_gap[1:, None] - state_gap[None, 1:]) / scale) * width[None, 1:]
    rows[SPREADS, 1:] = (1.0 - rows[CLOSES, 1:]) / moved.sum(axis=1)
    return rows
