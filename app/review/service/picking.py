"""Which pair a click means: the nearest candidate, or else the two bodies whose gap was clicked."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts, detect_contacts

from ...results.results import Results
from ..judging.candidate_pairs import CandidatePairs, walls_at

NEAR = 0.45  # [mean radius] how far from a candidate's point a click may be
WIDEST_GAP = 0.25  # [mean radius] between two bodies that a click can join
BESIDE = 0.35  # [mean radius] how far from the middle of such a gap a click may be


def nearest_candidate(candidates: CandidatePairs, point: Array, mean_radius: float) -> int | None:
    """Row of the candidate that a click at point (2,) [m] means; None if none is near."""
    if candidates.count == 0:
        return None
    distance = np.linalg.norm(candidates.contacts.point - point, axis=1)
    row = int(np.argmin(distance))
    return row if distance[row] <= NEAR * mean_radius else None


def gap_at(results: Results, frame: int, point: Array) -> tuple[int, int] | None:
    """Rows of the two bodies whose gap lies at point (2,) [m]; None where there is no such gap."""
    mean_radius = float(results.grains.radius.mean())
    near = near_pairs(results, frame, WIDEST_GAP * mean_radius)
    if near.count == 0:
        return None
    distance = np.linalg.norm(near.point - point, axis=1)
    row = int(np.argmin(distance))
    if distance[row] > BESIDE * mean_radius:
        return None
    return int(near.i[row]), int(near.j[row])


def near_pairs(results: Results, frame: int, gap: float) -> Contacts:
    """All pairs of one frame with less than a gap [m] between them."""
    tracks = results.tracks
    return detect_contacts(results.grains, tracks.position[frame], tracks.present[frame], walls_at(results, frame), gap)
