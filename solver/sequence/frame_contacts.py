"""The contacts of a frame: detected, offered by the positions, demanded by the balance, and as people see them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts, measure_pairs
from solver.contacts.pairs import are_among, are_there, join_keys, recall
from solver.contacts.verdicts import apply_verdicts
from solver.detection.networks import PairProbability
from solver.mixture.mixing import offered_pairs
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.demand import Demand
from solver.sequence.frame_problem import FrameProblem


@dataclass(frozen=True, slots=True)
class TouchingPairs:
    """The contacts of the frame, and how likely they touch."""

    contacts: Contacts
    told: Array  # (c,) P(touch) as detected; 0 for a contact that only people saw
    probability: Array  # (c,) the same, but 1 for what people saw
    forbidden: Contacts  # detected, but left out for people forbade them
    forbidden_probability: Array  # (m,) P(touch) of those, as detected

    @property
    def pairs(self) -> PairProbability:
        return PairProbability(self.contacts.key, self.probability)


def find_touching(problem: FrameProblem, positions: FramePosterior | None, demand: Demand) -> TouchingPairs:
    """The pairs that may bear force in this frame. positions: None where they were not asked."""
    packing, snapshot, verdicts, refined = problem.packing, problem.snapshot, problem.verdicts, problem.refined
    assert refined is not None
    least = problem.settings.ensemble.probability.least
    detected, touch = refined.contacts_at(snapshot, problem.k, packing.grains, problem.walls, least)
    if positions is not None:
        detected, touch = _with_offered(problem, detected, touch, positions)
    detected, touch = _with_demanded(problem, detected, touch, demand)
    contacts, before = apply_verdicts(
        detected, verdicts, packing.grains, snapshot.position, snapshot.present, problem.walls
    )
    # A pair that people saw touch is certain, whatever its measured gaps say.
    told = np.where(before >= 0, touch[before], 0.0) if len(touch) else np.zeros(contacts.count)
    probability = np.where(are_among(contacts.key, verdicts.forced), 1.0, told)
    forbidden = are_among(detected.key, verdicts.forbidden)
    return TouchingPairs(contacts, told, probability, detected.select(forbidden), touch[forbidden])


def _with_offered(
    problem: FrameProblem, detected: Contacts, touch: Array, positions: FramePosterior
) -> tuple[Contacts, Array]:
    """Contacts and P(touch) with the pairs added that bear force by the positions: nothing else brings them back."""
    offered = offered_pairs(positions)
    here = are_there(offered.key, problem.snapshot.present, offered.body_count)
    key = join_keys(detected.key, offered.key[here])
    contacts = measure_pairs(problem.packing.grains, problem.snapshot.position, problem.walls, key)
    bears = recall(key, positions.contacts.key, positions.bears, fill=0.0)
    told = recall(key, detected.key, touch, fill=0.0)
    return contacts, np.where(are_among(key, offered.key), np.maximum(told, bears), told)


def _with_demanded(problem: FrameProblem, detected: Contacts, touch: Array, demand: Demand) -> tuple[Contacts, Array]:
    """Contacts and P(touch) with the pairs added that the balance demands."""
    if demand.count == 0:
        return detected, touch
    key = join_keys(detected.key, demand.key)
    contacts = measure_pairs(problem.packing.grains, problem.snapshot.position, problem.walls, key)
    asked = recall(key, demand.key, demand.probability, fill=0.0)
    return contacts, np.maximum(recall(key, detected.key, touch, fill=0.0), asked)
