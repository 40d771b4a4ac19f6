"""Writes a dim edge along the contacts: as wide as the force would be drawn that is two standard deviations larger."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.sequence.frame_forces import FrameForces

from ...look import entities
from ...look.clock import Clock
from ...look.colours import packed
from ...look.scene import Scene

DEVIATIONS = 2.0  # as the bands of curves
DIM = 0.42  # of the force's own colour


def log_force_doubt(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the edges of one frame's reported forces; while it is swept there are none, for sweeps have no deviation."""
    style = scene.style
    fn, sd = np.nan_to_num(forces.fn), np.nan_to_num(forces.fn_sd)
    radius = style.radii(fn + DEVIATIONS * sd)
    seen = (fn > style.range.weak) & (radius > style.radii(fn))  # a grey line has no edge, nor has one of no width
    if clock.last > clock.first:
        clock.start()
        _log_edges(clock, scene, forces, radius, np.zeros_like(seen))
    clock.end()
    _log_edges(clock, scene, forces, radius, seen)


def _log_edges(
    clock: Clock, scene: Scene, forces: FrameForces, radius: NDArray[np.float32], seen: NDArray[np.bool_]
) -> None:
    colours = scene.style.colours(np.nan_to_num(forces.fn[seen]))
    shades = np.stack([(colours >> shift) & 0xFF for shift in (24, 16, 8, 0)], axis=-1).astype(np.float64)
    dim = np.rint(shades * [DIM, DIM, DIM, 1.0]).astype(np.uint8)
    clock.stream.log(
        entities.FORCE_DOUBT,
        rr.LineStrips2D(
            scene.branches(clock.frame, forces.contacts.select(seen)), radii=radius[seen], colors=packed(dim),
            draw_order=19.0,
        ),
    )  # fmt: skip
