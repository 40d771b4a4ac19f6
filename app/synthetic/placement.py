"""Placement of a simulated packing in the world coordinates of its experiment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import STRAIGHT, circle_parameters
from ..solver.dem.dem_truth import DemTruth

SIDE_SURPLUS = 0.004  # [m], of the sides above the plate at its highest


def cut_sides(truth: DemTruth) -> DemTruth:
    """Cut both sides of the linkage to one length, a little above the plate at its highest."""
    endpoints = truth.endpoints.copy()
    right, top, left = (truth.wall_names.index(name) for name in ("right", "top", "left"))
    reach = np.linalg.norm(endpoints[:, top, 0] - endpoints[:, right, 0], axis=1).max() + SIDE_SURPLUS
    side = endpoints[:, right, 1] - endpoints[:, right, 0]
    side *= reach / np.linalg.norm(side, axis=1)[:, None]
    endpoints[:, right, 1] = endpoints[:, right, 0] + side
    endpoints[:, left, 0] = endpoints[:, left, 1] + side
    return replace(truth, endpoints=endpoints)


def tilt_box(truth: DemTruth, angle: Array) -> DemTruth:
    """Turn box and grains of every photograph counter-clockwise by an angle (f,) [rad], about the origin.

    Forces are stated along the normals of contacts, which turn with them.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)
    return replace(
        truth,
        endpoints=np.einsum("fab,fweb->fwea", turn, truth.endpoints),
        position=np.einsum("fab,fnb->fna", turn, truth.position),
        rotation=truth.rotation + angle[:, None],
    )


def place_in_picture(truth: DemTruth, margin: float) -> DemTruth:
    """Shift everything until it lies right of and above the picture's corner by `margin` [m].

    Rotations are measured from the first photograph.
    """
    lowest = truth.endpoints.min(axis=(0, 1, 2))
    if truth.side is not None and truth.side.any():
        centre, radius, _ = circle_parameters(truth.endpoints[:, truth.side != STRAIGHT])
        lowest = np.minimum(lowest, (centre - radius[..., None]).min(axis=(0, 1)))
    shift = margin - lowest
    return replace(
        truth,
        endpoints=truth.endpoints + shift,
        position=truth.position + shift,
        rotation=truth.rotation - truth.rotation[0],
    )
