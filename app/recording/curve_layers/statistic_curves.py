"""Writes the macroscopic quantities of every frame as curves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import rerun as rr

from ...results.schema import unit_of
from ...solver.bodies.grains import Array
from ...solver.bodies.walls import Walls
from ...solver.statistics.frame_statistics import FrameStatistics
from ..look import entities
from ..look.axes import log_texts
from ..look.clock import Clock
from ..look.colours import MARKERS, SERIES, Marker, Rgba, style_of_series
from ..look.printable_text import printable
from ..look.scene import Scene
from ..look.values import log_curve_style, log_scalar, log_scalars

MARKER_SIZE = 4.5  # [px] of the viewer, half of it
KEY_WIDTH, LETTER_WIDTH, KEY_MARGIN = 600.0, 8.0, 20.0  # of the key of walls: whole, of a letter, around a name
KILO, DEGREES = 1e-3, math.degrees(1.0)


class Curve(NamedTuple):
    """One quantity over time; its entity ends with the name of the field."""

    path: str
    name: str  # in the legend
    colour: Rgba
    unit: float = 1.0  # factor from the stored to the displayed value

    @property
    def field(self) -> str:
        """Field of FrameStatistics."""
        return self.path.rpartition("/")[2]


CURVES = (
    Curve(entities.FRICTION_ANGLE, "friction angle φ [°]", SERIES[0], DEGREES),
    Curve(entities.WALL_RATIO_ANGLE, "wall ratio atan(T/N) [°]", SERIES[1], DEGREES),
    Curve(entities.PRINCIPAL_DIRECTION, "direction of σ₁ [°]", SERIES[2], DEGREES),
    Curve(entities.PRESSURE, "pressure [kPa]", SERIES[2], KILO),
    Curve(entities.COORDINATION_NUMBER, "coordination number z", SERIES[0]),
    Curve(entities.COORDINATION_NUMBER_WITHOUT_RATTLERS, "z without rattlers", SERIES[1]),
    Curve(entities.RATTLER_COUNT, "rattlers", SERIES[3]),
    Curve(entities.CONTACT_COUNT, "contacts with force", SERIES[2]),
    Curve(entities.SLIDING_FRACTION, "sliding fraction", SERIES[1]),
    Curve(entities.MEAN_FN, f"mean f_n [{unit_of('statistics/mean_fn')}]", SERIES[0]),
    Curve(entities.MAX_FN, f"greatest f_n [{unit_of('statistics/max_fn')}]", SERIES[1]),
    Curve(entities.FABRIC_ANISOTROPY, "fabric anisotropy", SERIES[2]),
    Curve(entities.SIGMA_1, "σ₁ [kPa]", SERIES[0], KILO),
    Curve(entities.SIGMA_2, "σ₂ [kPa]", SERIES[1], KILO),
    Curve(entities.ANISOTROPY_ANGLE, "φ of the anisotropies [°]", SERIES[2], DEGREES),
    Curve(entities.CONTACT_ANISOTROPY, "a_c contacts", SERIES[1]),
    Curve(entities.BRANCH_ANISOTROPY, "a_l branches", SERIES[2]),
    Curve(entities.NORMAL_FORCE_ANISOTROPY, "a_n normal forces", SERIES[0]),
    Curve(entities.TANGENTIAL_FORCE_ANISOTROPY, "a_t tangential forces", SERIES[3]),
    Curve(entities.MOBILISATION, "mobilisation |f_t| / μ f_n", SERIES[0]),
    Curve(entities.TAIL_EXPONENT, "tail exponent β", SERIES[0]),
    Curve(entities.PLATEAU_RATIO, "plateau ratio", SERIES[1]),
    Curve(entities.STRONG_FRACTION, "strong contacts", SERIES[1]),
    Curve(entities.STRONG_PRESSURE_FRACTION, "their fraction of the pressure", SERIES[0]),
    Curve(entities.STRONG_DEVIATOR_FRACTION, "their fraction of the deviator", SERIES[3]),
    Curve(entities.CHAIN_COUNT, "force chains", SERIES[2]),
    Curve(entities.CHAIN_GRAIN_FRACTION, "grains in chains", SERIES[2]),
)


def log_statistics_styles(stream: rr.RecordingStream, scene: Scene) -> None:
    """Log names and colours of the curves."""
    for curve in CURVES:
        log_curve_style(stream, curve.path, curve.name, curve.colour)
        band = rr.SeriesLines(colors=[curve.colour] * 2, names=[curve.name] * 2, widths=[0.6] * 2)
        stream.log(curve.path + entities.BAND, band, static=True)
    walls = [printable(name) for name in scene.walls.name]
    styles = [style_of_series(row) for row in range(len(walls))]
    hues: list[Rgba] = [hue for hue, _ in styles]
    markers: list[Marker] = [marker for _, marker in styles]
    for path in (entities.WALL_NORMAL_FORCE, entities.WALL_TANGENTIAL_FORCE):
        lines = rr.SeriesLines(colors=hues, names=walls, widths=[2.0] * len(walls))
        points = rr.SeriesPoints(colors=hues, names=walls, markers=markers, marker_sizes=[MARKER_SIZE] * len(walls))
        stream.log(path, lines, points, static=True)
    named = [f"{MARKERS[marker]} {name}" for marker, name in zip(markers, walls, strict=True)]
    log_texts(stream, entities.WALL_KEY, list(zip(_places_of(named), named, hues, strict=True)))
    if scene.walls.force is not None:
        pale = [(*hue[:3], 150) for hue in hues]
        for path in (entities.WALL_NORMAL_RECORDED, entities.WALL_TANGENTIAL_RECORDED):
            stream.log(path, rr.SeriesLines(colors=pale, names=walls, widths=[5.0] * len(walls)), static=True)


def _places_of(names: list[str]) -> list[Array]:
    """Return the middles of names in rows that hold as many as fit."""
    rows: list[list[float]] = [[]]
    for name in names:
        width = LETTER_WIDTH * len(name) + KEY_MARGIN
        if rows[-1] and sum(rows[-1]) + width > KEY_WIDTH:
            rows.append([])
        rows[-1].append(width)
    places = []
    for k, widths in enumerate(rows):
        wide = np.array(widths) + (KEY_WIDTH - sum(widths)) / max(len(widths), 1)  # names of a row share the space
        middles = np.cumsum(wide) - 0.5 * wide
        places += [np.array([middle, 12.0 + 24.0 * k]) for middle in middles]
    return places


def log_statistics(clock: Clock, scene: Scene, statistics: FrameStatistics) -> None:
    """Log the macroscopic quantities of one frame."""
    clock.end()
    for path, value in statistic_values(statistics):
        log_scalar(clock, path, float(value))
    for path, ends in band_values(statistics):
        log_scalars(clock, path, ends)
    walls = scene.walls.at_rest(clock.frame)
    for path, values in wall_values(walls, statistics):
        log_scalars(clock, path, values)
    if scene.walls.force is not None:
        for path, values in recorded_values(walls, scene.walls.force[clock.frame]):
            clock.send_point(path, np.where(np.isfinite(values), values, 0.0).tolist())


def statistic_values(statistics: FrameStatistics) -> tuple[tuple[str, float], ...]:
    """Return entity and value of every curve of one frame."""
    return tuple((curve.path, curve.unit * getattr(statistics, curve.field)) for curve in CURVES)


def band_values(statistics: FrameStatistics) -> tuple[tuple[str, Array], ...]:
    """Return entity and ends (2,) of every band: value ∓ two standard deviations, NaN where these are not known."""
    factors = 2.0 * np.array([-1.0, 1.0])
    return tuple(
        (
            curve.path + entities.BAND,
            curve.unit * (getattr(statistics, curve.field) + factors * getattr(statistics, f"{curve.field}_sd")),
        )
        for curve in CURVES
    )


def recorded_values(walls: Walls, force: Array) -> tuple[tuple[str, Array], ...]:
    """Return entity and values (w,) [N] of the forces recorded by sensors.

    Parameters
    ----------
    walls : Walls
        The walls, straight ones with a sensor.
    force : array (w, 2)
        Recorded force on every wall [N]; NaN: none.
    """
    return (
        (entities.WALL_NORMAL_RECORDED, np.einsum("wk,wk->w", force, walls.outward)),
        (entities.WALL_TANGENTIAL_RECORDED, np.einsum("wk,wk->w", force, walls.direction)),
    )


def wall_values(walls: Walls, statistics: FrameStatistics) -> tuple[tuple[str, Array], ...]:
    """Return entity and values (w,) [N] of the curves of the wall forces of a frame.

    Files of earlier versions have no sums over the contacts of a wall; for straight walls they follow from its force.
    """
    force = np.broadcast_to(statistics.wall_force, (walls.count, 2))
    normal, tangential = statistics.wall_normal_force, statistics.wall_tangential_force
    if normal is None or tangential is None:
        normal = np.einsum("wk,wk->w", force, walls.outward)
        tangential = np.einsum("wk,wk->w", force, walls.direction)
    return ((entities.WALL_NORMAL_FORCE, normal), (entities.WALL_TANGENTIAL_FORCE, tangential))
