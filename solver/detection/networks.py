"""Which pairs count as contacts at an instant of an interval: all below a gap, or those that probably touch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from solver.bodies.grains import Array, GrainMotion, Grains
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, detect_contacts, measure_pairs
from solver.contacts.pairs import Keys, are_there, join_keys, recall
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

    key: Keys  # (m,) ascending
    touch: Array  # (m,)

    @classmethod
    def none(cls) -> PairProbability:
        return cls(np.empty(0, np.int64), np.empty(0))

    def of(self, key: Keys) -> Array:
        """P(touch) of the named pairs (c,), zero for others."""
        return recall(key, self.key, self.touch)


@dataclass(frozen=True, slots=True)
class ProbablePairs:
    """Pairs that probably touch at the start or the end of the interval; P goes linearly from one to the other."""

    start: PairProbability
    end: PairProbability

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        key = join_keys(self.start.key, self.end.key) if fraction < 1.0 else self.end.key
        touch = (1.0 - fraction) * self.start.of(key) + fraction * self.end.of(key)
        keep = (touch > LEAST) & are_there(key, state.present, grains.count + walls.count)
        contacts = measure_pairs(grains, state.position, walls, key[keep])
        return contacts, np.maximum(0.0, np.log10(SURE / touch[keep]))
