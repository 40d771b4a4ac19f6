"""Contact networks at an instant of an interval: all pairs below a gap, or pairs that probably touch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..bodies.grains import Array, GrainMotion, Grains
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, detect_contacts, measure_pairs
from ..contacts.pairs import Keys, are_present, join_keys, match_values
from ..contacts.verdicts import NO_VERDICTS, Verdicts, apply_verdicts

SURE = 0.3  # P(touch) above which a contact bears force without closing further
LEAST = 3e-3  # P(touch) below which a pair is no contact


class Network(Protocol):
    """Contacts within an interval, and the closing distance of uncertain ones."""

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        """Return the contacts after a fraction of the interval, and the distance each must close to bear force.

        The closing distance (c,) is in units of the rms displacement of a step; None: zero for all.
        """
        ...


@dataclass(frozen=True, slots=True)
class ThresholdNetwork:
    """Every pair whose gap is below a threshold [m], except where a verdict decides."""

    threshold: float
    verdicts: Verdicts = NO_VERDICTS

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        near = detect_contacts(grains, state.position, state.present, walls, self.threshold)
        return apply_verdicts(near, self.verdicts, grains, state.position, state.present, walls)[0], None


@dataclass(frozen=True, slots=True)
class PairProbability:
    """P(touch) of the candidate pairs of one frame, by key."""

    key: Keys  # (m,) ascending
    touch: Array  # (m,)

    @classmethod
    def none(cls) -> PairProbability:
        return cls(np.empty(0, np.int64), np.empty(0))

    def of(self, key: Keys) -> Array:
        """Return P(touch) of pairs (c,) given by key; zero for unknown pairs."""
        return match_values(key, self.key, self.touch)


@dataclass(frozen=True)
class ProbabilityNetwork:
    """Pairs that probably touch at the start or end of the interval, P(touch) being linear in between.

    The closing distance is max(0, log₁₀(SURE / P(touch))).
    """

    start: PairProbability
    end: PairProbability

    def at(self, fraction: float, grains: Grains, state: GrainMotion, walls: Walls) -> tuple[Contacts, Array | None]:
        key, start, end = self._inside if fraction < 1.0 else (self.end.key, 0.0, self.end.touch)
        touch = (1.0 - fraction) * start + fraction * end
        keep = (touch > LEAST) & are_present(key, state.present, grains.count + walls.count)
        contacts = measure_pairs(grains, state.position, walls, key[keep])
        return contacts, np.maximum(0.0, np.log10(SURE / touch[keep]))

    @cached_property
    def _inside(self) -> tuple[Keys, Array, Array]:
        """Pairs of the instants before the end, and P(touch) of each at the start and at the end."""
        key = join_keys(self.start.key, self.end.key)
        return key, self.start.of(key), self.end.of(key)
