"""What one frame tells of its forces by positions alone: pairs within reach, what is known of errors and of loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts


@dataclass(frozen=True, slots=True)
class FrameEvidence:
    """What one frame tells of its forces without any motion."""

    contacts: Contacts  # (c) pairs within reach, by their gaps
    prior: Float[Array, " c"]  # P(bears) before gap and balance are looked at
    friction: Float[Array, " c"]
    radius: Float[Array, " n"]  # [m]
    centre_deviation: Float[Array, " n"]  # [m] standard deviation of an error of a centre's coordinate
    radius_deviation: Float[Array, " n"]  # [m] of an error of a radius; 0: exact
    balanced: Bool[np.ndarray, " n"]  # all that pushes the grain is among the pairs; else its ΣF is free
    known: KnownForces
    # At the packing's edge, what pushes them from outside is not among the pairs, but is of the size of what is.
    edge: Bool[np.ndarray, " n"] | None = None  # None: no grain
    gap_deviation: Float[Array, " c"] | None = None  # [m] of an error that a gap has for itself; None: none has

    @property
    def diameter(self) -> float:
        """Mean diameter [m]."""
        return 2.0 * float(self.radius.mean())


@dataclass(frozen=True, slots=True)
class KnownForces:
    """Forces that are known beforehand. Without any, the mean normal force is the unit."""

    unit: float  # [N] near the mean normal force
    weight: Float[Array, "n 2"]  # [N]
    group: Int[np.ndarray, " c"]  # sum that a pair's normal force is part of, −1: none
    total: Float[Array, " g"]  # [N] these sums: loads of plates, or of all walls together

    @property
    def fix_the_scale(self) -> bool:
        return bool(len(self.total) or np.any(self.weight))
