"""Writes photoelastic fringes beside the forces: maps of the discs, the curve between both, and their correlation."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ....solver.assessment.fringe_pressures import FringePressures
from ....solver.bodies.grains import Array
from ...look import entities
from ...look.axes import Axes, round_ticks
from ...look.clock import Clock
from ...look.colours import FAINT, INK, SERIES
from ...look.scene import Scene
from ...look.values import dots, log_curve_style, log_scalar, strips
from .grain_map import GrainMap, usual_top

WIDTH, HEIGHT = 600.0, 300.0  # of the plot, in units of its view
FRINGE_BOUNDS = ((-60.0, WIDTH + 25.0), (-15.0, HEIGHT + 45.0))  # of a view with its labels
MOST_POINTS = 20_000  # of all frames in the plot


class FringeMaps:
    """Maps, plot and curve of the fringes of one run; sums of forces over their mean."""

    def __init__(self, scene: Scene, found: FringePressures, fringes: Array) -> None:
        self._scene, self._found, self._fringes = scene, found, fringes
        self._inferred, measured = found.inferred / found.mean, found.measured / found.mean
        top = usual_top(self._inferred, measured)
        difference = found.residual / found.mean
        self._maps = tuple(
            (
                GrainMap(f"{entities.FRINGE_MAPS}/{name}", f"{entities.FRINGE_LEGENDS}/{name}", " × mean", end, ramp),
                value,
            )
            for name, value, end, ramp in (
                (entities.BY_FRINGES, measured, top, "force"),
                (entities.BY_FORCES, self._inferred, top, "force"),
                (entities.FRINGE_RESIDUAL, difference, usual_top(difference), "difference"),
            )
        )  # fmt: skip
        self._axes = Axes((0.0, 1.05 * usual_top(fringes)), (0.0, 1.2 * top), WIDTH, HEIGHT)

    def log_styles(self, stream: rr.RecordingStream) -> None:
        """Log legends, axes, the curve with the discs of all frames, and the name of the correlation."""
        for each, _ in self._maps:
            each.log_legend(stream, self._scene)
        (_, right), (_, high) = self._axes.x_range, self._axes.y_range
        self._axes.log(
            stream, entities.FRINGE_AXES, x_ticks=round_ticks(0.0, right, 3.0),
            y_ticks=round_ticks(0.0, high, 3.0),
            notes=[
                (0.78 * right, 0.1 * high, "across: G² of a disc", INK),
                (0.24 * right, 0.97 * high, "up: sum of its f_n over the mean", INK),
                (0.6 * right, 0.97 * high, "this frame", SERIES[0]), (0.8 * right, 0.97 * high, "curve", SERIES[1]),
            ],
        )  # fmt: skip
        known = np.flatnonzero((np.isfinite(self._fringes) & np.isfinite(self._inferred)).ravel())
        kept = known[:: max(1 + (len(known) - 1) // MOST_POINTS, 1)]
        self._log_points(
            stream, entities.FRINGES_OF_ALL, self._fringes.ravel()[kept], self._inferred.ravel()[kept], static=True
        )
        curve = self._axes.points(self._found.knot, np.minimum(self._found.level / self._found.mean, high))
        stream.log(entities.FRINGE_CURVE, strips([curve], 1.6, SERIES[1], 30.0), static=True)
        log_curve_style(stream, entities.FRINGE_CORRELATION, "r of the sums by fringes and by forces", SERIES[0])

    def log(self, clock: Clock) -> None:
        """Log the maps, the discs in the plot and the correlation of one frame."""
        clock.start()
        for each, value in self._maps:
            each.log(clock, self._scene, value[clock.frame])
        clock.end()
        known = np.isfinite(self._fringes[clock.frame]) & np.isfinite(self._inferred[clock.frame])
        values = self._fringes[clock.frame, known], self._inferred[clock.frame, known]
        self._log_points(clock, entities.FRINGES_OF_FRAME, *values, static=False)
        log_scalar(clock, entities.FRINGE_CORRELATION, float(self._found.correlation[clock.frame]))

    def _log_points(
        self, stream: rr.RecordingStream | Clock, path: str, fringes: Array, sums: Array, *, static: bool
    ) -> None:
        points = self._axes.points(
            np.minimum(fringes, self._axes.x_range[1]), np.minimum(sums, self._axes.y_range[1])
        )  # fmt: skip
        colour = (*FAINT[:3], 130) if static else (*SERIES[0][:3], 220)
        stream.log(path, dots(points, *((1.4, colour, 10.0) if static else (2.6, colour, 20.0))), static=static)
