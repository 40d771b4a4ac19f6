"""Calibration of the fringes of a sequence, from estimates of some of its frames.

The curve is found from balance and fringes alone: errors of centres and radii that look like overlaps would make the
fringes look worse than they are. Whether overlaps are evidence as well is then judged by the fringes.
"""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from ..even_subset import even_subset
from ..posterior.frame_posterior import FramePosterior, infer_frame
from ..posterior.fringe_calibration import FringeCalibration, FringeReading, calibrate_fringes, with_scale_of
from ..posterior.sequence_evidence import SequenceEvidence
from ..statistics.agreement import pearson, ranks

FRAMES = 6  # estimated for the curve, evenly over the sequence
PASSES = 4  # with the curve of the pass before; the first one rests on positions alone
SEED = 2  # of the draws: the same input gives the same bits


def calibrate_sequence_fringes(
    evidence: SequenceEvidence, workers: int | None = None
) -> tuple[SequenceEvidence, FringeCalibration | None]:
    """Find the curve from the fringes of discs to their pressures.

    Parameters
    ----------
    evidence : SequenceEvidence
    workers : int, optional
        Threads; None: one for every core.

    Returns
    -------
    SequenceEvidence
        Without overlaps, where pressures of positions without overlaps agree better with the fringes.
    FringeCalibration or None
        None: no photoelastic photographs, or fringes that do not show the forces.

    Notes
    -----
    Expectation maximisation: forces of six frames by balance and the curve, the curve by their pressures, four times.
    """
    fringes = [each.fringes for each in evidence.snapshots]
    seen = [k for k, each in enumerate(fringes) if each is not None and np.isfinite(each).any()]
    if not seen:
        return evidence, None
    rows = [seen[k] for k in even_subset(len(seen), FRAMES)]
    without = evidence.without_overlaps()
    estimates = [_estimate(each, rows, None, 0, workers) for each in (evidence, without)]
    used = [_readings(evidence, each) for each in estimates]
    if not used[0] or not used[1]:
        return evidence, None
    agreement = [_rank_agreement(each) for each in used]
    better = int(np.argmax(agreement))
    readings, found = used[better], None
    known = evidence.of_frame(rows[0]).known.scale_known
    for number in range(1, PASSES + 1):
        found = calibrate_fringes(readings, dict.fromkeys(readings, 1.0) if known else None, found)
        if found is None:
            return evidence, None
        if not known:
            found = _scaled_to_all(evidence, found, readings)
        if number < PASSES:
            readings = _readings(evidence, _estimate(without, rows, found, number, workers))
    return (evidence, without)[better], found


def _estimate(
    evidence: SequenceEvidence, rows: list[int], fringes: FringeCalibration | None, number: int, workers: int | None
) -> dict[int, FramePosterior]:
    """Posteriors of some frames; number: of the pass."""
    found = {}
    for k in rows:
        frame = evidence.of_frame(k, fringes=fringes)
        if frame.contacts.count:
            found[k] = infer_frame(frame, evidence.settings, np.random.default_rng([SEED, number, k]), workers)
    return found


def _readings(evidence: SequenceEvidence, posteriors: dict[int, FramePosterior]) -> dict[int, FringeReading]:
    found = {}
    for k, each in posteriors.items():
        fringes = evidence.snapshots[k].fringes
        assert fringes is not None
        found[k] = FringeReading(fringes, each.pressure, each.pressure_sd, evidence.complete_discs(k))
    return found


def _rank_agreement(readings: dict[int, FringeReading]) -> float:
    """Mean rank correlation of fringes and pressures."""
    found = []
    for each in readings.values():
        seen = each.used & np.isfinite(each.fringes)
        if seen.sum() > 2 and np.ptp(each.fringes[seen]) > 0.0 and np.ptp(each.pressure[seen]) > 0.0:
            found.append(pearson(ranks(each.fringes[seen]), ranks(each.pressure[seen])))
    return float(np.mean(found)) if found else 0.0


def _scaled_to_all(
    evidence: SequenceEvidence, found: FringeCalibration, readings: dict[int, FringeReading]
) -> FringeCalibration:
    """Extend the scales of some frames to all."""
    typical = {k: float(each.pressure[each.used].mean()) for k, each in readings.items()}
    discs = [evidence.complete_discs(k) for k in range(len(evidence.snapshots))]
    fringes = [_or_nan(each.fringes, disc) for each, disc in zip(evidence.snapshots, discs, strict=True)]
    return with_scale_of(found, fringes, discs, typical)


def _or_nan(fringes: Array | None, like: Array) -> Array:
    return np.full(len(like), np.nan) if fringes is None else fringes
