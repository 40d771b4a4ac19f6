"""Writes a dim edge along the contacts, as wide as a force larger by two standard deviations."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ....solver.frame_forces import FrameForces
from ...look import entities
from ...look.clock import Clock
from ...look.colours import packed
from ...look.scene import Scene

STANDARD_DEVIATIONS = 2.0  # as for the bands of curves
DIM = 0.42  # of the brightness of the line of the force


def log_force_uncertainty(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the edges of the reported forces of one frame; sweeps have none, as their standard deviation is unknown."""
    style = scene.style
    fn, sd = np.nan_to_num(forces.fn), np.nan_to_num(forces.fn_sd)
    radius = style.radii(fn + STANDARD_DEVIATIONS * sd)
    visible = (fn > style.range.weak) & (radius > style.radii(fn))  # without edges of grey lines and edges of no width
    if clock.last > clock.first:
        clock.start()
        _log_edges(clock, scene, forces, radius, np.zeros_like(visible))
    clock.end()
    _log_edges(clock, scene, forces, radius, visible)


def _log_edges(
    clock: Clock, scene: Scene, forces: FrameForces, radius: NDArray[np.float32], visible: NDArray[np.bool_]
) -> None:
    colours = scene.style.colours(np.nan_to_num(forces.fn[visible]))
    shades = np.stack([(colours >> shift) & 0xFF for shift in (24, 16, 8, 0)], axis=-1).astype(np.float64)
    dim = np.rint(shades * [DIM, DIM, DIM, 1.0]).astype(np.uint8)
    clock.stream.log(
        entities.FORCE_UNCERTAINTY,
        rr.LineStrips2D(
            scene.branches(clock.frame, forces.contacts.select(visible)), radii=radius[visible], colors=packed(dim),
            draw_order=19.0,
        ),
    )  # fmt: skip
