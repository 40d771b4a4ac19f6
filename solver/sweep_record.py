"""A listener that keeps what a frame's sweeps did: the residuals of all, the forces of some."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from solver.contacts import Contacts
from solver.frame_forces import SweepHistory
from solver.grains import Array
from solver.nlgs import Sweep, to_contact_order
from solver.problem import ContactProblem
from solver.warm_start import ForceMemory

Keep = Literal["log", "all", "none"]
FIRST = 8  # sweeps kept one by one before the spacing becomes logarithmic
LOG_SPACED = 40  # sweeps kept of a frame


def recorded_sweeps(total: int, keep: Keep) -> NDArray[np.int64]:
    """Which of a frame's sweeps (0 … total − 1) keep their forces; the last one always does."""
    if total == 0:
        return np.empty(0, np.int64)
    if keep == "all":
        return np.arange(total)
    if keep == "none":
        return np.array([total - 1])
    spaced = np.round(np.geomspace(FIRST, total, LOG_SPACED - FIRST)).astype(np.int64) - 1
    return np.unique(np.clip(np.concatenate([np.arange(FIRST), spaced, [total - 1]]), 0, total - 1))


class SweepRecorder:
    """Hears the sweeps of a frame's successive sub-steps."""

    def __init__(self, expected: int, keep: Keep) -> None:
        self._wanted = recorded_sweeps(expected, keep)
        self._next = 0
        self._count = 0
        self._force_change: list[float] = []
        self._natural_map: list[float] = []
        self._unbalance: list[float] = []
        self._kept: list[tuple[int, Contacts, Array]] = []
        self._problem: ContactProblem | None = None
        self._contacts: Contacts | None = None

    def begin(self, problem: ContactProblem, contacts: Contacts) -> None:
        """From now on sweeps are those of this problem."""
        self._problem, self._contacts = problem, contacts

    def hear(self, sweep: Sweep) -> None:
        assert self._problem is not None
        assert self._contacts is not None
        self._force_change.append(sweep.force_change)
        self._natural_map.append(sweep.natural_map)
        self._unbalance.append(sweep.unbalance)
        if self._next < len(self._wanted) and self._count == self._wanted[self._next]:
            self._kept.append((self._count, self._contacts, to_contact_order(self._problem, sweep.force)))
            self._next += 1
        self._count += 1

    def history(self, contacts: Contacts) -> SweepHistory:
        """All that was heard, the forces on the frame's own contacts."""
        force = np.zeros((len(self._kept), contacts.count, 2), np.float32)
        for row, (_, of, kept) in enumerate(self._kept):
            force[row] = kept if of is contacts else ForceMemory(of.key, kept).recall(contacts)
        return SweepHistory(
            np.array(self._force_change),
            np.array(self._natural_map),
            np.array(self._unbalance),
            np.array([number for number, _, _ in self._kept], np.int64),
            force[:, :, 0].copy(),
            force[:, :, 1].copy(),
        )
