"""The pair that a click refers to: the nearest candidate pair, else the two bodies whose gap was clicked."""

from __future__ import annotations

import numpy as np

from ...results.results import Results
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import Contacts, detect_contacts
from .candidate_pairs import CandidatePairs

NEAR = 0.45  # [mean radius] largest distance of a click from the point of a candidate pair
WIDEST_GAP = 0.25  # [mean radius] between two bodies that a click can join
BESIDE = 0.35  # [mean radius] largest distance of a click from the middle of such a gap


def nearest_candidate(candidates: CandidatePairs, point: Array, mean_radius: float) -> int | None:
    """Return the row of the candidate pair at a point (2,) [m], None if none is near."""
    if candidates.count == 0:
        return None
    distance = np.linalg.norm(candidates.contacts.point - point, axis=1)
    row = int(np.argmin(distance))
    return row if distance[row] <= NEAR * mean_radius else None


def gap_at(results: Results, frame: int, point: Array) -> tuple[int, int] | None:
    """Return the rows of the two bodies whose gap lies at a point (2,) [m], None if there is no such gap."""
    mean_radius = float(results.grains.radius.mean())
    near = pairs_within(results, frame, WIDEST_GAP * mean_radius)
    if near.count == 0:
        return None
    distance = np.linalg.norm(near.point - point, axis=1)
    row = int(np.argmin(distance))
    if distance[row] > BESIDE * mean_radius:
        return None
    return int(near.i[row]), int(near.j[row])


def pairs_within(results: Results, frame: int, gap: float) -> Contacts:
    """Find all pairs of one frame whose gap is below a length [m]."""
    tracks = results.tracks
    return detect_contacts(
        results.grains, tracks.position[frame], tracks.present_in(frame), results.walls.at_rest(frame), gap
    )
