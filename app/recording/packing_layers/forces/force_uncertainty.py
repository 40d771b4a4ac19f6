"""Writes the gaps in the lines of uncertain forces: the less is known of a force, the more of its line is missing."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ....drawing.uncertainty import Gaps, line_gaps, relative_uncertainty
from ....solver.bodies.grains import Array
from ....solver.frame_forces import FrameForces
from ...look import entities
from ...look.clock import Clock
from ...look.colours import BACKGROUND
from ...look.scene import Scene
from ...look.values import nullable, strips

MARGIN = 1.1  # width of a gap over that of its line
SHORTEST = 1e-3  # of the radius of a grain: half a stroke that would have no length


def log_force_uncertainty(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the gaps of the reported forces of one frame; sweeps have none, as their standard deviation is unknown."""
    none = np.zeros(forces.contacts.count, np.bool_)
    if clock.last > clock.first:
        clock.start()
        _log_gaps(clock, scene, forces, none)
    clock.end()
    _log_gaps(clock, scene, forces, np.nan_to_num(forces.fn) > 0.0)


def gap_strokes(gaps: Gaps, line_radius: NDArray[np.floating], mean_radius: float) -> tuple[Array, Array]:
    """Return strokes that hide gaps of lines: along a line where a gap is longer than the line is wide, else across.

    Parameters
    ----------
    gaps : Gaps
        Gaps (g,) [px].
    line_radius : array (g,)
        Half width of their lines [px].
    mean_radius : float
        Mean radius of the grains [px].

    Returns
    -------
    strokes : array (g, 2, 2)
        Their ends [px]; the viewer rounds them.
    radii : array (g,)
        Half of their width [px].
    """
    wide = MARGIN * np.asarray(line_radius, np.float64)
    long = gaps.length > 2.0 * wide
    radii = np.where(long, wide, 0.5 * gaps.length)
    half = np.maximum(np.where(long, 0.5 * gaps.length, wide) - radii, SHORTEST * mean_radius)
    across = np.stack([-gaps.direction[:, 1], gaps.direction[:, 0]], axis=1)
    arm = np.where(long[:, None], gaps.direction, across) * half[:, None]
    return np.stack([gaps.middle - arm, gaps.middle + arm], axis=1), radii


def _log_gaps(clock: Clock, scene: Scene, forces: FrameForces, visible: NDArray[np.bool_]) -> None:
    rows = np.flatnonzero(visible)
    contacts = forces.contacts.select(visible)
    lines = np.asarray(scene.branches(clock.frame, contacts), np.float64)
    if scene.walls.cell is not None:  # second halves of contacts across its edge
        across, halves = scene.far_halves(clock.frame, contacts)
        rows, lines = np.concatenate([rows, rows[across]]), np.concatenate([lines, scene.canvas.points(halves)])
    fn = forces.fn[rows]
    grain = scene.canvas.grain_radius
    gaps = line_gaps(lines, relative_uncertainty(fn, forces.fn_sd[rows]), grain)
    strokes, radii = gap_strokes(gaps, scene.style.radii(fn)[gaps.row], grain)
    quantum = scene.style.quantum
    clock.log(
        entities.FORCE_UNCERTAINTY,
        strips(strokes, np.ceil(radii / quantum) * quantum, BACKGROUND, 21.0),
        rr.AnyValues(
            fn=nullable(fn[gaps.row].astype(np.float32)),
            fn_sd=nullable(forces.fn_sd[rows][gaps.row].astype(np.float32)),
        ),
    )  # fmt: skip
