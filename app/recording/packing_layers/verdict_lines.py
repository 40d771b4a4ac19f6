"""Writes the contacts with verdicts of a reviewer: added or forbidden."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import rerun as rr

from ...solver.contacts.contacts import ContactSource
from ...solver.frame_forces import FrameForces
from ..look import entities
from ..look.clock import Clock
from ..look.colours import ADDED, FORBIDDEN, packed_one
from ..look.scene import Scene
from ..look.values import strips
from .contact_changes import broken_lines

REVIEWER_SOURCES = (ContactSource.ADDED_BY_REVIEWER, ContactSource.FORBIDDEN_BY_REVIEWER)


def log_verdicts(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the contacts of one frame that a reviewer added, and in two parts those that were forbidden."""
    added, forbidden = (np.flatnonzero(forces.source == each) for each in REVIEWER_SOURCES)
    lines = [scene.branches(clock.frame, forces.contacts.select(rows)) for rows in (added, forbidden)]
    rows = np.concatenate([added, forbidden, forbidden])
    source, contacts = forces.source[rows], forces.contacts
    clock.start()
    clock.log(
        entities.VERDICTS,
        strips(
            np.concatenate([lines[0], broken_lines(lines[1])]),
            0.14 * scene.canvas.grain_radius,
            np.where(source == REVIEWER_SOURCES[0], packed_one(ADDED), packed_one(FORBIDDEN)).astype(np.uint32),
            30.0,
        ),
        rr.AnyValues(
            # With an explicit type, which an empty list would lack.
            source=pa.array([ContactSource(value).name.lower() for value in source.tolist()], pa.string()),
            grain_a=scene.tracks.id[contacts.i[rows]],
            body_b=scene.body_names(contacts.j[rows]),
        ),
    )
