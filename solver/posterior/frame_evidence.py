"""Evidence of one frame without motion: candidate pairs, standard deviations of errors, known loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..bodies.grains import Array
from ..contacts.contacts import Contacts


@dataclass(frozen=True, slots=True)
class FrameEvidence:
    """Everything that the posterior of one frame is conditioned on."""

    contacts: Contacts  # (c) pairs within reach, with their gaps
    prior: Float[Array, " c"]  # prior probability that the pair bears force
    friction: Float[Array, " c"]
    radius: Float[Array, " n"]  # [m]
    centre_sd: Float[Array, " n"]  # [m] standard deviation of an error of a centre's coordinate
    radius_sd: Float[Array, " n"]  # [m] standard deviation of an error of a radius; 0: exact
    balanced: Bool[np.ndarray, " n"]  # all forces on the grain are among the pairs; else its ΣF is free
    known: KnownForces
    # At the packing's edge, outside forces are not among the pairs, but are as large as forces between grains.
    edge: Bool[np.ndarray, " n"] | None = None  # None: no grain
    gap_sd: Float[Array, " c"] | None = None  # [m] standard deviation of an error of this gap alone; None: none
    pressure: Float[Array, " n"] | None = None  # [N] measured sum of a grain's normal forces; NaN: not measured
    pressure_sd: Float[Array, " n"] | None = None  # [N]
    pressure_scale: float = np.nan  # of the measured pressures over one unit of all frames; NaN: forces have a scale
    pressure_correlation: float = np.nan  # of the measured pressures with the true ones

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
    # Factor of f_n in its sum: 1, or n·p on a wall that is fixed to a plate of normal p, whose f_t are left out.
    factor: Float[Array, " c"] | None = None  # None: 1

    @property
    def scale_known(self) -> bool:
        """Whether a load or weight determines the scale of all forces."""
        return bool(len(self.total) or np.any(self.weight))
