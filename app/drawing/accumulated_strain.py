"""The strain of a packing accumulated over its frames: the axis of long runs, in recordings and figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.bodies.strain import strain_magnitude


class AccumulatedStrain:
    """The strain of a packing accumulated over its steps since frame 0."""

    def __init__(self) -> None:
        self._accumulated = np.nan
        self._previous: Array | None = None

    def add(self, strain: Array | None) -> float:
        """Add a frame.

        Parameters
        ----------
        strain : array (2, 2), optional
            Strain of the frame since frame 0; None or NaN: not known.

        Returns
        -------
        float
            Strain accumulated up to this frame. Where the strain is not known, the value of the frame before; NaN
            until one is known.
        """
        if strain is None or not np.isfinite(strain).all():
            return self._accumulated
        previous = self._previous
        self._accumulated = 0.0 if previous is None else self._accumulated + strain_magnitude(strain - previous)
        self._previous = strain
        return self._accumulated


def accumulated_strains(strains: Sequence[Array | None]) -> list[float]:
    """Return the accumulated strains of all frames of a run, from their strains (2, 2) since frame 0."""
    accumulated = AccumulatedStrain()
    return [accumulated.add(strain) for strain in strains]
