"""Whether grains are soft: their overlaps are forces and must not be corrected as errors of radii, scale or walls.

Gaps of touching hard grains vary about zero by noise and errors, to both sides alike. Gaps of soft grains are all
overlaps, with a mean that equals their standard deviation: forces are distributed nearly as exp(−f / ⟨f⟩). A wrong
scale, or an error that all radii share, shifts the gaps without increasing their variance. Radii of some grains that
are stated too large make overlaps alone as well, but those of one grain are all alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.pairs import split_keys
from ..detection.precision import measure_precision
from ..posterior.sequence_evidence import SequenceEvidence, gather_position_evidence

# Overlap over the noise of a position, and standard deviation of the gaps over the noise of a gap, below which nothing
# shows overlaps. In eight packings of another simulation with 1.9 to 2.4 times the noise r was .86 to .97 with 2.5 and
# 1.2, where calibration removed them as errors, and is .98 to .99; no case of seeds 81 and 82 loses.
MIN_OVERLAP, MIN_SD = 1.5, 1.1
# Mean overlap over the gaps' standard deviation, in hard packings up to .2 above MIN_OVERLAP, and over its part that is
# not noise: wrong radii of a class make overlaps that are all alike.
OVERLAP_RATIO = (0.5, 2.5)
# Variance of overlaps that no errors of single grains explain, over all: .33 to 1.1 of soft grains, .01 to .09 where
# radii are wrong.
LEAST_OF_PAIRS = 0.2
FEWEST_PAIRS = 20  # more than grains, which such errors could explain by chance


def find_soft_overlap(packing: Packing, snapshots: Sequence[Snapshot]) -> float:
    """Find the mean overlap of touching pairs [m] of soft grains; 0 if grains are hard, or errors hide it."""
    return judge_gaps(packing, snapshots)[0]


def judge_gaps(packing: Packing, snapshots: Sequence[Snapshot]) -> tuple[float, bool]:
    """Return the overlap of `find_soft_overlap`, and whether errors may hide that of soft grains.

    Notes
    -----
    With o and s the mean overlap and standard deviation of touching gaps, σ the noise of a position, o' the overlap by
    `measure_precision`: soft if o' ≥ 1.5 σ, 0.5 s < o < 2.5 √(s² − 2σ²), s > 1.1 √2 σ, and `fraction_of_pairs` is not
    small. A wrong scale shifts o and leaves the other measures: the gaps are then those of soft grains, or of hard ones
    with errors of centres or radii.
    """
    found = measure_precision(packing.grains, snapshots)
    if found is None or found.overlap < MIN_OVERLAP * found.sigma:
        return 0.0, False
    try:
        evidence = gather_position_evidence(packing, snapshots)
    except ValueError:  # no two bodies are near
        return 0.0, False
    overlap, sd = -evidence.touching.offset, evidence.touching.sd
    scattered = sd > MIN_SD * 2.0**0.5 * found.sigma and fraction_of_pairs(evidence) >= LEAST_OF_PAIRS
    of_forces = float(np.sqrt(max(sd**2 - 2.0 * found.sigma**2, 0.0)))  # forces vary, and overlaps with them
    soft = scattered and OVERLAP_RATIO[0] * sd < overlap < OVERLAP_RATIO[1] * of_forces
    return (overlap, False) if soft else (0.0, scattered)


def fraction_of_pairs(evidence: SequenceEvidence) -> float:
    """Fraction of the variance of overlaps that errors of single grains do not explain; 1 where pairs are too few.

    Notes
    -----
    With δ_ij the mean overlaps, c pairs and n grains: min_e Σ (δ_ij − e_i − e_j)²/(c − n) over the variance of δ_ij.
    """
    count = evidence.packing.grains.count
    i, j = split_keys(evidence.key, count + len(evidence.packing.pressure))
    gap = np.nansum(evidence.gap, axis=0) / np.maximum(np.isfinite(evidence.gap).sum(axis=0), 1)  # 0: never near
    rows = np.flatnonzero((j < count) & (gap < 0.0))
    pair, grain = np.tile(np.arange(len(rows)), 2), np.concatenate([i[rows], j[rows]])
    spare = len(rows) - len(np.unique(grain))
    if spare < FEWEST_PAIRS:
        return 1.0
    errors = csr_array((np.ones(len(grain)), (pair, grain)), shape=(len(rows), count))
    rest = gap[rows] - errors @ lsqr(errors, gap[rows])[0]
    return float(rest @ rest / spare / np.var(gap[rows]))
