"""Ranges of axes with space for the legend, which the viewer draws over the curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
from ...tracks import WallTracks
from ..curve_layers.statistic_curves import band_values, recorded_values, statistic_values, wall_values
from ..look import entities

Extremes = Mapping[str, tuple[float, float]]  # least and greatest value of the curves, by path

ENTRY, FRAME = 23.0, 18.0  # [px] height of a legend per entry, and of its frame
MAX_LEGEND_FRACTION = 0.55  # of the height of a plot
MARGIN = 0.06  # of the span, at an end without legend


class CurveExtremes:
    """Collects the least and greatest value of every curve that is known before the recording is written."""

    def __init__(self, walls: WallTracks) -> None:
        self._walls = walls
        self.found: dict[str, tuple[float, float]] = {}

    def add(self, frame: int, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Add the values of one frame."""
        values = [*statistic_values(statistics), (entities.CORRECTION, forces.correction)]
        values += [(entities.OLD_UNBALANCE, forces.old_unbalance), (entities.START_DIFFERENCE, forces.start_difference)]
        values += [(entities.FRAMES_SINCE_RESET, float(forces.frames_since_reset))]
        values += [(entities.SWEEP_COUNT, float(forces.sweeps))]
        if np.isfinite(forces.probability).any():
            values.append((entities.EXPECTED_COUNT, float(np.nansum(forces.probability))))
        if frame:
            values.append((entities.SIMILARITY, forces.similarity))
        walls = self._walls.at_rest(frame)
        for path, several in (*wall_values(walls, statistics), *band_values(statistics)):
            values += [(path, float(value)) for value in several]
        if self._walls.force is not None:
            for path, several in recorded_values(walls, self._walls.force[frame]):
                values += [(path, float(value)) for value in several]
        for path, value in values:
            if np.isfinite(value):
                low, high = self.found.get(path, (value, value))
                self.found[path] = min(low, value), max(high, value)


def range_with_legend(
    extremes: Extremes, paths: Sequence[str], *, entries: int, height: float, top: bool
) -> tuple[float, float] | None:
    """Return a range of the axis in which the legend covers no curve.

    Parameters
    ----------
    extremes : mapping
        Least and greatest value of the curves, by path.
    paths : sequence of str
        The curves of the plot.
    entries : int
        Lines of the legend; 0: no legend.
    height : float
        Height of the plot [px].
    top : bool
        The legend is at the top, otherwise at the bottom.

    Returns
    -------
    tuple of float, or None
        Ends of the range; None if no value is known.
    """
    known = [extremes[path] for path in paths if path in extremes]
    if not known:
        return None
    low, high = min(low for low, _ in known), max(high for _, high in known)
    span = high - low if high > low else max(abs(high), 1.0) * 0.2
    legend = min((ENTRY * entries + FRAME) / height, MAX_LEGEND_FRACTION) if entries else MARGIN
    extension = span * legend / (1.0 - legend)
    if top:
        return low - MARGIN * span, high + extension
    return low - extension, high + MARGIN * span
