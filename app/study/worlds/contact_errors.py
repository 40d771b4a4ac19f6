"""What stated contact forces err by, contact for contact, with all that is stated of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, recall
from solver.sequence.frame_forces import FrameForces
from solver.sequence.judging.intervals import (
    DOUBTED,
    SLIDES,
    formula_deviations,
    groups_of,
    terms_of,
    witness_behind,
)
from solver.statistics.agreement import compare_forces
from solver.statistics.force_statistics import mean_normal_force

from ...synthetic.worlds.table import WORLDS
from .solved_world import SolvedWorld

WEAK = 1e-3  # of the mean force: contacts below it, inferred and true, have no error worth a bar


@dataclass(frozen=True, slots=True)
class ContactErrors:
    """Contacts of frames; forces over the mean f_n of their frame, f_n and f_t in columns."""

    world: NDArray[np.str_]  # (c,)
    seed: NDArray[np.int64]  # (c,)
    frame: NDArray[np.int64]  # (c,)
    group: NDArray[np.uint8]  # (c,) of Group
    wall: NDArray[np.bool_]  # (c,)
    sliding: NDArray[np.bool_]  # (c,)
    doubtful: NDArray[np.bool_]  # (c,)
    witness: NDArray[np.uint8]  # (c,) of Witness
    terms: Array  # (c, t) of Term, before the motion contradicted the friction
    force: Array  # (c, 2)
    error: Array  # (c, 2) stated less true
    deviation: Array  # (c, 2) stated
    formula: Array  # (c, 2) the deviation that was calibrated, floor included

    def select(self, rows: NDArray[np.bool_]) -> ContactErrors:
        return ContactErrors(*(getattr(self, each.name)[rows] for each in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[ContactErrors]) -> ContactErrors:
        return cls(*(np.concatenate([getattr(each, field.name) for each in parts]) for field in fields(cls)))


def measure_errors(solved: SolvedWorld, *, widened: bool = False) -> ContactErrors:
    """Errors of all frames of a solved world; where nothing tells a size, truth is brought to ours.

    widened: with the deviations that its members give.
    """
    told = solved.widened if widened else solved.checked
    parts = [
        _of_frame(solved, each.forces, told[k], *solved.true[k])
        for k, each in enumerate(solved.frames)
        if (each.forces.fn > 0).any()
    ]
    return ContactErrors.joined(parts)


def _of_frame(
    solved: SolvedWorld, before: FrameForces, frame: FrameForces, true_key: Keys, true: Array
) -> ContactErrors:
    """Errors of one frame; before: as it was before its friction was doubted."""
    force = np.column_stack([frame.fn, frame.ft])
    exact = recall(frame.contacts.key, true_key, true)
    if not WORLDS[solved.world].scale_known:
        exact = exact * compare_forces(frame.contacts.key, force, true_key, true).scale
    mean = mean_normal_force(frame.fn)
    told = np.maximum(frame.fn, exact[:, 0]) > WEAK * mean
    count = int(told.sum())
    assert frame.sliding_probability is not None
    assert frame.bearing_probability is not None
    return ContactErrors(
        world=np.full(count, solved.world),
        seed=np.full(count, solved.seed),
        frame=np.full(count, frame.frame),
        group=groups_of(frame)[told],
        wall=frame.contacts.with_wall[told],
        sliding=frame.sliding_probability[told] > SLIDES,
        doubtful=frame.bearing_probability[told] < DOUBTED,
        witness=np.full(count, witness_behind(frame), np.uint8),
        terms=np.tile(terms_of(before), (count, 1)),
        force=force[told] / mean,
        error=(force - exact)[told] / mean,
        deviation=np.column_stack([frame.fn_sd, frame.ft_sd])[told] / mean,
        formula=formula_deviations(before)[told],
    )
