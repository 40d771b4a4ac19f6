"""The coefficient of friction, measured from the motion: the one that leaves the least power unexplained.

Where bodies slide, friction works at its limit against the sliding. With a coefficient that is too low, force sets in
equilibrium need friction that does not oppose the measured sliding; with one that is too high they cannot bring
friction to its limit. The relative power gap of a convex member is least near the true coefficient, on simulated
packings 0-12 % below it for coefficients of 0.15 and 0.25, 11-20 % below it for 0.4: a check on an
assumed coefficient, no replacement of a tilt test. The spread over frames does not contain this bias.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.convex.program import Balance, ConvexSettings, solve_member
from solver.nlgs.warm_start import ForceMemory
from solver.together import work_together

FACTORS = (0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 1.0, 1.06, 1.14, 1.25, 1.45, 1.7, 2.0)  # of the assumed coefficient
SIDE = 2  # trials that are wanted on either side of the least gap


@dataclass(frozen=True, slots=True)
class SlidingFrame:
    """What a convex member reads at one frame."""

    balance: Balance  # with the assumed friction
    contacts: Contacts
    slip: Array  # (c,) of `soft_slip`
    probability: Array  # (c,) P(touch)


@dataclass(frozen=True, slots=True)
class FrictionEstimate:
    """The factor by which the assumed friction is to be multiplied, and how it was found."""

    factor: float
    factor_sd: float  # spread of the estimate over the frames, jackknife; NaN with fewer than three frames
    trial: Array  # (q,) factors tried, ascending
    gap: Array  # (q,) relative power gap, mean over the frames
    enclosed: bool  # False: the least gap is at the first or last trial: the friction lies beyond, or nothing slides


def relative_power_gap(slip: Array, friction: Array, fn: Array, ft: Array) -> float:
    """Give 1 + Σ f_t û_t / Σ μ f_n |û_t|: 0 if all friction works at its limit against the sliding, 1 if none does.

    slip (c,), of `soft_slip`; friction (c,); fn, ft (c,) [N]. NaN where nothing slides under force.
    """
    possible = float(np.sum(friction * fn * np.abs(slip)))
    return 1.0 + float(np.sum(ft * slip)) / possible if possible > 0 else np.nan


def estimate_friction(
    frames: Sequence[SlidingFrame],
    factors: Sequence[float] = FACTORS,
    settings: ConvexSettings | None = None,
    *,
    of_walls: bool = False,
    workers: int | None = 1,
) -> FrictionEstimate:
    """Find the friction that explains the sliding of consecutive frames best, as a factor on the assumed one.

    Friction between grains and with walls is changed by the same factor (those with walls must not be zero); of_walls:
    that with walls alone, that between grains being known. Each
    trial is a chain of its own through the frames; of the factors only those about the valley that is met from the
    one nearest to 1 are tried. workers: threads that try them; no bit depends on it.
    Errors: ValueError without frames or with fewer than three factors.
    """
    trial = np.sort(np.asarray(factors, dtype=np.float64))
    if not len(frames) or len(trial) < 3:
        raise ValueError("friction needs at least one frame and three trial factors")
    trial, gap = _walk_into_valley(
        trial, lambda factor: np.array(_gaps_of_a_chain(frames, factor, settings, of_walls)), workers
    )
    gap = gap[np.isfinite(gap).all(axis=1)]
    if not len(gap):
        return FrictionEstimate(np.nan, np.nan, trial, np.full(len(trial), np.nan), False)
    factor, enclosed = _least(trial, gap.mean(axis=0))
    return FrictionEstimate(factor, _jackknife(trial, gap), trial, gap.mean(axis=0), enclosed)


def _walk_into_valley(trial: Array, gaps_of: Callable[[float], Array], workers: int | None = 1) -> tuple[Array, Array]:
    """Try neighbour after neighbour until two lie on either side of the least gap, whichever frame is left out.

    trial (q,), ascending; gaps_of a factor: those of all frames (f,). The factors tried (p,), and their gaps (f, p).
    """
    first = last = int(np.argmin(np.abs(np.log(trial))))
    # These are asked for in nearly every walk, which begins downwards: side by side.
    sure = [q for q in (first, first - 1, first - 2, first + 1) if 0 <= q < len(trial)]
    known = dict(zip(sure, work_together([partial(gaps_of, float(trial[q])) for q in sure], workers), strict=True))

    def gaps_at(q: int) -> Array:
        return known[q] if q in known else gaps_of(float(trial[q]))

    gap = gaps_at(first)[:, None]
    while True:
        finite = gap[np.isfinite(gap).all(axis=1)]
        if not len(finite):
            break
        least = first + np.argmin([finite.mean(axis=0), *_means_without_one(finite)], axis=1)
        if first > max(int(least.min()) - SIDE, 0):
            first -= 1
            gap = np.column_stack([gaps_at(first), gap])
        elif last < min(int(least.max()) + SIDE, len(trial) - 1):
            last += 1
            gap = np.column_stack([gap, gaps_at(last)])
        else:
            break
    return trial[first : last + 1], gap


def _gaps_of_a_chain(
    frames: Sequence[SlidingFrame], factor: float, settings: ConvexSettings | None, of_walls: bool
) -> list[float]:
    memory = ForceMemory.empty()
    gaps = []
    for frame in frames:
        tried = np.where(frame.contacts.with_wall | (not of_walls), factor, 1.0)
        balance = replace(frame.balance, friction=tried * frame.balance.friction)
        former = memory.recall(frame.contacts)
        forces = solve_member(balance, frame.slip, frame.probability, former[:, 0], former[:, 1], settings)
        everyone = np.ones(frame.contacts.grain_count, dtype=bool)
        memory = memory.renew(frame.contacts, np.column_stack([forces.fn, forces.ft]), everyone)
        gaps.append(relative_power_gap(frame.slip, balance.friction, forces.fn, forces.ft))
    return gaps


def _least(trial: Array, gap: Array) -> tuple[float, bool]:
    """Minimum of the parabola through the least gap and its two neighbours, in the logarithm of the factor."""
    q = int(np.argmin(gap))
    if q in (0, len(trial) - 1):
        return float(trial[q]), False
    x, y = np.log(trial[q - 1 : q + 2]), gap[q - 1 : q + 2]
    left, right = (y[1] - y[0]) / (x[1] - x[0]), (y[2] - y[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if curvature <= 0:
        return float(trial[q]), True
    return float(np.exp(0.5 * (x[0] + x[1]) - 0.5 * left / curvature)), True


def _jackknife(trial: Array, gap: Array) -> float:
    count = len(gap)
    if count < 3:
        return np.nan
    without = [_least(trial, mean)[0] for mean in _means_without_one(gap)]
    return float(np.sqrt((count - 1) * np.var(without)))


def _means_without_one(gap: Array) -> list[Array]:
    """Mean gap of every trial (q,) without the first frame, without the second, …; none of fewer than three frames."""
    return [np.delete(gap, f, axis=0).mean(axis=0) for f in range(len(gap))] if len(gap) > 2 else []
