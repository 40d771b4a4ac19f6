"""Nonlinear Gauss-Seidel: settings, one's hand on every sweep, and the solution.

`sweeps` is the method, driven by hand; `solve` runs it to an end that is a value with a sentence. Whoever listens
sets the strides of the compiled loop and what it measures on its way, and nothing else: with or without a listener
the forces are the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import repeat
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.nlgs.acceleration import PERIOD, Acceleration
from solver.nlgs.problem import ContactProblem, aligned_zeros
from solver.nlgs.sweeping.kernels import (
    advance,
    apply_forces,
    measure_forces,
    measure_natural_map,
    measure_state,
    measure_unbalance,
)
from solver.nlgs.sweeping.measured_sweeps import advance_and_measure, find_rest, rest_shape


@dataclass(frozen=True, slots=True)
class NlgsSettings:
    sweeps: int = 5000  # at most; in a kinematic chain, where more sweeps hurt, exactly
    force_change: float | None = None  # stop at the paper's ε_f
    natural_map: float | None = None  # stop at this relative residual
    relaxation: float = 1.0  # above 1 selects another solution
    acceleration: int = 0  # Anderson's window, 8 does well; for static loads alone; 0: plain sweeps

    def __post_init__(self) -> None:
        if self.sweeps < 0:
            raise ValueError("the number of sweeps cannot be negative")
        if not 0.0 < self.relaxation < 2.0:
            raise ValueError("the relaxation lies between 0 and 2")
        if self.acceleration < 0:
            raise ValueError("the window of the acceleration cannot be negative")


class Stop(Enum):
    """How a solve ended, as a sentence for the user."""

    NATURAL_MAP = "the natural-map residual fell below its stopping level"
    FORCE_CHANGE = "no contact force changed by more than ε_f of itself in a sweep"
    SWEEPS = "the stated number of sweeps was done; the residual reached is reported, convergence is not claimed"
    EMPTY = "there are no contacts"


class Sweep(NamedTuple):
    """The state after a sweep that is heard. `force` is live memory: copy what you keep."""

    number: int  # 1 … sweeps
    force: Float[Array, "c 2"]  # [N] in visiting order
    # Of the sweeps since the one heard before, this one last: greatest |Δf| / |f| in the sweep, relative
    # natural-map residual after it, worst |ΣF| on a grain / mean f_n. NaN where not measured; this sweep's always are.
    residuals: Float[Array, "s 3"]

    @property
    def force_change(self) -> float:
        return float(self.residuals[-1, 0])

    @property
    def natural_map(self) -> float:
        return float(self.residuals[-1, 1])

    @property
    def unbalance(self) -> float:
        return float(self.residuals[-1, 2])


@dataclass(frozen=True, slots=True)
class Solution:
    fn: Float[Array, " c"]  # [N] in the order of the contacts
    ft: Float[Array, " c"]  # [N]
    stop: Stop
    sweeps: int
    natural_map: float
    unbalance: float  # worst |ΣF| on a grain / mean f_n
    mean_unbalance: float  # mean |ΣF| on a grain / mean f_n

    @property
    def force(self) -> Array:
        """(f_n, f_t) in the order of the contacts (c, 2) [N]."""
        return np.column_stack([self.fn, self.ft])


def sweeps(
    problem: ContactProblem,
    settings: NlgsSettings,
    *,
    guess: Array | None = None,
    every: int | Iterable[int] = 1,
    measured: bool = False,
) -> Iterator[Sweep]:
    """Advance `every` sweeps at a time from a guess: without end, or by strides that come to one.

    guess (c, 2) [N], forces (f_n, f_t) in the order of the contacts; zero if absent. measured: the sweeps
    that are not heard are measured, too. With acceleration the forces take a step every
    PERIOD sweeps, heard or not.
    """
    force, body, plate = _start(problem, guess)
    rest, number = np.empty(rest_shape(len(body))), 0
    find_rest(problem, rest)

    def advance_by(rows: Array) -> None:
        if not measured:
            rows[:-1] = np.nan
            advance(problem, body, plate, force, len(rows) - 1, settings.relaxation)
            rows = rows[-1:]
        advance_and_measure(problem, body, plate, force, rest, settings.relaxation, rows)

    acceleration = Acceleration(problem, force, settings.acceleration) if settings.acceleration else None
    for stride in repeat(every) if isinstance(every, int) else every:
        residuals = np.empty((stride, 3))
        if acceleration is None and stride > 0:
            advance_by(residuals)
            number += stride
        row = 0 if acceleration else stride
        while acceleration and row < stride:
            if number % PERIOD == 0 and number > 0:
                acceleration.step(body, plate, force)
            part = residuals[row : row + PERIOD - number % PERIOD]
            advance_by(part)
            row, number = row + len(part), number + len(part)
            if number % PERIOD == 0 and acceleration.settle(body, plate, force):
                part[-1, 1:] = measure_state(problem, body, plate, force)
        yield Sweep(number, force, residuals)


def solve(
    problem: ContactProblem,
    settings: NlgsSettings,
    *,
    guess: Array | None = None,
    observer: Callable[[Sweep], None] | None = None,
    every: int | Iterable[int] = 1,
    measured: bool = False,
) -> Solution:
    """Sweep until a stopping level or the number of sweeps is reached.

    The observer hears a sweep every `every` sweeps, or after each of the given strides, and the last one; at these
    sweeps the stopping levels are looked at. measured: as for `sweeps`.
    """
    if len(problem.rows) == 0:
        return Solution(np.empty(0), np.empty(0), Stop.EMPTY, 0, 0.0, 0.0, 0.0)
    stopping = settings.natural_map is not None or settings.force_change is not None
    if observer is None and not stopping and settings.acceleration == 0:
        force, body, plate = _start(problem, guess)
        advance(problem, body, plate, force, settings.sweeps, settings.relaxation)
        return _finish(problem, force, Stop.SWEEPS, settings.sweeps)
    if observer is None and not stopping:
        every = max(1, settings.sweeps)
    strides = _strides(every, settings.sweeps)
    stop, number, force = Stop.SWEEPS, 0, _start(problem, guess)[0]
    for sweep in sweeps(problem, settings, guess=guess, every=strides, measured=measured):
        force, number = sweep.force, sweep.number
        if observer is not None:
            observer(sweep)
        if settings.natural_map is not None and sweep.natural_map <= settings.natural_map:
            stop = Stop.NATURAL_MAP
            break
        if settings.force_change is not None and sweep.force_change <= settings.force_change:
            stop = Stop.FORCE_CHANGE
            break
    return _finish(problem, force, stop, number)


def unbalance_of(problem: ContactProblem, force: Array) -> tuple[float, float]:
    """Worst and mean |ΣF| on a grain over the mean f_n, for forces (c, 2) [N] in the order of the contacts."""
    force, body, _ = _start(problem, force)
    _, _, mean = measure_forces(force, force)
    worst, mean_size = measure_unbalance(problem, body)
    return (worst / mean, mean_size / mean) if mean > 0 else (0.0, 0.0)


def to_contact_order(problem: ContactProblem, force: Array) -> Array:
    """Forces in visiting order (…, c, 2) to the order of the contacts."""
    result = np.empty_like(force)
    result[..., problem.rows, :] = force
    return result


def _strides(every: int | Iterable[int], total: int) -> Iterator[int]:
    """Strides that end at a number of sweeps."""
    left = total
    for stride in repeat(every) if isinstance(every, int) else every:
        if left == 0:
            return
        yield min(stride, left)
        left -= min(stride, left)
    if left > 0:
        yield left


def _start(problem: ContactProblem, guess: Array | None) -> tuple[Array, Array, Array]:
    force, body = aligned_zeros((len(problem.rows), 2)), aligned_zeros(problem.body.shape)
    if guess is not None:
        force[:] = guess[problem.rows]
    plate = np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)
    return force, body, plate


def _finish(problem: ContactProblem, force: Array, stop: Stop, number: int) -> Solution:
    body, plate = np.empty_like(problem.body), np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)  # anew, so that rounding of many sweeps is not taken for balance
    _, norm, mean = measure_forces(force, force)
    worst, mean_size = measure_unbalance(problem, body)
    ordered = to_contact_order(problem, force)
    scale = 1.0 / mean if mean > 0 else 0.0
    return Solution(
        ordered[:, 0].copy(),
        ordered[:, 1].copy(),
        stop,
        number,
        measure_natural_map(problem, body, plate, force, norm),
        worst * scale,
        mean_size * scale,
    )
