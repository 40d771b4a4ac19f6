"""Ranges of axes that leave room for the legend: the viewer draws it over the curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from solver.bodies.walls import Walls
from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...tracks import WallTracks
from ..curve_layers.statistic_curves import band_values, recorded_values, statistic_values, wall_values
from ..look import entities

Extremes = Mapping[str, tuple[float, float]]  # of the curves at a path

ENTRY, FRAME = 23.0, 18.0  # px of a legend, per entry and around them
MOST_ROOM = 0.55  # of a plot, for its legend
MARGIN = 0.06  # of the span, where there is no legend


class CurveExtremes:
    """Least and greatest value of every curve whose values are known before the recording is written."""

    def __init__(self, walls: WallTracks) -> None:
        self._walls = walls
        self.found: dict[str, tuple[float, float]] = {}

    def add(self, frame: int, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Have them hold one frame, a row of the walls."""
        values = [*statistic_values(statistics), (entities.CORRECTION, forces.correction)]
        values += [(entities.OLD_UNBALANCE, forces.old_unbalance), (entities.START_DIFFERENCE, forces.start_difference)]
        values += [(entities.FRAMES_SINCE_RESET, float(forces.frames_since_reset))]
        values += [(entities.SWEEP_COUNT, float(forces.sweeps))]
        if np.isfinite(forces.probability).any():
            values.append((entities.EXPECTED_COUNT, float(np.nansum(forces.probability))))
        if frame:
            values.append((entities.SIMILARITY, forces.similarity))
        walls = Walls.at_rest(self._walls.endpoints[frame], side=self._walls.side)
        for path, several in (*wall_values(walls, statistics), *band_values(statistics)):
            values += [(path, float(value)) for value in several]
        if self._walls.force is not None:
            for path, several in recorded_values(walls, self._walls.force[frame]):
                values += [(path, float(value)) for value in several]
        for path, value in values:
            if np.isfinite(value):
                low, high = self.found.get(path, (value, value))
                self.found[path] = min(low, value), max(high, value)


def range_with_room(
    extremes: Extremes, paths: Sequence[str], *, entries: int, height: float, top: bool
) -> tuple[float, float] | None:
    """A range of the axis in which `entries` lines of legend cover no curve; None where no value is known.

    height [px] of the plot; top: where the legend is.
    """
    known = [extremes[path] for path in paths if path in extremes]
    if not known:
        return None
    low, high = min(low for low, _ in known), max(high for _, high in known)
    span = high - low if high > low else max(abs(high), 1.0) * 0.2
    room = min((ENTRY * entries + FRAME) / height, MOST_ROOM) if entries else MARGIN
    wide = span * room / (1.0 - room)
    if top:
        return low - MARGIN * span, high + wide
    return low - wide, high + MARGIN * span
