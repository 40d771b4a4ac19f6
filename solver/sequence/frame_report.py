"""What is reported of a solved frame: contacts of stand-ins dropped, forbidden ones listed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import columns
from solver.contacts.contacts import Contacts, ContactSource, ContactState
from solver.sequence.frame_forces import FrameForces
from solver.statistics.agreement import pearson


def without_bridged(frame: FrameForces, bridged: NDArray[np.bool_]) -> FrameForces:
    """Drop the contacts of grains (n,) that only stood in: they were not seen, so nothing is reported of them.

    The trust is lowered by what is hidden that way.
    """
    contacts, history = frame.contacts, frame.history
    stand_in = np.concatenate([bridged, np.zeros(contacts.wall_count, np.bool_)])
    keep = ~(stand_in[contacts.i] | stand_in[contacts.j])
    kept = {name: value[keep] for name, value in _contact_columns(frame).items()}
    # What is left out counts as zero for whoever compares the whole network.
    hidden = 1.0 - pearson(np.where(keep, frame.fn, 0.0), frame.fn)
    return replace(
        frame,
        trust=frame.trust * (1.0 - hidden),
        hidden_share=hidden,
        contacts=contacts.select(keep),
        history=replace(history, fn=history.fn[:, keep], ft=history.ft[:, keep]),
        reason=f"{bridged.sum()} lost grains were bridged, and nothing is shown of their contacts; {frame.reason}",
        **kept,
    )


def show_forbidden(frame: FrameForces, forbidden: Contacts, probability: Array, un: Array, ut: Array) -> FrameForces:
    """List contacts that were detected but forbidden (m,), without force and marked as such.

    probability (m,): P(touch) by the detector; un, ut (m,) [m/s]: their measured relative velocity.
    """
    if forbidden.count == 0:
        return frame
    contacts = frame.contacts
    order = np.argsort(np.concatenate([contacts.key, forbidden.key]), kind="stable")
    known = {
        "state": np.full(forbidden.count, ContactState.OPEN),
        "source": np.full(forbidden.count, ContactSource.FORBIDDEN_BY_REVIEWER),
        "probability": probability, "un": un, "ut": ut,
    }  # fmt: skip
    listed: dict[str, NDArray] = {}
    for name, value in _contact_columns(frame).items():
        added = np.zeros((forbidden.count, *value.shape[1:]), value.dtype)
        if name in known:
            added[:] = known[name]
        listed[name] = np.concatenate([value, added])[order]
    history = frame.history
    nothing = np.zeros((len(history.recorded), forbidden.count), np.float32)
    geometry = {
        name: np.concatenate([getattr(contacts, name), getattr(forbidden, name)])[order]
        for name in columns(Contacts, "contact")
    }
    merged = Contacts(**geometry, grain_count=contacts.grain_count, wall_count=contacts.wall_count)
    return replace(
        frame,
        contacts=merged,
        history=replace(
            history,
            fn=np.concatenate([history.fn, nothing], axis=1)[:, order],
            ft=np.concatenate([history.ft, nothing], axis=1)[:, order],
        ),
        **listed,
    )


def _contact_columns(frame: FrameForces) -> dict[str, NDArray]:
    """The columns that have a row per contact, those that are there."""
    named = {name: getattr(frame, name) for name in columns(type(frame), "contact")}
    return {name: value for name, value in named.items() if value is not None}
