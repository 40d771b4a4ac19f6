"""Whether grains are soft: their overlaps are forces and must not be corrected as errors of radii, scale or walls.

Gaps of touching hard grains vary about zero by noise and errors, to both sides alike. Gaps of soft grains are all
overlaps, with a mean that equals their standard deviation: forces are distributed nearly as exp(−f / ⟨f⟩). A wrong
scale, or an error that all radii share, shifts the gaps without increasing their variance.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..detection.precision import measure_precision
from ..posterior.sequence_evidence import gather_position_evidence

MIN_OVERLAP = 2.5  # overlap over the noise of a position: below it calibration cannot correct it away
OVERLAP_RATIO = (0.5, 2.5)  # mean overlap over the gaps' standard deviation; hard packings: up to .2 above MIN_OVERLAP
MIN_SD = 1.2  # standard deviation of the gaps over the noise of a gap


def find_soft_overlap(packing: Packing, snapshots: Sequence[Snapshot]) -> float:
    """Find the mean overlap of touching pairs [m] of soft grains; 0 if grains are hard.

    Notes
    -----
    With o and s the mean overlap and standard deviation of touching gaps, σ the noise of a position, o' the overlap by
    `measure_precision`: soft if o' ≥ 2.5 σ, 0.5 s < o < 2.5 s and s > 1.2 √2 σ.
    """
    found = measure_precision(packing.grains, snapshots)
    if found is None or found.overlap < MIN_OVERLAP * found.sigma:
        return 0.0
    try:
        evidence = gather_position_evidence(packing, snapshots)
    except ValueError:  # no two bodies are near
        return 0.0
    overlap, sd = -evidence.touching.offset, evidence.touching.sd
    noise = 2.0**0.5 * found.sigma
    soft = OVERLAP_RATIO[0] * sd < overlap < OVERLAP_RATIO[1] * sd and sd > MIN_SD * noise
    return overlap if soft else 0.0
