"""What a recording needs to know of all frames before it writes the first: they are gone through once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...results.results import Results
from ..look.force_style import ForceRange
from ..tabs.axis_ranges import CurveExtremes


@dataclass(frozen=True, slots=True)
class Survey:
    """Of all frames together."""

    contact_count: int  # a contact of several frames counts in each
    most_contacts: int  # of one frame
    force_range: ForceRange
    extremes: Mapping[str, tuple[float, float]]  # least and greatest value, by path of a curve
    has_error_budget: bool


def survey_frames(results: Results) -> Survey:
    """Go through all frames of results."""
    forces, extremes, budget = [], CurveExtremes(results.walls), False
    for frame, (each, statistics) in enumerate(zip(results.frames, results.statistics, strict=True)):
        forces.append(each.fn)
        extremes.add(frame, each, statistics)
        budget = budget or each.error_budget is not None
    return Survey(
        sum(map(len, forces)), max(map(len, forces), default=0), ForceRange.of_forces(forces), extremes.found, budget
    )
