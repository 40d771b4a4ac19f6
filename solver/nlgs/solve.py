"""Nonlinear Gauss-Seidel: settings, iteration by sweeps, and the solution.

`sweeps` iterates under the control of the caller; `solve` runs it until a stopping criterion. An observer sets only the
strides of the compiled loop and the sweeps that are measured: the forces are bit-identical with and without it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import repeat
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from .acceleration import PERIOD, Acceleration
from .problem import ContactProblem, aligned_zeros
from .sweeping.kernels import (
    advance,
    apply_forces,
    measure_force_residual,
    measure_forces,
    measure_natural_map,
    measure_state,
)
from .sweeping.measured_sweeps import advance_and_measure, advance_and_sample, equilibrium_shape, find_equilibrium


@dataclass(frozen=True, slots=True)
class NlgsSettings:
    """Settings of a nonlinear Gauss-Seidel solve."""

    sweeps: int = (
        5000  # greatest number of sweeps; exact number in a kinematic chain, where more sweeps worsen the forces
    )
    force_change: float | None = None  # stopping level of the paper's ε_f
    natural_map: float | None = None  # stopping level of the relative natural-map residual
    relaxation: float = 1.0  # above 1 selects another solution
    acceleration: int = (
        0  # window of the Anderson acceleration, for static loads only (8 is a good value); 0: plain sweeps
    )

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
    """The state after an observed sweep. `force` is the working array of the solver: copy it to keep it."""

    number: int  # 1 … sweeps
    force: Float[Array, "c 2"]  # [N] in visiting order
    # Of the sweeps since the previous observed one, this one last: greatest |Δf| / |f| in the sweep, relative
    # natural-map residual after it, worst |ΣF| on a grain / mean f_n. NaN where not measured; this sweep always is.
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
    """Forces of a solve with their residuals."""

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
    measured: int = 0,
) -> Iterator[Sweep]:
    """Iterate over sweeps from a guess.

    Parameters
    ----------
    guess : (c, 2), optional
        Forces (f_n, f_t) in the order of the contacts [N]; zero if absent.
    every : int or iterable of int
        Sweeps per compiled call: one number for an endless iteration, or the successive strides.
    measured : int
        Measure also one in so many of the sweeps between the observed ones; 0: none.

    Yields
    ------
    Sweep
        The state after each stride.

    Notes
    -----
    With acceleration the forces take an Anderson step every PERIOD sweeps, whatever the strides.
    """
    force, body, plate = _start(problem, guess)
    equilibrium, number = np.empty(equilibrium_shape(len(body))), 0
    find_equilibrium(problem, equilibrium)

    def advance_by(rows: Array) -> None:
        if measured == 1:
            advance_and_measure(problem, body, plate, force, equilibrium, settings.relaxation, rows)
        else:
            spacing = measured or len(rows)
            advance_and_sample(problem, body, plate, force, equilibrium, settings.relaxation, rows, spacing)

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
            if number % PERIOD == 0 and acceleration.accept_or_undo(body, plate, force):
                part[-1, 1:] = measure_state(problem, body, plate, force)
        yield Sweep(number, force, residuals)


def solve(
    problem: ContactProblem,
    settings: NlgsSettings,
    *,
    guess: Array | None = None,
    observer: Callable[[Sweep], None] | None = None,
    every: int | Iterable[int] = 1,
    measured: int = 0,
) -> Solution:
    """Sweep until a stopping level or the number of sweeps is reached.

    Parameters
    ----------
    guess : (c, 2), optional
        Forces (f_n, f_t) in the order of the contacts [N]; zero if absent.
    observer : callable, optional
        Called with a `Sweep` after every stride and after the last sweep.
    every : int or iterable of int
        Sweeps per stride, or the successive strides. Stopping levels are checked after each stride.
    measured : int
        Measure also one in so many of the sweeps between the observed ones; 0: none.
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
    stop, number, force = Stop.SWEEPS, 0, None
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
    if force is None:  # no sweep was requested
        force = _start(problem, guess)[0]
    return _finish(problem, force, stop, number)


def velocity_change(problem: ContactProblem, force: Array) -> Array:
    """Compute how forces (c, 2) [N] in the order of the contacts change the velocities vx, vy, ω R (n, 3) [m/s]."""
    return (_start(problem, force)[1] - problem.body)[:, :3]


def relative_force_residual(problem: ContactProblem, force: Array) -> tuple[float, float]:
    """Compute worst and mean |ΣF| on a grain over the mean f_n, for forces (c, 2) [N] in the order of the contacts."""
    force, body, _ = _start(problem, force)
    _, _, mean = measure_forces(force, force)
    worst, mean_size = measure_force_residual(problem, body)
    return (worst / mean, mean_size / mean) if mean > 0 else (0.0, 0.0)


def to_contact_order(problem: ContactProblem, force: Array) -> Array:
    """Reorder forces (…, c, 2) from visiting order to the order of the contacts."""
    result = np.empty_like(force)
    result[..., problem.rows, :] = force
    return result


def _strides(every: int | Iterable[int], total: int) -> Iterator[int]:
    """Strides that add up to the number of sweeps."""
    remaining = total
    for stride in repeat(every) if isinstance(every, int) else every:
        if remaining == 0:
            return
        yield min(stride, remaining)
        remaining -= min(stride, remaining)
    if remaining > 0:
        yield remaining


def _start(problem: ContactProblem, guess: Array | None) -> tuple[Array, Array, Array]:
    force, body = aligned_zeros((len(problem.rows), 2)), aligned_zeros(problem.body.shape)
    if guess is not None:
        force[:] = guess[problem.rows]
    plate = np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)
    return force, body, plate


def _finish(problem: ContactProblem, force: Array, stop: Stop, number: int) -> Solution:
    body, plate = np.empty_like(problem.body), np.empty_like(problem.plate)
    apply_forces(problem, body, plate, force)  # recomputed, to drop the rounding errors of many sweeps
    _, norm, mean = measure_forces(force, force)
    worst, mean_size = measure_force_residual(problem, body)
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
