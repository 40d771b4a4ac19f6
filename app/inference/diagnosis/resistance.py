"""What resists sliding: another friction of rods, walls or base, an attraction, or photographs in reverse order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...results.finding import Finding
from ...solver.convex.friction_check import BIAS
from ...solver.convex.resistance import COMPARED_FRAMES, Resistance, base_drag_of, find_in_sequence
from ..corrected_sequence import CorrectedSequence
from .causes import finding
from .data_quality import FEW_SLIDING, measure_data_quality

# Fraction of the contacts that slide beyond noise, from which on causes are named that act where they slide.
LEAST_SLIDING = dict.fromkeys(("friction", "wall_friction", "adhesion"), FEW_SLIDING) | {
    # The wrong sense of all sliding shows with fewer: at .03 to .1 it lowered what contradicts the sliding to .2 to .5,
    # and was the best explanation of correct input only where at most .01 slide.
    "photographs_reversed": 0.02,
}
LEAST_NAMED = 0.005  # of the mean force: a lesser drag or attraction explains nothing, whatever else was fitted with it


def examine_resistance(sequence: CorrectedSequence, *, used: bool = False) -> list[Finding]:
    """Name what resists the sliding other than the input states; empty where the input explains it best.

    used: whether a run uses the friction of walls or base that it finds.
    """
    packing, snapshots = sequence.packing, sequence.snapshots
    probability = sequence.settings.for_radii(packing.grains.radius).ensemble.probability
    first = max(1, (len(snapshots) - COMPARED_FRAMES) // 2)
    found = find_in_sequence(packing, snapshots, first, probability, sequence.settings.workers)
    if found is None or not found.cause or (found.cause == "friction" and sequence.friction_measured):
        return []
    if not _slides(sequence, LEAST_SLIDING.get(found.cause, 0.0)):
        return []
    named = {"base_friction": found.found.base_drag, "adhesion": found.found.attraction}
    if named.get(found.cause, 1.0) < LEAST_NAMED:
        return []
    words: dict[str, Callable[[], str]] = {
        "photographs_reversed": lambda: "friction acts along the sliding as given, and against it in reverse order",
        "friction": lambda: (
            f"rods slide as with a friction of {found.found.friction / BIAS:.2f}, not {found.given.friction:g}"
        ),
        "wall_friction": lambda: (
            f"rods slide on walls as with a friction of {found.found.wall_friction:.2f}, not "
            f"{found.given.wall_friction:g}, and on one another as with {found.found.friction / BIAS:.2f}"
        ),
        "base_friction": lambda: (
            f"the base drags each rod by {100.0 * found.found.base_drag:.0f} % of the mean force"
            + _coefficient(sequence, found)
        ),
        "adhesion": lambda: f"rods attract one another by {100.0 * found.found.attraction:.0f} % of the mean force",
        "rolling_resistance": lambda: (
            f"contacts resist rolling by {found.found.rolling:.2f} of f_n times the rolling radius"
        ),
    }
    left = f"what contradicts the sliding falls from {100.0 * found.given_gap:.0f} to {100.0 * found.found_gap:.0f} %"
    # `sequence` is that of the input as stated; a run uses such a coefficient unless its settings forbid it.
    corrected = found.cause in ("wall_friction", "base_friction") and used
    return [finding(found.cause, f"{words[found.cause]()}; with that, {left}", corrected=corrected)]


def _slides(sequence: CorrectedSequence, least: float) -> bool:
    """Whether more than a fraction of the contacts slide beyond noise."""
    if not least:
        return True
    quality = measure_data_quality(sequence.tracks, sequence.walls)
    return quality is not None and quality.sliding > least


def _coefficient(sequence: CorrectedSequence, found: Resistance) -> str:
    """The coefficient of the base under its usual gravity; empty where no load or weight fixes the scale of forces."""
    if not sequence.packing.scale_is_known:
        return ""
    drag = base_drag_of(sequence.packing, found.found)
    return f", a coefficient of {drag / sequence.base_gravity:.3g}" if np.isfinite(drag) else ""
