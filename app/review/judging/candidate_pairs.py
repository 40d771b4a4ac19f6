"""Candidates: every pair of a frame whose gap leaves room for doubt, with what the detector thought of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from solver.bodies.grains import Array
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, ContactSource, detect_contacts, measure_pairs
from solver.contacts.pairs import are_among, are_there, join_keys, recall
from solver.contacts.verdicts import DETECTED
from solver.sequence.settings import SequenceSettings

from ...results.results import Results

REACH = 4.0  # [σ of a gap] beyond the threshold
UNLISTED = 3e-3  # P(touch) that a pair which the detector left out has at most
THRESHOLD_SIGMAS = SequenceSettings().threshold_sigmas  # of a position, where the configuration names no threshold


@dataclass(frozen=True, slots=True)
class CandidatePairs:
    """Candidates of one frame, ordered by key."""

    frame: int  # of the run
    contacts: Contacts
    sigma: Array  # (c,) [m] standard deviation of the gap
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
    def doubt(self) -> Array:
        """0: the detector is sure, 1: it cannot tell (c,)."""
        return 1.0 - np.abs(2.0 * self.probability - 1.0)


def find_candidate_pairs(results: Results, frame: int, threshold: float | None = None) -> CandidatePairs:
    """Find every pair that is detected or whose gap is below threshold + 4 σ of the gap.

    frame: of the run; threshold [m]: that of the detector, 6 σ of a position unless given.
    """
    tracks = results.tracks
    position, present = tracks.position[frame], tracks.present[frame]
    deviation = float(tracks.position_sigma[frame])
    threshold = THRESHOLD_SIGMAS * deviation if threshold is None else threshold
    walls = walls_at(results, frame)
    listed = results.frames[frame].contacts
    near = detect_contacts(
        results.grains, position, present, walls, threshold + REACH * deviation * np.sqrt(2.0),
        wall_threshold=threshold + REACH * deviation,
    )  # fmt: skip
    key = join_keys(near.key, listed.key)
    # A stand-in for a lost grain cannot be judged on the photograph.
    contacts = measure_pairs(results.grains, position, walls, key[are_there(key, present, near.body_count)])
    sigma = gap_sigma(contacts, deviation)
    probability, detected = _detection(results, frame, contacts, sigma, threshold)
    return CandidatePairs(frame, contacts, sigma, probability, detected, threshold)


def walls_at(results: Results, frame: int) -> Walls:
    """The walls of one frame, at rest."""
    cell = None if results.walls.cell is None else results.walls.cell[frame]
    return Walls.at_rest(results.walls.endpoints[frame], side=results.walls.side, cell=cell)


def gap_sigma(contacts: Contacts, deviation: float) -> Array:
    """Standard deviation of gaps (c,) [m] from that of a position component [m]; walls are taken as exact."""
    return np.where(contacts.with_wall, 1.0, np.sqrt(2.0)) * deviation


def _detection(
    results: Results, frame: int, contacts: Contacts, sigma: Array, threshold: float
) -> tuple[Array, NDArray[np.bool_]]:
    """P(touch) and whether the pair was detected (c,)."""
    forces = results.frames[frame]
    from_gap = ndtr((threshold - contacts.gap) / np.maximum(sigma, 1e-12))
    listed = are_among(contacts.key, forces.contacts.key)
    told = recall(contacts.key, forces.contacts.key, forces.probability, fill=np.nan)
    detector = forces.source == ContactSource.DETECTED  # of an added contact even the plain detector tells P = 0
    by_probability = bool(np.isfinite(forces.probability[detector]).any())
    unlisted = np.minimum(from_gap, UNLISTED) if by_probability else from_gap
    probability = np.where(np.isfinite(told), told, np.where(listed | ~np.isfinite(unlisted), from_gap, unlisted))
    detected = listed & ~(told < DETECTED)  # a NaN, where no probability was computed, compares false
    return probability, detected
