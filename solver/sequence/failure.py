"""Failed frames: their detection, their report, and the state after them.

One unusable photograph must not cost the frames around it: it is reported as failed and without forces, the next frame
starts afresh, and its positions are interpolated where they are needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..contacts.contacts import Contacts
from ..frame_forces import MEMBERS, FrameForces, FrameStatus
from ..nlgs.force_memory import ForceMemory
from ..nlgs.start_residuals import COLD_SWEEPS
from ..nlgs.sweep_record import SweepHistory
from ..quantity import columns, quantities
from .state import NO_EVIDENCE, SequenceState

FEWEST_SEEN = 0.1  # fraction of all tracked grains below which a frame is unusable
GROSS_UNBALANCE = 1.0  # mean |ΣF| of a grain over the mean f_n: forces drawn at random reach it
MUST_BE_FINITE = ("fn", "ft", "nlgs_fn", "nlgs_ft", "fn_sd", "ft_sd")


def find_unseen(snapshots: Sequence[Snapshot]) -> dict[int, str]:
    """Unusable frames with the reason."""
    known = int(np.any([each.present for each in snapshots], axis=0).sum()) if snapshots else 0
    faults = {k: _fault_of_snapshot(each, known) for k, each in enumerate(snapshots)}
    return {k: fault for k, fault in faults.items() if fault}


def find_fault(frame: FrameForces) -> str:
    """Reason why the result of a solve is unusable; empty where it is usable."""
    for name in MUST_BE_FINITE:
        bad = int((~np.isfinite(getattr(frame, name))).sum())
        if bad:
            return f"{bad} of {frame.contacts.count} contacts have no finite {name}"
    if not np.isfinite(frame.unbalance):
        return "the force residual of its grains is not finite"
    unbalance = np.empty(0) if frame.grain_unbalance is None else frame.grain_unbalance
    known = unbalance[np.isfinite(unbalance)]
    if len(known) and known.mean() > GROSS_UNBALANCE:
        return (
            f"its forces are not in equilibrium: grains are out of balance by {known.mean():.2g} mean forces on average"
        )
    return ""


def describe_error(error: Exception) -> str:
    """An exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".rstrip(": ")


def failed_frame(k: int, reason: str, grain_count: int, wall_count: int, *, with_members: bool = False) -> FrameForces:
    """Frame k without contacts and forces; with_members: others hold the forces of every member of the ensemble."""
    of_contacts = set(columns(FrameForces, "contact")) - {"member_force"}
    absent: dict[str, Any] = {name: _nothing(name) for name in of_contacts}
    return FrameForces(
        frame=k,
        contacts=_no_contacts(grain_count, wall_count),
        **absent,
        status=FrameStatus.FAILED,
        reason=reason,
        failed_reason=reason,
        sweeps=0,
        natural_map=np.nan,
        unbalance=np.nan,
        kappa=np.nan,
        correction=np.nan,
        old_unbalance=np.nan,
        trust=0.0,
        frames_since_reset=0,
        history=_no_history(),
        member_force=np.empty((0, len(MEMBERS), 2)) if with_members else None,
        cold_residual=np.full(len(COLD_SWEEPS), np.nan),
        strain=np.full((2, 2), np.nan),
        grain_unbalance=np.full(grain_count, np.nan),
    )


def forget_forces(state: SequenceState) -> SequenceState:
    """State after a failed frame: that of the last solved frame without its forces."""
    return replace(
        state.without_forces(), age_key=np.empty(0, np.int64), age=np.empty(0, np.int32), pressure=np.nan,
        evidence=NO_EVIDENCE, frames_since_reset=0, frames_since_event=0, reported=ForceMemory.empty(),
    )  # fmt: skip


def _fault_of_snapshot(snapshot: Snapshot, known: int) -> str:
    here = snapshot.present
    seen = int(here.sum())
    if seen < FEWEST_SEEN * known or seen == 0:
        return f"{seen} of {known} grains were found in it"
    if not np.isfinite(snapshot.endpoints).all():
        return "the walls are not known in it"
    if not (np.isfinite(snapshot.position[here]).all() and np.isfinite(snapshot.rotation[here]).all()):
        return "a grain that is there has no finite pose"
    return ""


def _no_contacts(grain_count: int, wall_count: int) -> Contacts:
    row, number, vector = np.empty(0, np.int32), np.empty(0), np.empty((0, 2))
    return Contacts(row, row, number, vector, vector, grain_count, wall_count, vector)


def _no_history() -> SweepHistory:
    none: Array = np.empty(0)
    kept = np.empty((0, 0), np.float32)
    return SweepHistory(none, none, none, np.empty(0, np.int64), kept, kept)


def _nothing(name: str) -> np.ndarray:
    return np.empty(0, next(each.dtype for each in quantities(FrameForces) if each.name == name))
