"""What resists sliding: another friction of rods, walls or base, an attraction, or photographs in reverse order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...results.finding import Finding
from ...solver.convex.friction_check import BIAS
from ...solver.convex.resistance import FRAMES, Resistance, base_drag_of, find_in_sequence
from ...solver.nlgs.chain import ChainSettings, force_scale
from ..corrected_sequence import CorrectedSequence
from .causes import finding
from .data_quality import measure_data_quality

# Fraction of the contacts that slide beyond noise, from which on causes are named that act where they slide: forces
# that only push explain the noise of contacts at rest worse than forces of either sign. Sheared packings slide at .2
# and more; under a rising pressure, or nearly jammed, at less than .06, and there causes were named wrongly.
LEAST_SLIDING = 0.1
NEED_SLIDING = ("friction", "wall_friction", "adhesion", "photographs_reversed")
LEAST_NAMED = 0.005  # of the mean force: a lesser drag or attraction explains nothing, whatever else was fitted with it


def examine_resistance(sequence: CorrectedSequence) -> list[Finding]:
    """Name what resists the sliding other than the input states; empty where the input explains it best."""
    packing, snapshots = sequence.packing, sequence.snapshots
    probability = sequence.settings.for_radii(packing.grains.radius).ensemble.probability
    first = max(1, (len(snapshots) - FRAMES) // 2)
    unit = force_scale(packing, ChainSettings())
    found = find_in_sequence(packing, snapshots, first, unit, probability, sequence.settings.workers)
    if found is None or not found.cause or (found.cause == "friction" and sequence.friction_measured):
        return []
    if found.cause in NEED_SLIDING and not _slides(sequence):
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
    return [finding(found.cause, f"{words[found.cause]()}; with that, {left}")]


def _slides(sequence: CorrectedSequence) -> bool:
    """Whether so many contacts slide beyond noise that they can show what resists it."""
    quality = measure_data_quality(sequence.tracks, sequence.walls)
    return quality is not None and quality.sliding > LEAST_SLIDING


def _coefficient(sequence: CorrectedSequence, found: Resistance) -> str:
    """The coefficient of the base under its usual gravity; empty where no load or weight fixes the scale of forces."""
    if not sequence.packing.scale_is_known:
        return ""
    drag = base_drag_of(sequence.packing, found.found, force_scale(sequence.packing, ChainSettings()))
    return f", a coefficient of {drag / sequence.base_gravity:.3g}" if np.isfinite(drag) else ""
