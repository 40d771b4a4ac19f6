"""Writes what contact detection decided: gaps, contacts gained and lost since the frame before."""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts, measure_contacts
from solver.contacts.pairs import are_among, are_there
from solver.sequence.frame_forces import FrameForces

from ..look import entities
from ..look.clock import Clock
from ..look.colours import GAINED, GAP_RAMP, LOST, packed, packed_one
from ..look.scene import Scene
from ..look.values import known

GAP_RANGE_SHARE = 0.004  # of the mean radius: the gap at which colour no longer changes, in either direction

_RAMP = packed(GAP_RAMP)


def log_changes(
    clock: Clock, scene: Scene, forces: FrameForces, former: FrameForces | None, drawn: Contacts | None = None
) -> None:
    """Log gaps and changes of one frame; the first frame has no former one. drawn: contacts whose gaps are shown."""
    clock.start()
    _log_gaps(clock, scene, forces.contacts if drawn is None else drawn)
    contacts = forces.contacts
    if former is None:
        gained, parted = contacts.select(np.zeros(contacts.count, bool)), np.empty((0, 2, 2), np.float32)
    else:
        gained = contacts.select(~are_among(contacts.key, former.contacts.key))
        gone = former.contacts.select(~are_among(former.contacts.key, contacts.key))
        parted = _branches_now(scene, clock.frame, gone)
    for path, strips, colour in (
        (entities.GAINED, scene.branches(clock.frame, gained), GAINED),
        (entities.PARTED, parted, LOST),
    ):
        clock.stream.log(
            path,
            rr.LineStrips2D(
                strips,
                radii=np.float32(0.09 * scene.canvas.grain_radius),
                colors=packed_one(colour),
                draw_order=25.0,
            ),
        )


def gap_range(scene: Scene) -> float:
    """Gap at the ends of the colour ramp [m]: a round number of micrometres."""
    micrometres = 1e6 * GAP_RANGE_SHARE * float(np.mean(scene.tracks.radius))
    decade = 10.0 ** np.floor(np.log10(micrometres))
    return 1e-6 * float(
        decade * np.array([1.0, 2.0, 5.0, 10.0])[np.searchsorted([1.5, 3.5, 7.5], micrometres / decade)]
    )


def gap_colours(gap: Array, reach: float) -> NDArray[np.uint32]:
    """Colours along the gap ramp, overlap … open (c,)."""
    level = np.round((np.nan_to_num(gap) / reach + 1.0) * 0.5 * (len(_RAMP) - 1))
    return _RAMP[np.clip(level, 0, len(_RAMP) - 1).astype(np.int64)]


def _log_gaps(clock: Clock, scene: Scene, contacts: Contacts) -> None:
    clock.stream.log(
        entities.GAPS,
        rr.Points2D(
            scene.canvas.points(scene.contact_points(clock.frame, contacts)).astype(np.float32),
            radii=np.float32(0.17 * scene.canvas.grain_radius),
            colors=gap_colours(contacts.gap, gap_range(scene)),
            draw_order=28.0,
        ),
        rr.AnyValues(
            # With a type of its own: without contacts nothing else here would have one.
            gap_um=known((1e6 * contacts.gap).astype(np.float32)),
            grain_a=scene.tracks.id[contacts.i],
            body_b=scene.body_names(contacts.j),
        ),
    )


def _branches_now(scene: Scene, frame: int, gone: Contacts) -> NDArray[np.float32]:
    """Branches of contacts of the frame before, where their bodies are now; those of lost grains are left out."""
    gone = gone.select(are_there(gone.key, scene.tracks.present[frame], gone.body_count))
    walls = scene.walls_at(frame)
    now = measure_contacts(scene.grains, scene.tracks.position[frame], walls, gone.i, gone.j)
    return scene.branches(frame, now)
