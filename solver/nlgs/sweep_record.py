"""An observer that records the sweeps of a frame: exact residuals and forces of all of them, or of some.

Measuring a sweep takes about as long as the sweep. Where the forces of some sweeps are kept, these and one in ten of
the others are measured; where only the last forces are kept, the last sweep of a sub-step. Other rows are NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..contacts.pairs import find_rows
from ..part_settings import Keep
from ..quantity import Quantity
from .problem import ContactProblem
from .solve import Sweep

FIRST = 8  # sweeps kept one by one before the spacing becomes logarithmic
LOG_SPACED = 40  # sweeps kept of a frame
MEASURED: dict[Keep, int] = {"all": 1, "log": 10, "none": 0}  # one in so many sweeps is measured; 0: only kept ones


def recorded_sweeps(total: int, keep: Keep) -> NDArray[np.int64]:
    """Select the sweeps of a frame (0 … total − 1) whose forces are kept; the last one is always kept."""
    if total == 0:
        return np.empty(0, np.int64)
    if keep == "all":
        return np.arange(total)
    if keep == "none":
        return np.array([total - 1])
    spaced = np.round(np.geomspace(FIRST, total, LOG_SPACED - FIRST)).astype(np.int64) - 1
    return np.unique(np.clip(np.concatenate([np.arange(FIRST), spaced, [total - 1]]), 0, total - 1))


@dataclass(frozen=True, slots=True)
class _Step:
    """A sub-step and the kept forces of its sweeps."""

    problem: ContactProblem
    contacts: Contacts
    force: list[NDArray[np.float32]]  # (2, c) [N] each, f_n and f_t in visiting order

    def place_of(self, contacts: Contacts) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Rows of other contacts (c,) in the visiting order, and which of them exist in the sub-step."""
        row, known = find_rows(contacts.key, self.contacts.key)
        place = np.empty(self.contacts.count, np.intp)
        place[self.problem.rows] = np.arange(self.contacts.count)
        return place.take(row), known


class SweepRecorder:
    """Records the sweeps of the successive sub-steps of a frame."""

    def __init__(self, expected: int, keep: Keep) -> None:
        self.measured = MEASURED[keep]
        self._kept_sweeps = recorded_sweeps(expected, keep)
        self._recorded: list[int] = []
        self._count = 0
        self._residuals: list[Array] = [np.empty((0, 3))]
        self._steps: list[_Step] = []

    def begin(self, problem: ContactProblem, contacts: Contacts) -> None:
        """Begin a sub-step: the following sweeps belong to this problem."""
        self._steps.append(_Step(problem, contacts, []))

    def strides(self) -> Iterator[int]:
        """Numbers of sweeps to the next kept sweep, from there to the one after it, …"""
        count = self._count
        for kept in self._kept_sweeps[len(self._recorded) :].tolist():
            yield kept + 1 - count
            count = kept + 1

    def on_sweep(self, sweep: Sweep) -> None:
        """Store the residuals up to this sweep, and its forces if they are to be kept."""
        self._residuals.append(sweep.residuals)
        self._count += len(sweep.residuals)
        last, kept = self._count - 1, len(self._recorded)
        if kept < len(self._kept_sweeps) and last == self._kept_sweeps[kept]:
            self._steps[-1].force.append(np.ascontiguousarray(sweep.force.T, np.float32))
            self._recorded.append(last)

    def history(self, contacts: Contacts) -> SweepHistory:
        """Build the record of all sweeps, with forces on the contacts of the frame."""
        force_change, natural_map, unbalance = np.concatenate(self._residuals).T.copy()
        force = np.zeros((2, len(self._recorded), contacts.count), np.float32)
        row = 0
        for step in [step for step in self._steps if step.force]:
            place, known = step.place_of(contacts)
            for kept in step.force:
                for component in range(2):
                    np.multiply(kept[component].take(place), known, out=force[component, row])
                row += 1
        return SweepHistory(
            force_change,
            natural_map,
            unbalance,
            np.array(self._recorded, np.int64),
            force[0],
            force[1],
        )


@dataclass(frozen=True, slots=True)
class SweepHistory:
    """Residuals of the sweeps of a frame, NaN where not measured, and the forces of kept sweeps."""

    force_change: Annotated[Array, Quantity("greatest |Δf| / |f| of a contact, the paper's ε_f", dims="sweep")]
    natural_map: Annotated[Array, Quantity("relative natural-map residual", dims="sweep")]
    unbalance: Annotated[Array, Quantity("worst |ΣF| on a grain / mean f_n", dims="sweep")]
    recorded: Annotated[NDArray[np.int64], Quantity("sweeps, from 0, whose forces are kept", dims="kept_sweep")]
    fn: Annotated[
        NDArray[np.float32],
        Quantity(
            "f_n after each kept sweep; to 1/512 of the mean where every sweep is kept", "N", "kept_sweep contact"
        ),
    ]
    ft: Annotated[
        NDArray[np.float32],
        Quantity(
            "f_t after each kept sweep; to 1/512 of the mean f_n where every sweep is kept", "N", "kept_sweep contact"
        ),
    ]

    @property
    def count(self) -> int:
        return len(self.force_change)

    @property
    def spaced_rows(self) -> NDArray[np.intp]:
        """Rows of the kept sweeps that are logarithmically spaced: all of them, unless every sweep was kept."""
        if len(self.recorded) < self.count:
            return np.arange(len(self.recorded))
        return np.flatnonzero(np.isin(self.recorded, recorded_sweeps(self.count, "log")))
