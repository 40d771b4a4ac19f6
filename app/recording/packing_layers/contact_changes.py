"""Writes the gaps of contacts, and the new and lost contacts since the frame before."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import Contacts, measure_contacts
from ...solver.contacts.pairs import are_among, are_present
from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.clock import Clock
from ..look.colours import GAP_RAMP, LOST, NEW_CONTACT, packed
from ..look.scene import Scene
from ..look.values import dots, nullable, strips

GAP_RANGE_FRACTION = 0.004  # of the mean radius: the gap at both ends of the colour ramp
END_FRACTION = 0.3  # of a line in two parts: each end

_RAMP = packed(GAP_RAMP)


def log_changes(
    clock: Clock, scene: Scene, forces: FrameForces, previous: FrameForces | None, drawn: Contacts | None = None
) -> None:
    """Log gaps and changes of one frame.

    Parameters
    ----------
    clock : Clock
        The frame on the timelines.
    scene : Scene
        The run.
    forces : FrameForces
        The frame.
    previous : FrameForces, optional
        The frame before; None for the first.
    drawn : Contacts, optional
        The contacts whose gaps are drawn; None: all.
    """
    clock.start()
    _log_gaps(clock, scene, forces.contacts if drawn is None else drawn)
    contacts = forces.contacts
    if previous is None:
        new, lost = contacts.select(np.zeros(contacts.count, bool)), np.empty((0, 2, 2), np.float32)
    else:
        new = contacts.select(~are_among(contacts.key, previous.contacts.key))
        ended = previous.contacts.select(~are_among(previous.contacts.key, contacts.key))
        lost = broken_lines(_branches_now(scene, clock.frame, ended))
    for path, lines, colour in (
        (entities.NEW_CONTACTS, scene.branches(clock.frame, new), NEW_CONTACT),
        (entities.LOST_CONTACTS, lost, LOST),
    ):
        clock.log(path, strips(lines, 0.09 * scene.canvas.grain_radius, colour, 25.0))


def broken_lines(lines: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the two ends (2 c, 2, 2) of lines (c, 2, 2): the shape of pairs without a contact."""
    start, end = lines[:, 0], lines[:, 1]
    arm = END_FRACTION * (end - start)
    halves = np.stack([start, start + arm], axis=1), np.stack([end - arm, end], axis=1)
    return np.concatenate(halves).astype(np.float32)


def gap_range(scene: Scene) -> float:
    """Return the gap at the ends of the colour ramp [m], a round number of micrometres."""
    micrometres = 1e6 * GAP_RANGE_FRACTION * float(np.mean(scene.tracks.radius))
    decade = 10.0 ** np.floor(np.log10(micrometres))
    return 1e-6 * float(
        decade * np.array([1.0, 2.0, 5.0, 10.0])[np.searchsorted([1.5, 3.5, 7.5], micrometres / decade)]
    )


def gap_colours(gap: Array, reach: float) -> NDArray[np.uint32]:
    """Return colours (c,) along the gap ramp, from overlap to open."""
    level = np.round((np.nan_to_num(gap) / reach + 1.0) * 0.5 * (len(_RAMP) - 1))
    return _RAMP[np.clip(level, 0, len(_RAMP) - 1).astype(np.int64)]


def _log_gaps(clock: Clock, scene: Scene, contacts: Contacts) -> None:
    points = scene.canvas.points(scene.contact_points(clock.frame, contacts))
    clock.log(
        entities.GAPS,
        dots(points, 0.17 * scene.canvas.grain_radius, gap_colours(contacts.gap, gap_range(scene)), 28.0),
        rr.AnyValues(
            # With an explicit type, which an empty list of contacts would lack.
            gap_um=nullable((1e6 * contacts.gap).astype(np.float32)),
            grain_a=scene.tracks.id[contacts.i],
            body_b=scene.body_names(contacts.j),
        ),
    )


def _branches_now(scene: Scene, frame: int, ended: Contacts) -> NDArray[np.float32]:
    """Return the branches of contacts of the frame before at the present positions, those of lost grains left out."""
    ended = ended.select(are_present(ended.key, scene.tracks.present_in(frame), ended.body_count))
    walls = scene.walls.at_rest(frame)
    now = measure_contacts(scene.grains, scene.tracks.position[frame], walls, ended.i, ended.j)
    return scene.branches(frame, now)
