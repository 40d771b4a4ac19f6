"""The load that rods of the boundary bear: those glued to a loaded plate, and those inside the packing.

Their contacts with the plate are not part of the model, since the motion of both is given, so that the load is first
divided by the widths of the rods. The forces that free rods exert on them show what they bear. A few rods of another
boundary at the end of a plate, as of a membrane, are also held by their neighbours in it: their width is better there.

Rods of the boundary inside a packing, as pins, may bear any part of its load, and nothing states which.
"""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array, Grains
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..statistics.balance import resultant_norms, sum_on_grains
from ..statistics.stress import contact_force_vectors
from .frame_problem import FrameProblem

AT_PLATE = 0.3  # radii: greatest gap of a boundary rod that is held by the plate: glue is no thinner
GLUED = 0.3  # fraction of the plate's width, by rods of the boundary, from which on they are glued to it
LEAST_BORNE = 0.1  # of the load: what is read from less is noise
INSIDE = 0.5  # |ΣF| over Σ |F| of a boundary rod below which others press on it from all sides


def scale_to_load(problem: FrameProblem, walls: Walls, contacts: Contacts, fn: Array, ft: Array) -> float:
    """Return the factor by which the forces of a frame agree with the load on its only plate; 1 where nothing is known.

    Parameters
    ----------
    problem : FrameProblem
    walls : Walls
        Of the frame.
    contacts : Contacts
    fn, ft : array (c,)
        Forces at the contacts [N].

    Notes
    -----
    L = n·Σ f with n the outward normal of the plate and f the forces of free rods on it and on the boundary rods that
    touch it. Without weight the forces of a frame are known up to a factor otherwise, so that one factor restores it.
    """
    packing, snapshot = problem.packing, problem.snapshot
    boundary = packing.grains.boundary
    load = packing.load(snapshot.endpoints, snapshot.side, snapshot.load)
    loaded = np.flatnonzero(np.isfinite(load))
    if boundary is None or len(loaded) != 1 or any(packing.material.gravity):
        return 1.0
    w, n = int(loaded[0]), packing.grains.count
    radius = packing.grains.radius
    distance, _ = walls.distance(np.full(n, w), snapshot.position)
    beside = snapshot.present & (np.abs(distance - radius) < AT_PLATE * radius)
    at_plate = boundary & beside
    if walls.curved[w] or not at_plate.any() or radius[at_plate].sum() < GLUED * radius[beside].sum():
        return 1.0
    along = contact_force_vectors(contacts, fn, ft) @ walls.outward[w]
    first, second = at_plate[contacts.i], np.append(at_plate, np.zeros(walls.count, np.bool_))[contacts.j]
    borne = float(along[contacts.j == n + w].sum() + along[second & ~first].sum() - along[first & ~second].sum())
    return float(load[w] / borne) if borne > LEAST_BORNE * load[w] > 0.0 else 1.0


def inner_reaction(grains: Grains, contacts: Contacts, fn: Array, ft: Array) -> float:
    """Compute Σ |ΣF| of the boundary rods inside a packing over the Σ |F| of all contacts; 0 without such rods.

    Parameters
    ----------
    grains : Grains
    contacts : Contacts
    fn, ft : array (c,)
        Forces at the contacts [N].
    """
    if grains.boundary is None:
        return 0.0
    reaction = resultant_norms(contacts, fn, ft, np.zeros((grains.count, 2)))
    size = np.hypot(fn, ft)
    inside = grains.boundary & (reaction < INSIDE * sum_on_grains(contacts, size))
    return float(reaction[inside].sum() / size.sum()) if inside.any() else 0.0
