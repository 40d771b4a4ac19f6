"""Errors of the inferred forces per contact, with their stated standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ...solver.assessment.intervals.force_intervals import (
    SLIDES,
    UNCERTAIN,
    formula_sd_of,
    groups_of,
    source_of_frame,
    terms_of,
)
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys, match_values
from ...solver.frame_forces import FrameForces
from ...solver.statistics.agreement import compare_forces
from ...solver.statistics.force_statistics import mean_normal_force
from ...synthetic.scenarios.scenario_table import SCENARIOS
from ..truths import NEGLIGIBLE
from .solved_scenario import SolvedScenario


@dataclass(frozen=True, slots=True)
class ContactErrors:
    """Contacts of frames; forces over the mean f_n of their frame, f_n and f_t in columns."""

    scenario: NDArray[np.str_]  # (c,)
    seed: NDArray[np.int64]  # (c,)
    frame: NDArray[np.int64]  # (c,)
    group: NDArray[np.uint8]  # (c,) of Group
    wall: NDArray[np.bool_]  # (c,)
    sliding: NDArray[np.bool_]  # (c,)
    ambiguous: NDArray[np.bool_]  # (c,)
    evidence_source: NDArray[np.uint8]  # (c,) of EvidenceSource
    terms: Array  # (c, t) of Term, before the friction check
    force: Array  # (c, 2)
    error: Array  # (c, 2) inferred minus true
    sd: Array  # (c, 2) stated standard deviation
    formula_sd: Array  # (c, 2) before calibration, floor included

    def select(self, rows: NDArray[np.bool_]) -> ContactErrors:
        return ContactErrors(*(getattr(self, each.name)[rows] for each in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[ContactErrors]) -> ContactErrors:
        return cls(*(np.concatenate([getattr(each, field.name) for each in parts]) for field in fields(cls)))


def measure_errors(solved: SolvedScenario, *, widened: bool = False) -> ContactErrors:
    """Compute the errors of all frames of a solved scenario; forces without a scale are compared in the inferred scale.

    Parameters
    ----------
    solved : SolvedScenario
    widened : bool
        Use the standard deviations of the ensemble.
    """
    stated = solved.widened if widened else solved.frames
    parts = [
        _of_frame(solved, each, stated[k], *solved.true[k])
        for k, each in enumerate(solved.solution.unchecked)
        if (each.fn > 0).any()
    ]
    return ContactErrors.joined(parts)


def _of_frame(
    solved: SolvedScenario, before: FrameForces, frame: FrameForces, true_key: Keys, true: Array
) -> ContactErrors:
    """Compute the errors of one frame; before: the frame before its friction check."""
    force = np.column_stack([frame.fn, frame.ft])
    exact = match_values(frame.contacts.key, true_key, true)
    if not SCENARIOS[solved.scenario].scale_known:
        exact = exact * compare_forces(frame.contacts.key, force, true_key, true).scale
    mean = mean_normal_force(frame.fn)
    bearing = np.maximum(frame.fn, exact[:, 0]) > NEGLIGIBLE * mean
    count = int(bearing.sum())
    assert frame.sliding_probability is not None
    assert frame.bearing_probability is not None
    return ContactErrors(
        scenario=np.full(count, solved.scenario),
        seed=np.full(count, solved.seed),
        frame=np.full(count, frame.frame),
        group=groups_of(frame)[bearing],
        wall=frame.contacts.with_wall[bearing],
        sliding=frame.sliding_probability[bearing] > SLIDES,
        ambiguous=frame.bearing_probability[bearing] < UNCERTAIN,
        evidence_source=np.full(count, source_of_frame(frame), np.uint8),
        terms=np.tile(terms_of(before), (count, 1)),
        force=force[bearing] / mean,
        error=(force - exact)[bearing] / mean,
        sd=np.column_stack([frame.fn_sd, frame.ft_sd])[bearing] / mean,
        formula_sd=formula_sd_of(before)[bearing],
    )
