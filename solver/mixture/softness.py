"""Whether grains are soft: overlaps that are forces must not be explained away as errors of radii, scale or walls.

Where grains are hard, the gaps of touching pairs scatter about nothing by noise and by errors, as much to one side as
to the other. Where they are soft, all of them overlap, by as much on average as they scatter: forces are distributed
nearly as exp(−f / ⟨f⟩), whose mean is its deviation. A wrong scale or wrong radii that all share shift them without
scatter.
"""

from __future__ import annotations

from collections.abc import Sequence

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.detection.precision import measure_precision
from solver.posterior.sequence_evidence import gather_evidence

SEEN_AT_MOST = 0.96  # trust in overlaps that the gaps show; r .98 to .996 on simulated grains
TOLD_AT_MOST = 0.65  # where softness is told and no gap shows it; r .66 to .74 on photoelastic discs
STANDS_OUT = 2.5  # overlap over the noise of a position: below it calibration has nothing to explain away
SKEWED = (0.5, 2.5)  # mean overlap over the scatter of the gaps; hard packings: up to .2 where the overlap stands out
SCATTERED = 1.2  # scatter over the noise of a gap


def find_overlap(packing: Packing, snapshots: Sequence[Snapshot]) -> float:
    """Mean overlap of touching pairs [m] if it is that of soft grains, else 0."""
    found = measure_precision(packing.grains, snapshots)
    if found is None or found.overlap < STANDS_OUT * found.sigma:
        return 0.0
    try:
        gathered = gather_evidence(packing, snapshots)
    except ValueError:  # no two bodies are near
        return 0.0
    overlap, scatter = -gathered.touching.offset, gathered.touching.deviation
    noise = 2.0**0.5 * found.sigma
    soft = SKEWED[0] * scatter < overlap < SKEWED[1] * scatter and scatter > SCATTERED * noise
    return overlap if soft else 0.0
