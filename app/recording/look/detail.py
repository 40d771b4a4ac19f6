"""How much of a large packing is drawn: more lines than a screen has room for hide one another, and drown the viewer.

Of very many contacts the strongest are drawn, of very many rods discs without outline or mark of rotation, and of
fewer sweeps. Curves and numbers hear all of them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solver.sequence.frame_forces import FrameForces

from ...results.schema import entries

MOST_CONTACTS = 40_000  # that are drawn of a frame
MOST_OUTLINED = 20_000  # rods: of more none has an outline
MOST_COLOURS = 2_000_000  # of the rods' and of the contacts' maps over all recorded sweeps of a frame
LEAST_SWEEPS = 4  # that are recorded however many rods there are


def is_outlined(grains: int) -> bool:
    """Whether so many rods are drawn with outlines and marks."""
    return grains <= MOST_OUTLINED


def drawn_contacts(forces: FrameForces) -> FrameForces:
    """The frame with the contacts that are drawn: all, or the strongest, in their order."""
    count = forces.contacts.count
    if count <= MOST_CONTACTS:
        return forces
    fn = np.nan_to_num(forces.fn)
    strongest = np.argsort(-fn, kind="stable")[:MOST_CONTACTS]
    drawn = np.zeros(count, np.bool_)
    drawn[strongest] = True
    return only_contacts(forces, drawn)


def only_contacts(forces: FrameForces, rows: NDArray[np.bool_]) -> FrameForces:
    """The frame with some of its contacts (c,); what is said of the whole frame stays."""
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
    """How many of the sweeps of a frame are recorded where `kept` are asked for."""
    return min(kept, max(MOST_COLOURS // max(grains, MOST_CONTACTS), LEAST_SWEEPS))


def describe_detail(grains: int, most_contacts: int) -> str:
    """A sentence for the user on what of so many rods and contacts is left out; empty: nothing."""
    left = []
    if most_contacts > MOST_CONTACTS:
        left.append(f"of up to {most_contacts} contacts of a frame the {MOST_CONTACTS} strongest are drawn")
    if not is_outlined(grains):
        left.append(f"{grains} rods are drawn without outlines and marks of rotation")
    return f"In so large a packing {' and '.join(left)}; curves and numbers hear all." if left else ""
