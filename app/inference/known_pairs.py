"""Pairs that surely bear force in solved frames, with their forces: evidence on the gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.calibration.equations import rotate_offsets
from ..solver.calibration.gaps import GapRows, MeasuredSequence
from ..solver.calibration.grain_errors import GrainErrors
from ..solver.contacts.contacts import Contacts
from ..solver.frame_forces import FrameForces
from ..solver.posterior.sequence_evidence import SequenceEvidence, gather_position_evidence
from ..tracks import Tracks
from .corrected_sequence import CorrectedSequence

BEARS = 0.8  # P(bears) above which a force determines the gap of its pair


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
    """Rows of gaps for the contacts of one frame."""
    numbers = np.arange(contacts.count, dtype=np.int32)  # of pairs; equal pairs need not be recognised
    return GapRows(
        np.full(contacts.count, frame, np.int32), contacts.i.astype(np.int32), contacts.j.astype(np.int32), numbers
    )


def gather_evidence_of(sequence: CorrectedSequence, tracks: Tracks) -> SequenceEvidence:
    """Position evidence of these tracks, everything else as in the sequence."""
    other = sequence.with_tracks(tracks)
    return gather_position_evidence(other.packing, other.snapshots, sequence.settings.posterior)


def correct_grain_errors(tracks: Tracks, measured: MeasuredSequence, found: GrainErrors) -> Tracks:
    """Subtract errors of centres and radii from the tracks; measured: the same tracks as calibration reads them."""
    position = tracks.position + rotate_offsets(measured, found.offset)
    return replace(tracks, radius=tracks.radius + found.radius, position=position)
