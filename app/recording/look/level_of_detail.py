"""Level of detail of large packings: too many lines hide each other and overload the viewer.

Above a number of contacts only the strongest are drawn; above a number of rods these are drawn as discs without outline
and mark of rotation, and at fewer sweeps. Curves and numbers use all contacts and rods.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...results.schema import entries
from ...solver.frame_forces import FrameForces

MAX_DRAWN_CONTACTS = 40_000  # drawn in a frame
MAX_OUTLINED = 20_000  # rods drawn with outlines; with more, none has one
MAX_COLOURS = 2_000_000  # in the maps of rods or contacts over all recorded sweeps of a frame
MIN_SWEEPS = 4  # recorded for any number of rods


def is_outlined(grains: int) -> bool:
    """Return whether this number of rods is drawn with outlines and marks."""
    return grains <= MAX_OUTLINED


def drawn_contacts(forces: FrameForces) -> FrameForces:
    """Return the frame with the contacts that are drawn, in their order: all, or the strongest."""
    count = forces.contacts.count
    if count <= MAX_DRAWN_CONTACTS:
        return forces
    fn = np.nan_to_num(forces.fn)
    strongest = np.argsort(-fn, kind="stable")[:MAX_DRAWN_CONTACTS]
    drawn = np.zeros(count, np.bool_)
    drawn[strongest] = True
    return select_contacts(forces, drawn)


def select_contacts(forces: FrameForces, rows: NDArray[np.bool_]) -> FrameForces:
    """Return the frame with the selected contacts (c,); the quantities of the whole frame are unchanged."""
    own: dict[str, object] = {}
    history: dict[str, object] = {}
    for each in entries("frames"):
        place, _, name = each.attribute.rpartition(".")
        if place == "" and each.dims[0] == "contact":
            values = getattr(forces, name)
            own[name] = None if values is None else values[rows]
        elif place == "history" and each.dims == ("kept_force",):
            history[name] = getattr(forces.history, name)[:, rows]
    return replace(forces, contacts=forces.contacts.select(rows), history=replace(forces.history, **history), **own)  # type: ignore[arg-type]


def kept_sweeps(kept: int, grains: int) -> int:
    """Return how many sweeps of a frame are recorded if `kept` are requested."""
    return min(kept, max(MAX_COLOURS // max(grains, MAX_DRAWN_CONTACTS), MIN_SWEEPS))


def describe_detail(grains: int, most_contacts: int) -> str:
    """Return a sentence for the user on reduced rods and contacts; empty: none are."""
    reductions = []
    if most_contacts > MAX_DRAWN_CONTACTS:
        reductions.append(f"of up to {most_contacts} contacts of a frame the {MAX_DRAWN_CONTACTS} strongest are drawn")
    if not is_outlined(grains):
        reductions.append(f"{grains} rods are drawn without outlines and marks of rotation")
    return f"In this large packing {' and '.join(reductions)}; curves and numbers use all." if reductions else ""
