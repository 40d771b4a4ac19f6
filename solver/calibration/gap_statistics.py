"""Statistics of the gaps of a sequence, before and after its constant errors are corrected."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from ..bodies.grains import Array
from ..quantity import Quantity
from .fit import GapFit
from .weights import contact_width

IMPOSSIBLE = 4.0  # standard deviations of noise: no touching pair overlaps more


@dataclass(frozen=True, slots=True)
class GapStatistics:
    """Standard deviations of touching gaps and the fraction of impossible overlaps; names are those stored."""

    spread: Annotated[float, Quantity("rms gap of grains that touch after the correction", "m")]
    wall_spread: Annotated[float, Quantity("rms gap of grains that touch walls", "m")]
    width: Annotated[float, Quantity("standard deviation of the gaps of touching grains", "m")]
    wall_width: Annotated[float, Quantity("standard deviation of the gaps of grains that touch walls", "m")]
    impossible: Annotated[float, Quantity("fraction of overlaps deeper than 4 standard deviations of the noise")]


def gap_statistics(gap: Array, fit: GapFit) -> GapStatistics:
    """Compute the statistics of gaps (m,) [m] of the candidate pairs of a fit."""
    candidates = fit.candidates
    between, overlap = candidates.between_grains, candidates.overlap
    overlapping = gap + overlap < 0.0
    deep = gap + overlap < -IMPOSSIBLE * candidates.noise
    return GapStatistics(
        _rms(gap[between & fit.touching] + overlap),
        _rms(gap[~between & fit.touching] + overlap),
        contact_width(gap[between], overlap),
        contact_width(gap[~between], overlap),
        float(np.mean(deep[overlapping])) if np.any(overlapping) else 0.0,
    )


def width_gain(fit: GapFit) -> float:
    """Compute the relative reduction of the standard deviation of touching gaps: 1 − after/before."""
    before, after = (gap_statistics(gap, fit).width for gap in (fit.gap_before, fit.gap_after))
    return 1.0 - after / before if before > 0.0 else 0.0


def _rms(gap: Array) -> float:
    return float(np.sqrt(np.mean(gap**2))) if len(gap) else 0.0
