"""Contacts of a frame: detected, offered by the position-only estimate or the balance, corrected by reviewers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bodies.grains import Array
from ..contacts.contacts import Contacts, measure_pairs
from ..contacts.pairs import are_among, are_present, join_keys, match_values
from ..contacts.verdicts import apply_verdicts
from ..detection.contact_networks import PairProbability
from ..mixture.frame_mixture import offered_pairs
from ..posterior.frame_posterior import FramePosterior
from .frame_problem import FrameProblem
from .missing_contacts import MissingContacts


@dataclass(frozen=True, slots=True)
class TouchingPairs:
    """Contacts of the frame with their probability of touching."""

    contacts: Contacts
    detected: Array  # (c,) P(touch) as detected; 0 for a contact that only a reviewer added
    probability: Array  # (c,) the same, but 1 where a reviewer confirmed the contact
    forbidden: Contacts  # detected, but excluded by a reviewer
    forbidden_probability: Array  # (m,) P(touch) of those, as detected

    @property
    def pairs(self) -> PairProbability:
        return PairProbability(self.contacts.key, self.probability)


def find_touching(problem: FrameProblem, positions: FramePosterior | None, missing: MissingContacts) -> TouchingPairs:
    """Find the pairs that may bear force; positions: the position-only estimate, None where it was not computed."""
    packing, snapshot, verdicts, refined = problem.packing, problem.snapshot, problem.verdicts, problem.refined
    assert refined is not None
    least = problem.settings.ensemble.probability.least
    detected, touch = refined.contacts_at(snapshot, problem.k, packing.grains, problem.walls, least)
    if positions is not None:
        detected, touch = _with_offered(problem, detected, touch, positions)
    detected, touch = _with_missing(problem, detected, touch, missing)
    contacts, before = apply_verdicts(
        detected, verdicts, packing.grains, snapshot.position, snapshot.present, problem.walls
    )
    # A pair that a reviewer confirmed is certain, whatever its measured gaps.
    probability_detected = np.where(before >= 0, touch[before], 0.0) if len(touch) else np.zeros(contacts.count)
    probability = np.where(are_among(contacts.key, verdicts.forced), 1.0, probability_detected)
    forbidden = are_among(detected.key, verdicts.forbidden)
    return TouchingPairs(contacts, probability_detected, probability, detected.select(forbidden), touch[forbidden])


def _with_offered(
    problem: FrameProblem, detected: Contacts, touch: Array, positions: FramePosterior
) -> tuple[Contacts, Array]:
    """Add the pairs that bear force by the position-only estimate."""
    offered = offered_pairs(positions)
    here = are_present(offered.key, problem.snapshot.present, offered.body_count)
    key = join_keys(detected.key, offered.key[here])
    contacts = measure_pairs(problem.packing.grains, problem.snapshot.position, problem.walls, key)
    bears = match_values(key, positions.contacts.key, positions.bearing_probability, fill=0.0)
    known = match_values(key, detected.key, touch, fill=0.0)
    return contacts, np.where(are_among(key, offered.key), np.maximum(known, bears), known)


def _with_missing(
    problem: FrameProblem, detected: Contacts, touch: Array, missing: MissingContacts
) -> tuple[Contacts, Array]:
    """Add the missing contacts that the balance shows."""
    if missing.count == 0:
        return detected, touch
    key = join_keys(detected.key, missing.key)
    contacts = measure_pairs(problem.packing.grains, problem.snapshot.position, problem.walls, key)
    offered = match_values(key, missing.key, missing.probability, fill=0.0)
    return contacts, np.maximum(match_values(key, detected.key, touch, fill=0.0), offered)
