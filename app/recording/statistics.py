"""Writes the macroscopic quantities of every frame as curves."""

from __future__ import annotations

import math

import rerun as rr

from app.recording import entities
from app.recording.colours import SERIES
from app.recording.scene import Clock
from app.recording.values import log_scalar
from solver.frame_statistics import FrameStatistics


def log_statistics_styles(stream: rr.RecordingStream) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.FRICTION_ANGLE, "friction angle φ [°]", SERIES[0]),
        (entities.WALL_RATIO_ANGLE, "wall ratio atan(T/N) [°]", SERIES[1]),
        (entities.PRINCIPAL_DIRECTION, "direction of σ₁ [°]", SERIES[2]),
        (entities.PRESSURE, "pressure [kPa]", SERIES[2]),
        (entities.COORDINATION_NUMBER, "coordination number z", SERIES[0]),
        (entities.COORDINATION_NUMBER_WITHOUT_RATTLERS, "z without rattlers", SERIES[1]),
        (entities.RATTLER_COUNT, "rattlers", SERIES[3]),
        (entities.CONTACT_COUNT, "contacts with force", SERIES[2]),
        (entities.SLIDING_FRACTION, "sliding fraction", SERIES[1]),
        (entities.MEAN_FN, "mean f_n [N]", SERIES[0]),
        (entities.MAX_FN, "greatest f_n [N]", SERIES[1]),
        (entities.FABRIC_ANISOTROPY, "fabric anisotropy", SERIES[2]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)


def log_statistics(clock: Clock, statistics: FrameStatistics) -> None:
    """Log one frame's macroscopic quantities."""
    clock.end()
    for path, value in (
        (entities.FRICTION_ANGLE, math.degrees(statistics.friction_angle)),
        (entities.WALL_RATIO_ANGLE, math.degrees(statistics.wall_ratio_angle)),
        (entities.PRINCIPAL_DIRECTION, math.degrees(statistics.principal_direction)),
        (entities.PRESSURE, 1e-3 * statistics.pressure),
        (entities.COORDINATION_NUMBER, statistics.coordination_number),
        (entities.COORDINATION_NUMBER_WITHOUT_RATTLERS, statistics.coordination_number_without_rattlers),
        (entities.RATTLER_COUNT, statistics.rattler_count),
        (entities.CONTACT_COUNT, statistics.contact_count),
        (entities.SLIDING_FRACTION, statistics.sliding_fraction),
        (entities.MEAN_FN, statistics.mean_fn),
        (entities.MAX_FN, statistics.max_fn),
        (entities.FABRIC_ANISOTROPY, statistics.fabric_anisotropy),
    ):
        log_scalar(clock, path, float(value))
