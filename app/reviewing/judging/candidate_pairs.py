"""Candidate pairs: every pair of a frame whose gap leaves open whether the bodies touch, with the detector's answer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ...results.results import Results
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import Contacts, ContactSource, detect_contacts, measure_pairs
from ...solver.contacts.pairs import are_among, are_present, join_keys, make_key, match_values
from ...solver.contacts.verdicts import DETECTED
from ...solver.sequence.settings import SequenceSettings

REACH = 4.0  # [standard deviations of a gap] beyond the threshold
UNLISTED = 3e-3  # upper bound of P(touch) for a pair that the detector left out
# Of a position, where the configuration names no threshold.
THRESHOLD_STANDARD_DEVIATIONS = SequenceSettings().threshold_sigmas


@dataclass(frozen=True, slots=True)
class CandidatePairs:
    """Candidate pairs of one frame, ordered by key."""

    frame: int  # of the run
    contacts: Contacts
    gap_sd: Array  # (c,) [m]
    probability: Array  # (c,) P(touch) by the detector, or from the gap alone where it gave none
    detected: NDArray[np.bool_]  # (c,)
    threshold: float  # [m]

    @property
    def count(self) -> int:
        return self.contacts.count

    @property
    def key(self) -> NDArray[np.int64]:
        return self.contacts.key

    @property
    def ambiguity(self) -> Array:
        """1 − |2 P(touch) − 1| (c,): 0 where the detector is certain, 1 where both answers are equally probable."""
        return 1.0 - np.abs(2.0 * self.probability - 1.0)


def find_candidate_pairs(results: Results, frame: int, threshold: float | None = None) -> CandidatePairs:
    """Find every pair that is detected or whose gap is below the threshold plus 4 standard deviations of the gap.

    Parameters
    ----------
    results : Results
        Results of a run.
    frame : int
        Frame of the run.
    threshold : float, optional
        Gap threshold of the detector [m]; default: 6 standard deviations of a position.
    """
    tracks = results.tracks
    position, present = tracks.position[frame], tracks.present_in(frame)
    position_sd = float(tracks.frame(frame).position_sigma[0])
    threshold = THRESHOLD_STANDARD_DEVIATIONS * position_sd if threshold is None else threshold
    walls = results.walls.at_rest(frame)
    listed = results.frames[frame].contacts
    near = detect_contacts(
        results.grains, position, present, walls, threshold + REACH * position_sd * np.sqrt(2.0),
        wall_threshold=threshold + REACH * position_sd,
    )  # fmt: skip
    key = join_keys(near.key, listed.key)
    # The substitute of a lost grain cannot be judged on the photograph.
    contacts = measure_pairs(results.grains, position, walls, key[are_present(key, present, near.body_count)])
    gap_sd = gap_standard_deviation(contacts, position_sd)
    probability, detected = _detection(results, frame, contacts, gap_sd, threshold)
    return CandidatePairs(frame, contacts, gap_sd, probability, detected, threshold)


def gap_in_radii(results: Results, frame: int, i: int, j: int) -> float:
    """Gap between two bodies, given by their rows, over the mean radius of the grains of both; NaN: one is not seen."""
    tracks, n = results.tracks, results.grains.count
    i, j = min(i, j), max(i, j)
    grains = [row for row in (i, j) if row < n]
    if not tracks.present_in(frame)[grains].all():
        return math.nan
    key = np.array([make_key(i, j, n + results.walls.count)])
    measured = measure_pairs(results.grains, tracks.position[frame], results.walls.at_rest(frame), key)
    return float(measured.gap[0] / results.grains.radius[grains].mean())


def gap_standard_deviation(contacts: Contacts, position_sd: float) -> Array:
    """Standard deviation of gaps (c,) [m] from that of a position component [m]; walls are taken as exact."""
    return np.where(contacts.with_wall, 1.0, np.sqrt(2.0)) * position_sd


def _detection(
    results: Results, frame: int, contacts: Contacts, gap_sd: Array, threshold: float
) -> tuple[Array, NDArray[np.bool_]]:
    """P(touch) and whether the pair was detected (c,)."""
    forces = results.frames[frame]
    from_gap = ndtr((threshold - contacts.gap) / np.maximum(gap_sd, 1e-12))
    listed = are_among(contacts.key, forces.contacts.key)
    stored = match_values(contacts.key, forces.contacts.key, forces.probability, fill=np.nan)
    # The simple detector, too, stores P = 0 for a contact that a reviewer added.
    by_detector = forces.source == ContactSource.DETECTED
    by_probability = bool(np.isfinite(forces.probability[by_detector]).any())
    unlisted = np.minimum(from_gap, UNLISTED) if by_probability else from_gap
    probability = np.where(np.isfinite(stored), stored, np.where(listed | ~np.isfinite(unlisted), from_gap, unlisted))
    detected = listed & ~(stored < DETECTED)  # a NaN, where no probability was computed, compares false
    return probability, detected
