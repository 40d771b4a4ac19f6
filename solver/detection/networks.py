"""Which pairs count as contacts at an instant of an interval: all below a gap, or those that probably touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, GrainMotion, Grains
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, detect_contacts, measure_contacts
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, apply_verdicts

SURE = 0.3  # P(touch) from which on a contact bears force at once
LEAST = 3e-3  # P(touch) below which a pair is no contact


class Network(Protocol):
    """Contacts of an interval, and the reluctance of the doubtful ones."""

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        """Contacts after a fraction of the interval, and how far each must close before it bears force.

        The reluctance (c,) counts in rms displacements of a step; None: all bear at once.
        """
        ...


@dataclass(frozen=True, slots=True)
class NearPairs:
    """Every pair whose gap is below a threshold [m], save where people know better."""

    threshold: float
    verdicts: Verdicts = NO_VERDICTS

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        near = detect_contacts(grains, state.position, state.present, walls, self.threshold)
        return apply_verdicts(near, self.verdicts, grains, state.position, state.present, walls)[0], None


@dataclass(frozen=True, slots=True)
class PairProbability:
    """P(touch) of the pairs that probably touch in one frame, by key."""

    key: NDArray[np.int64]  # (m,) ascending
    touch: Array  # (m,)

    @classmethod
    def none(cls) -> PairProbability:
        return cls(np.empty(0, np.int64), np.empty(0))

    def of(self, key: NDArray[np.int64]) -> Array:
        """P(touch) of the named pairs (c,), zero for others."""
        touch = np.zeros(len(key))
        if len(self.key):
            place = np.minimum(np.searchsorted(self.key, key), len(self.key) - 1)
            known = self.key[place] == key
            touch[known] = self.touch[place[known]]
        return touch


@dataclass(frozen=True, slots=True)
class ProbablePairs:
    """Pairs that probably touch at the start or the end of the interval; P goes linearly from one to the other."""

    start: PairProbability
    end: PairProbability

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        key = np.union1d(self.start.key, self.end.key) if fraction < 1.0 else self.end.key
        bodies = grains.count + walls.count
        i, j = key // bodies, key % bodies
        here = np.concatenate([state.present, np.ones(walls.count, np.bool_)])
        touch = (1.0 - fraction) * self.start.of(key) + fraction * self.end.of(key)
        keep = (touch > LEAST) & here[i] & here[j]
        contacts = measure_contacts(grains, state.position, walls, i[keep], j[keep])
        return contacts, np.maximum(0.0, np.log10(SURE / touch[keep]))
