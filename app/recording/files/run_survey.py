"""Collects the values of all frames that a recording needs before its first frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...drawing.force_range import ForceRange
from ...results.results import Results
from ..tabs.axis_ranges import CurveExtremes


@dataclass(frozen=True, slots=True)
class Survey:
    """Counts and ranges over all frames."""

    contact_count: int  # contact rows of all frames
    most_contacts: int  # contacts of one frame
    force_range: ForceRange
    extremes: Mapping[str, tuple[float, float]]  # least and greatest value, by path of a curve
    has_error_budget: bool


def survey_frames(results: Results) -> Survey:
    """Return counts and ranges over all frames of results."""
    forces, extremes, budget = [], CurveExtremes(results.walls), False
    for frame, (each, statistics) in enumerate(zip(results.frames, results.statistics, strict=True)):
        forces.append(each.fn)
        extremes.add(frame, each, statistics)
        budget = budget or each.error_budget is not None
    return Survey(
        sum(map(len, forces)), max(map(len, forces), default=0), ForceRange.of_forces(forces), extremes.found, budget
    )
