"""Draws the difference of two force fields: width by its magnitude, colour by its sign."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ....drawing.force_range import DIFFERENCE_FRACTION, ForceRange
from ....solver.bodies.grains import Array
from ....solver.contacts.contacts import measure_pairs
from ...look import entities
from ...look.clock import Clock
from ...look.colours import DIFFERENCE_RAMP, OPEN, packed, packed_one
from ...look.force_style import ForceStyle
from ...look.ramp_legend import PIECES, log_ramp_legend
from ...look.scene import Scene
from ...look.values import nullable, strips
from .network import body_values

_RAMP = packed(DIFFERENCE_RAMP)


def difference_colours(difference: Array, top: float) -> NDArray[np.uint32]:
    """Return colours of first − second (c,) [N], from −top to top."""
    level = np.round((np.clip(np.nan_to_num(difference) / top, -1.0, 1.0) + 1.0) * 0.5 * (len(_RAMP) - 1))
    return np.where(difference == 0.0, packed_one(OPEN), _RAMP[level.astype(np.int64)]).astype(np.uint32)


def difference_style(scene: Scene) -> ForceStyle:
    """Return the style of differences of forces: the same widths for a fraction of the range."""
    style = scene.style
    reach = ForceRange(DIFFERENCE_FRACTION * style.range.mean, DIFFERENCE_FRACTION * style.range.top)
    return ForceStyle(reach, style.grain_radius, style.quantum)


def log_difference_legend(stream: rr.RecordingStream, scene: Scene, first: str, second: str) -> None:
    """Log the colours of differences with the names of both fields, static."""
    fraction, limit = np.linspace(-1.0, 1.0, PIECES), difference_style(scene).range.top
    log_ramp_legend(
        stream, scene.canvas, entities.DIFFERENCE_LEGEND,
        difference_colours(fraction * limit, limit),
        [(0.0, f"{second} more: {limit:.3g} N"), (0.5, "equal"), (1.0, f"{first} more: {limit:.3g} N")],
    )  # fmt: skip


def log_difference(clock: Clock, scene: Scene, path: str, key: NDArray[np.int64], fn: Array, ft: Array) -> None:
    """Log the difference of two fields.

    Parameters
    ----------
    clock : Clock
        The frame on the timelines.
    scene : Scene
        The run.
    path : str
        The entity.
    key : array (u,)
        Keys of the contacts of either field.
    fn, ft : array (2, u)
        Forces of the first and the second field [N], 0 without contact.
    """
    contacts = measure_pairs(scene.grains, scene.tracks.position[clock.frame], scene.walls.at_rest(clock.frame), key)
    shown = np.flatnonzero(np.isfinite(contacts.point).all(axis=1))
    contacts, fn, ft = contacts.select(shown), fn[:, shown], ft[:, shown]
    difference, style = fn[0] - fn[1], difference_style(scene)
    clock.log(
        path,
        strips(
            scene.branches(clock.frame, contacts), style.radii(np.abs(difference)),
            difference_colours(difference, style.range.top), 20.0,
        ),
        rr.AnyValues(
            **body_values(scene, contacts), fn_first=nullable(fn[0]), fn_second=nullable(fn[1]),
            ft_first=nullable(ft[0]), ft_second=nullable(ft[1]),
        ),
    )  # fmt: skip
