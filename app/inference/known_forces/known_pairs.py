"""What frames that are solved tell of gaps: which pairs surely bear, and how much."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from solver.bodies.bridging import bridge_frames
from solver.bodies.grains import Array
from solver.calibration.equations import rotate_offsets
from solver.calibration.gaps import GapRows, MeasuredSequence
from solver.calibration.known_forces import GrainErrors
from solver.contacts.contacts import Contacts
from solver.posterior.sequence_evidence import SequenceEvidence, gather_evidence
from solver.sequence.frame_forces import FrameForces

from ...tracks import Tracks
from ..snapshots import make_snapshots

if TYPE_CHECKING:
    from ..inference import CorrectedSequence

BEARS = 0.8  # P(bears) from which on a pair's gap is known by its force


def known_pairs(frames: Iterable[FrameForces]) -> tuple[GapRows, Array]:
    """Pairs that surely bear in these frames, and their normal forces (m,) [N]."""
    rows, forces = [], []
    for frame in frames:
        if frame.bearing_probability is None:
            continue
        known = (frame.bearing_probability > BEARS) & (frame.fn > 0.0)
        rows.append(rows_of(frame.frame, frame.contacts.select(known)))
        forces.append(frame.fn[known])
    if not rows:
        none = np.empty(0, np.int32)
        return GapRows(none, none, none, none), np.empty(0)
    return (
        GapRows(*(np.concatenate([getattr(each, name) for each in rows]) for name in ("frame", "i", "j", "pair"))),
        np.concatenate(forces),
    )


def rows_of(frame: int, contacts: Contacts) -> GapRows:
    """The contacts of one frame as rows of gaps."""
    numbers = np.arange(contacts.count, dtype=np.int32)  # of pairs: nobody asks which are the same
    return GapRows(
        np.full(contacts.count, frame, np.int32), contacts.i.astype(np.int32), contacts.j.astype(np.int32), numbers
    )


def gather_evidence_of(sequence: CorrectedSequence, tracks: Tracks) -> SequenceEvidence:
    """What the positions of these tracks tell, everything else being as in the sequence."""
    other = with_tracks(sequence, tracks)
    return gather_evidence(other.packing, other.snapshots, sequence.settings.posterior)


def with_tracks(sequence: CorrectedSequence, tracks: Tracks) -> CorrectedSequence:
    """The sequence of the same rods in other places, of other radii."""
    snapshots = bridge_frames(make_snapshots(tracks, sequence.walls), sequence.failed)
    packing = replace(sequence.packing, grains=replace(sequence.packing.grains, radius=tracks.radius))
    return replace(sequence, tracks=tracks, packing=packing, snapshots=snapshots)


def without_errors(tracks: Tracks, measured: MeasuredSequence, found: GrainErrors) -> Tracks:
    """The tracks with these errors taken off; measured: the same as calibration reads them."""
    position = tracks.position + rotate_offsets(measured, found.offset)
    return replace(tracks, radius=tracks.radius + found.radius, position=position)
