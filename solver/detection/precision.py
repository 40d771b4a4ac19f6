"""Precision of the positions and overlap of touching surfaces, measured from the gaps.

Rods that touch in three consecutive photographs have the same gap in all of them. The variation of the gap in time is
noise of the positions: g₋ − 2g + g₊ has twelve times the variance of a position component. The mean square of the
negative gaps minus that noise is the overlap: elasticity, roughness and errors of the radii. A pair with a negative
mean gap touches, so that neither estimate needs a threshold that depends on the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.motion import Snapshot
from ..contacts.contacts import detect_contacts, measure_contacts
from ..even_subset import even_subset
from ..robust_scale import SD_OVER_MAD

REACH = 0.02  # [mean diameter] greatest gap of a pair that is used
MIN_GAPS = 200  # fewer give no estimate
TRIPLES = 24  # number of photographs used, evenly spaced: at most so many, …
POSES = 10_000  # … and as many as show so many grains, of which the standard deviation is known within 1 %
FEWEST_TRIPLES = 4
VARIANCE_ERROR = 0.1  # relative uncertainty of the noise variance that is subtracted
CONTRADICTION = 1.3  # ratio of measured and stated precision above which the measured one is used


@dataclass(frozen=True, slots=True)
class Precision:
    """Precision and overlap as measured from the gaps."""

    sigma: float  # [m] standard deviation of a position component
    overlap: float  # [m] rms over touching pairs, noise subtracted
    count: int  # number of gaps used


def measure_precision(grains: Grains, snapshots: Sequence[Snapshot]) -> Precision | None:
    """Measure the standard deviation of the positions and the overlap of touching pairs.

    Returns
    -------
    Precision or None
        None where fewer than MIN_GAPS pairs touch in three consecutive photographs, or where gaps do not vary, as
        between photographs that are interpolated.

    Notes
    -----
    σ = 1.4826 median |g₋ − 2g + g₊| / √12 and overlap² = ⟨ḡ²⟩ − ⅔ σ² over pairs with mean gap ḡ ≤ 0.
    """
    if len(snapshots) < 3:
        return None
    middles = 1 + even_subset(len(snapshots) - 2, _triple_count(grains))
    gaps = np.concatenate([_consecutive_gaps(grains, snapshots[k - 1 : k + 2]) for k in middles], axis=1)
    mean = gaps.mean(axis=0)
    gaps, mean = gaps[:, mean <= 0.0], mean[mean <= 0.0]
    if len(mean) < MIN_GAPS:
        return None
    sigma = noise_by_second_changes(gaps[0] - 2.0 * gaps[1] + gaps[2])
    if not sigma > 0.0:
        return None
    overlap = float(np.sqrt(max(np.mean(mean**2) - 2.0 / 3.0 * sigma**2, 0.0)))
    return Precision(sigma, overlap, len(mean))


def noise_by_second_changes(change: Array) -> float:
    """Robust standard deviation of a position component [m] by second changes of gaps g₋ − 2g + g₊ [m]."""
    return SD_OVER_MAD * float(np.median(np.abs(change))) / np.sqrt(12.0)


def _triple_count(grains: Grains) -> int:
    return min(max(POSES // max(grains.count, 1), FEWEST_TRIPLES), TRIPLES)


def contradiction(found: Precision, stated: float) -> float:
    """Return measured over stated standard deviation [m] where it exceeds CONTRADICTION either way, otherwise 1."""
    factor = found.sigma / stated
    return 1.0 if 1.0 / CONTRADICTION <= factor <= CONTRADICTION else factor


def describe_contradiction(found: Precision, factor: float) -> str:
    """Return a clause that states the contradiction; factor: measured over stated standard deviation."""
    measured = f"{1e6 * found.sigma:.2g} µm, {factor:.2g} times the stated precision"
    return f"the gaps of touching rods give positions a standard deviation of {measured}"


def corrected_precision(found: Precision, stated: Sequence[float], overlap: float) -> tuple[float, float]:
    """Return the factor on the stated standard deviations and the overlap to use.

    Parameters
    ----------
    found
        Measured precision and overlap.
    stated : (f,)
        Stated standard deviations [m].
    overlap
        Assumed overlap [m].

    Returns
    -------
    factor, overlap : float
        1 and the assumed overlap [m] where the measurement does not contradict them.
    """
    factor = contradiction(found, float(np.median(stated)))
    # The assumed overlap is kept within the uncertainty that the noise leaves.
    tolerance = VARIANCE_ERROR * found.sigma**2
    variance = float(np.clip(overlap**2, found.overlap**2 - tolerance, found.overlap**2 + tolerance))
    return factor, float(np.sqrt(variance))


def scale_precision(snapshots: Sequence[Snapshot], factor: float) -> list[Snapshot]:
    """Return the snapshots with all standard deviations multiplied by a factor."""
    return [replace(each, sigma=factor * each.sigma) for each in snapshots]


def _consecutive_gaps(grains: Grains, three: Sequence[Snapshot]) -> Array:
    """Return the gaps (3, c) [m] of candidate pairs of grains in three consecutive snapshots."""
    walls = [s.walls for s in three]
    present = three[0].present & three[1].present & three[2].present
    near = detect_contacts(grains, three[1].position, present, walls[1], REACH * 2.0 * float(grains.radius.mean()))
    i, j = near.i[~near.with_wall], near.j[~near.with_wall]
    return np.stack([measure_contacts(grains, s.position, w, i, j).gap for s, w in zip(three, walls, strict=True)])
