"""Writes maps of the residuals of a frame: the force residual of every grain and the change of every contact.

Both are computed from the recorded forces on the contacts of the frame and divided by the mean f_n of the reported
field. The change is that of one sweep, averaged since the recorded sweep before; the last row of a frame, the reported
field, keeps the last change of the chain.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces
from ...solver.statistics.balance import resultant_norms
from ...solver.statistics.force_statistics import mean_normal_force
from ..look import entities
from ..look.clock import Clock
from ..look.colours import OPEN, UNCERTAINTY_RAMP, packed, packed_one
from ..look.scene import Scene
from ..look.values import dots, strips
from .forces.network import SweepChoice, visible_sweeps
from .grains_and_walls import last_seen

DECADES = (-4.0, 0.0)  # log10 of the mean f_n: the ends of the colour ramp for an unbalance
SWEEP_FRACTION = 0.01  # factor of these ends for the change of one sweep
LEVELS = 33  # distinct colours: few keep the file small

_RAMP = packed(UNCERTAINTY_RAMP)[np.round(np.linspace(0, len(UNCERTAINTY_RAMP) - 1, LEVELS)).astype(int)]
_OPEN = packed_one(OPEN)


def log_residual_maps(
    clock: Clock, scene: Scene, forces: FrameForces, drawn: FrameForces, choice: SweepChoice, kept: int
) -> None:
    """Log both maps of one frame.

    Parameters
    ----------
    clock : Clock
        The frame on the timelines.
    scene : Scene
        The run.
    forces : FrameForces
        The frame; all its contacts count in the residuals.
    drawn : FrameForces
        The frame with the contacts whose change is drawn.
    choice : SweepChoice
        The sweeps that are recorded, beside the reported field.
    kept : int
        Greatest number of sweeps.
    """
    thinned = SweepChoice.NONE if choice is SweepChoice.NONE else SweepChoice.LOG
    rows, fn, ft = visible_sweeps(forces, clock.last - clock.first, thinned, kept)
    mean = mean_normal_force(forces.fn)  # of the reported field, for all rows
    unbalance = resultant_norms(forces.contacts, fn, ft, scene.weight) / mean
    if drawn is not forces:
        rows, fn, ft = visible_sweeps(drawn, clock.last - clock.first, thinned, kept)
    change = np.full(fn.shape, np.nan)
    if len(rows) > 2:
        change[1:-1] = changes_per_sweep(rows[:-1], fn[:-1], ft[:-1]) / (SWEEP_FRACTION * mean)
        change[-1] = change[-2]
    lost = ~scene.tracks.frame(clock.frame).present[0]
    unbalance[:, lost | ~scene.grains.free] = np.nan  # boundary grains need no balance
    clock.start()
    places = scene.canvas.points(last_seen(scene.tracks.position, clock.frame))
    radii = 0.94 * scene.canvas.lengths(scene.tracks.radius)
    clock.log(entities.UNBALANCE_MAP, dots(places, radii, residual_colours(unbalance[0]), 5.0))
    lines = scene.branches(clock.frame, drawn.contacts)
    clock.log(entities.CHANGE_MAP, strips(lines, 0.1 * scene.canvas.grain_radius, residual_colours(change[0]), 20.0))
    if len(rows) == 1:
        return
    when = clock.columns(rows[1:])
    for path, colours, columns in (
        (entities.UNBALANCE_MAP, residual_colours(unbalance[1:]), rr.Points2D.columns),
        (entities.CHANGE_MAP, residual_colours(change[1:]), rr.LineStrips2D.columns),
    ):
        if colours.size:
            lengths = np.full(len(colours), colours.shape[1])
            clock.send(path, when, columns(colors=colours.ravel()).partition(lengths))


def changes_per_sweep(sweep: NDArray[np.int64], fn: NDArray[np.floating], ft: NDArray[np.floating]) -> Array:
    """Return the mean change of a force per sweep.

    Parameters
    ----------
    sweep : array (r,)
        Numbers of the recorded sweeps.
    fn, ft : array (r, c)
        Forces in these sweeps [N].

    Returns
    -------
    array (r − 1, c)
        |Δf| / Δsweep between consecutive recorded sweeps [N].
    """
    change = np.hypot(np.diff(fn, axis=0), np.diff(ft, axis=0))
    return np.asarray(change / np.diff(sweep)[:, None], np.float64)


def residual_colours(ratio: Array) -> NDArray[np.uint32]:
    """Return colours of ratios to the mean force on a logarithmic ramp, dark for small values; faint if unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.log10(ratio)
    place = np.clip((power - DECADES[0]) / (DECADES[1] - DECADES[0]), 0.0, 1.0)
    level = np.round(np.nan_to_num(place) * (LEVELS - 1)).astype(np.int64)
    return np.where(np.isfinite(ratio), _RAMP[level], _OPEN).astype(np.uint32)
