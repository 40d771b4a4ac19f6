"""Writes the macroscopic quantities of every frame as curves."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from solver.bodies.grains import Array
from solver.bodies.walls import Walls
from solver.statistics.frame_statistics import FrameStatistics

from ...results.schema import unit_of
from ..look import entities
from ..look.clock import Clock
from ..look.colours import SERIES
from ..look.scene import Scene
from ..look.texts import printable
from ..look.values import log_scalar, log_scalars

BAND_NAME = "95 %"
# Of entities.BANDED, the colours of their curves.
BAND_COLOURS = (SERIES[0], SERIES[2], SERIES[0], SERIES[1], SERIES[0], SERIES[0], SERIES[1])


def log_statistics_styles(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log names and colours of the curves."""
    for path, name, colour in (
        (entities.FRICTION_ANGLE, "friction angle φ [°]", SERIES[0]),
        (entities.WALL_RATIO_ANGLE, "wall ratio atan(T/N) [°]", SERIES[1]),
        (entities.PRINCIPAL_DIRECTION, "direction of σ₁ [°]", SERIES[2]),
        (entities.PRESSURE, "pressure [kPa]", SERIES[2]),
        (entities.SIGMA_1, "σ₁ [kPa]", SERIES[0]),
        (entities.SIGMA_2, "σ₂ [kPa]", SERIES[1]),
        (entities.ANISOTROPY_ANGLE, "φ of the anisotropies [°]", SERIES[2]),
        (entities.CONTACT_ANISOTROPY, "a_c contacts", SERIES[1]),
        (entities.BRANCH_ANISOTROPY, "a_l branches", SERIES[2]),
        (entities.NORMAL_FORCE_ANISOTROPY, "a_n normal forces", SERIES[0]),
        (entities.TANGENTIAL_FORCE_ANISOTROPY, "a_t tangential forces", SERIES[3]),
        (entities.MOBILISATION, "mobilisation |f_t| / μ f_n", SERIES[0]),
        (entities.TAIL_EXPONENT, "tail exponent β", SERIES[0]),
        (entities.PLATEAU_RATIO, "plateau ratio", SERIES[1]),
        (entities.STRONG_SHARE, "strong contacts", SERIES[1]),
        (entities.STRONG_PRESSURE_SHARE, "their share of the pressure", SERIES[0]),
        (entities.STRONG_DEVIATOR_SHARE, "their share of the deviator", SERIES[3]),
        (entities.CHAIN_COUNT, "force chains", SERIES[2]),
        (entities.CHAIN_GRAIN_SHARE, "grains in chains", SERIES[2]),
        (entities.COORDINATION_NUMBER, "coordination number z", SERIES[0]),
        (entities.COORDINATION_NUMBER_WITHOUT_RATTLERS, "z without rattlers", SERIES[1]),
        (entities.RATTLER_COUNT, "rattlers", SERIES[3]),
        (entities.CONTACT_COUNT, "contacts with force", SERIES[2]),
        (entities.SLIDING_FRACTION, "sliding fraction", SERIES[1]),
        (entities.MEAN_FN, f"mean f_n [{unit_of('statistics/mean_fn')}]", SERIES[0]),
        (entities.MAX_FN, f"greatest f_n [{unit_of('statistics/max_fn')}]", SERIES[1]),
        (entities.FABRIC_ANISOTROPY, "fabric anisotropy", SERIES[2]),
    ):
        stream.log(path, rr.SeriesLines(colors=[colour], names=name, widths=2.0), static=True)
    for path, colour in zip(entities.BANDED, BAND_COLOURS, strict=True):
        faint = (*colour[:3], 130)
        stream.log(path + entities.BAND, rr.SeriesLines(colors=[faint] * 2, names=[BAND_NAME] * 2, widths=[0.8] * 2),
                   static=True)  # fmt: skip
    walls = [printable(name) for name in scene.walls.name]
    hues = [SERIES[row % len(SERIES)] for row in range(len(walls))]
    for path in (entities.WALL_NORMAL_FORCE, entities.WALL_TANGENTIAL_FORCE):
        stream.log(path, rr.SeriesLines(colors=hues, names=walls, widths=[2.0] * len(walls)), static=True)
    if scene.walls.force is not None:
        pale = [(*hue[:3], 150) for hue in hues]
        told = [f"{name}, recorded" for name in walls]
        for path in (entities.WALL_NORMAL_RECORDED, entities.WALL_TANGENTIAL_RECORDED):
            stream.log(path, rr.SeriesLines(colors=pale, names=told, widths=[5.0] * len(walls)), static=True)


def log_statistics(clock: Clock, scene: Scene, statistics: FrameStatistics) -> None:
    """Log one frame's macroscopic quantities."""
    clock.end()
    for path, value in statistic_values(statistics):
        log_scalar(clock, path, float(value))
    for path, ends in band_values(statistics):
        log_scalars(clock, path, ends)
    walls = scene.walls_at(clock.frame)
    for path, values in wall_values(walls, statistics):
        log_scalars(clock, path, values)
    if scene.walls.force is not None:
        for path, values in recorded_values(walls, scene.walls.force[clock.frame]):
            clock.stream.log(path, rr.Scalars(np.where(np.isfinite(values), values, 0.0)))


def statistic_values(statistics: FrameStatistics) -> tuple[tuple[str, float], ...]:
    """Entity and value of every curve of one frame."""
    return (
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
        (entities.SIGMA_1, 1e-3 * statistics.sigma_1),
        (entities.SIGMA_2, 1e-3 * statistics.sigma_2),
        (entities.ANISOTROPY_ANGLE, math.degrees(statistics.friction_angle_of_anisotropies)),
        (entities.CONTACT_ANISOTROPY, statistics.contact_anisotropy),
        (entities.BRANCH_ANISOTROPY, statistics.branch_anisotropy),
        (entities.NORMAL_FORCE_ANISOTROPY, statistics.normal_force_anisotropy),
        (entities.TANGENTIAL_FORCE_ANISOTROPY, statistics.tangential_force_anisotropy),
        (entities.MOBILISATION, statistics.mobilisation),
        (entities.TAIL_EXPONENT, statistics.tail_exponent),
        (entities.PLATEAU_RATIO, statistics.plateau_ratio),
        (entities.STRONG_SHARE, statistics.strong_share),
        (entities.STRONG_PRESSURE_SHARE, statistics.strong_pressure_share),
        (entities.STRONG_DEVIATOR_SHARE, statistics.strong_deviator_share),
        (entities.CHAIN_COUNT, statistics.chain_count),
        (entities.CHAIN_GRAIN_SHARE, statistics.chain_grain_share),
    )


def band_values(statistics: FrameStatistics) -> tuple[tuple[str, Array], ...]:
    """Entity of every band, and its ends (2,): two standard deviations to either side, NaN where none is known."""
    value, two = dict(statistic_values(statistics)), 2.0 * np.array([-1.0, 1.0])
    told = (
        (entities.FRICTION_ANGLE, math.degrees(statistics.friction_angle_sd)),
        (entities.PRINCIPAL_DIRECTION, math.degrees(statistics.principal_direction_sd)),
        (entities.COORDINATION_NUMBER, statistics.coordination_number_sd),
        (entities.SLIDING_FRACTION, statistics.sliding_fraction_sd),
        (entities.MOBILISATION, statistics.mobilisation_sd),
        (entities.SIGMA_1, 1e-3 * statistics.sigma_1_sd),
        (entities.SIGMA_2, 1e-3 * statistics.sigma_2_sd),
    )
    return tuple((path + entities.BAND, value[path] + deviation * two) for path, deviation in told)


def recorded_values(walls: Walls, force: Array) -> tuple[tuple[str, Array], ...]:
    """Entity and values (w,) [N] of what sensors recorded of straight walls: force (w, 2) [N], NaN: none."""
    return (
        (entities.WALL_NORMAL_RECORDED, np.einsum("wk,wk->w", force, walls.outward)),
        (entities.WALL_TANGENTIAL_RECORDED, np.einsum("wk,wk->w", force, walls.direction)),
    )


def wall_values(walls: Walls, statistics: FrameStatistics) -> tuple[tuple[str, Array], ...]:
    """Entity and values (w,) [N] of the curves of the walls of the frame.

    Files of earlier versions have no sums over a wall's contacts; those of straight walls follow from its force.
    """
    force = np.broadcast_to(statistics.wall_force, (walls.count, 2))
    normal, tangential = statistics.wall_normal_force, statistics.wall_tangential_force
    if normal is None or tangential is None:
        normal = np.einsum("wk,wk->w", force, walls.outward)
        tangential = np.einsum("wk,wk->w", force, walls.direction)
    return ((entities.WALL_NORMAL_FORCE, normal), (entities.WALL_TANGENTIAL_FORCE, tangential))
