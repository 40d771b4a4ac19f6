"""Pressures of photoelastic discs by their fringes, beside those of the inferred forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Bool, Float

from ..bodies.grains import Array
from ..frame_forces import FrameForces, FrameStatus
from ..posterior.fringe_calibration import fit_curve
from ..quantity import Quantity
from ..statistics.agreement import pearson
from ..statistics.balance import sum_on_grains

FEWEST = 20  # discs with fringes and forces


@dataclass(frozen=True, slots=True)
class FringePressures:
    """Sums of the normal forces on every disc by the forces and by the fringes, with the curve between them."""

    inferred: Annotated[
        Array, Quantity("sum of the inferred normal forces on a disc; NaN: unknown", "N", "frame grain", since=2)
    ]
    measured: Annotated[
        Array, Quantity("the same sum by its fringes and the curve; NaN: unknown", "N", "frame grain", since=2)
    ]
    correlation: Annotated[
        Array, Quantity("correlation of both sums over the discs of a frame; NaN: too few", dims="frame", since=2)
    ]
    knot: Annotated[Array, Quantity("G² of the curve", dims="fringe_knot", since=2)]
    level: Annotated[Array, Quantity("sum of the normal forces on the curve", "N", "fringe_knot", since=2)]

    @property
    def mean(self) -> float:
        """Mean of the inferred sums [N]."""
        return float(np.nanmean(self.inferred))

    @property
    def residual(self) -> Array:
        """Sums by the fringes minus those of the forces (f, n) [N]."""
        return self.measured - self.inferred


def compare_with_fringes(
    fringes: Float[Array, "f n"], used: Bool[np.ndarray, "f n"], frames: Sequence[FrameForces]
) -> FringePressures | None:
    """Compare the sums of the normal forces on discs with their fringes.

    Parameters
    ----------
    fringes : (f, n)
        G² of every disc, NaN where it was not read.
    used : (f, n)
        Discs that are present and no boundary grains.
    frames : sequence of FrameForces
        Forces of the f frames; those of failed ones are unknown.

    Returns
    -------
    FringePressures or None
        None: fewer than twenty discs have both.

    Notes
    -----
    The curve from G² to the sum is the isotonic regression of all frames: it shows how far forces and fringes agree,
    not whether their common scale is right.
    """
    inferred = np.full(fringes.shape, np.nan)
    for k, forces in enumerate(frames):
        if forces.status is not FrameStatus.FAILED:
            total = sum_on_grains(forces.contacts, forces.fn)[: fringes.shape[1]]
            inferred[k, used[k]] = total[used[k]]
    known = np.isfinite(inferred) & np.isfinite(fringes)
    if known.sum() < FEWEST:
        return None
    knot, level = fit_curve(fringes[known], inferred[known])
    measured = np.full(fringes.shape, np.nan)
    measured[known] = np.interp(fringes[known], knot, level)
    correlation = [pearson(a[here], b[here]) if here.sum() > 2 else np.nan
                   for a, b, here in zip(measured, inferred, known, strict=True)]  # fmt: skip
    return FringePressures(inferred, measured, np.array(correlation), knot, level)
