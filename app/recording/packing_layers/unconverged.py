"""Writes where a frame has not converged: the unbalance of every grain and the change of every contact.

Both maps are of the forces as recorded, on the contacts of the frame, over the mean f_n of the reported field. The
change is that of one sweep, on average since the recorded sweep before; the last row of a frame, which is that of the
reported field, keeps the change with which the chain ended.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameForces
from solver.statistics.balance import unbalances
from solver.statistics.force_statistics import mean_normal_force

from ..look import entities
from ..look.clock import Clock
from ..look.colours import DOUBT_RAMP, OPEN, packed, packed_one
from ..look.scene import Scene
from .forces.network import SweepChoice, visible_sweeps
from .grains_and_walls import last_seen

DECADES = (-4.0, 0.0)  # log10 of the mean f_n: the ends of the colour ramp for an unbalance
SWEEP_SHARE = 0.01  # that times as much for the change of one sweep
LEVELS = 33  # colours that are told apart: few of them keep the file small

_RAMP = packed(DOUBT_RAMP)[np.round(np.linspace(0, len(DOUBT_RAMP) - 1, LEVELS)).astype(int)]
_OPEN = packed_one(OPEN)


def log_unconverged(
    clock: Clock, scene: Scene, forces: FrameForces, drawn: FrameForces, choice: SweepChoice, kept: int
) -> None:
    """Log both maps of one frame at no more than `kept` of its sweeps, and of the reported field.

    drawn: the frame with the contacts whose change is shown; every contact counts in the unbalance.
    """
    thinned = SweepChoice.NONE if choice is SweepChoice.NONE else SweepChoice.LOG
    rows, fn, ft = visible_sweeps(forces, clock.last - clock.first, thinned, kept)
    mean = mean_normal_force(forces.fn)  # of the reported field: what every row is measured by
    unbalance = unbalances(forces.contacts, fn, ft, scene.weight) / mean
    if drawn is not forces:
        rows, fn, ft = visible_sweeps(drawn, clock.last - clock.first, thinned, kept)
    change = np.full(fn.shape, np.nan)
    if len(rows) > 2:
        change[1:-1] = changes_per_sweep(rows[:-1], fn[:-1], ft[:-1]) / (SWEEP_SHARE * mean)
        change[-1] = change[-2]
    lost = ~scene.tracks.present[clock.frame]
    unbalance[:, lost | ~scene.grains.free] = np.nan  # no balance is asked of the boundary
    clock.start()
    clock.stream.log(
        entities.UNBALANCE_MAP,
        rr.Points2D(
            scene.canvas.points(last_seen(scene.tracks.position, clock.frame)).astype(np.float32),
            radii=(0.94 * scene.canvas.lengths(scene.tracks.radius)).astype(np.float32),
            colors=doubt_colours(unbalance[0]),
            draw_order=5.0,
        ),
    )
    clock.stream.log(
        entities.CHANGE_MAP,
        rr.LineStrips2D(
            scene.branches(clock.frame, drawn.contacts),
            radii=np.float32(0.1 * scene.canvas.grain_radius),
            colors=doubt_colours(change[0]),
            draw_order=20.0,
        ),
    )
    if len(rows) == 1:
        return
    when = clock.columns(rows[1:])
    for path, colours, columns in (
        (entities.UNBALANCE_MAP, doubt_colours(unbalance[1:]), rr.Points2D.columns),
        (entities.CHANGE_MAP, doubt_colours(change[1:]), rr.LineStrips2D.columns),
    ):
        if colours.size:
            lengths = np.full(len(colours), colours.shape[1])
            clock.stream.send_columns(path, when, columns(colors=colours.ravel()).partition(lengths))


def changes_per_sweep(sweep: NDArray[np.int64], fn: NDArray[np.floating], ft: NDArray[np.floating]) -> Array:
    """How much a force changes in a sweep [N] (r − 1, c), on average between sweeps (r,) with forces (r, c) [N]."""
    change = np.hypot(np.diff(fn, axis=0), np.diff(ft, axis=0))
    return np.asarray(change / np.diff(sweep)[:, None], np.float64)


def doubt_colours(share: Array) -> NDArray[np.uint32]:
    """Colours of values over the mean force, from quiet (small) to loud on a logarithmic ramp; faint if unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.log10(share)
    place = np.clip((power - DECADES[0]) / (DECADES[1] - DECADES[0]), 0.0, 1.0)
    level = np.round(np.nan_to_num(place) * (LEVELS - 1)).astype(np.int64)
    return np.where(np.isfinite(share), _RAMP[level], _OPEN).astype(np.uint32)
