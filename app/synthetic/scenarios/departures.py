"""Departures of laboratory data from the truth: one function each, from exact data to the data that are written.

Sizes are those met in practice; where the size of a packing matters they are fractions of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...solver.bodies.grains import Array
from ...solver.dem.membrane_cell import membrane_width
from .observed_data import ObservedData

Departure = Callable[[ObservedData, np.random.Generator], ObservedData]

SHORTENED = 0.08 / 0.6  # fraction of a side's length by which it is stated too short
UNSEEN = 0.03  # fraction of the rods
PINNED = 0.05  # fraction of the rods
CROPPED = 1.5  # [mean diameter] from the walls, outside the picture
CAMERA_SHIFT = 6e-5  # [m], greatest shift of a photograph: half a pixel
CENTRE_ERROR = 5e-5  # [m] rms of either component
LOW_FRICTION, HIGH_FRICTION = 0.2, 0.4  # stated
RADIUS_OFFSET = 0.03  # [mean radius]
TEN_FRAMES = 10


def keep_unchanged(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Return the data unchanged: noise is their only error."""
    return observed


def state_corners(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State as wall ends the corners where the bars meet, which slide along the bars."""
    w = len(observed.wall_names)
    start, along = observed.endpoints[:, :, 0], observed.endpoints[:, :, 1] - observed.endpoints[:, :, 0]
    corner = np.stack([_crossing(start[:, k - 1], along[:, k - 1], start[:, k], along[:, k]) for k in range(w)], axis=1)
    return replace(observed, endpoints=np.stack([corner, np.roll(corner, -1, axis=1)], axis=2))


def misstate_wall_ends(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the upper ends of both sides too low."""
    endpoints = observed.endpoints.copy()
    right, left = observed.wall_names.index("right"), observed.wall_names.index("left")
    endpoints[:, right, 1] -= SHORTENED * (endpoints[:, right, 1] - endpoints[:, right, 0])
    endpoints[:, left, 0] -= SHORTENED * (endpoints[:, left, 0] - endpoints[:, left, 1])
    return replace(observed, endpoints=endpoints)


def omit_rods(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Remove rods that no photograph shows."""
    n = len(observed.id)
    seen = np.sort(rng.permutation(n)[round(UNSEEN * n) :])
    assert observed.rotation is not None
    return replace(
        observed, id=observed.id[seen], radius=observed.radius[seen], position=observed.position[:, seen],
        rotation=observed.rotation[:, seen],
    )  # fmt: skip


def crop_to_interior(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Keep the interior of the packing: the walls and the rods near them are outside the picture."""
    assert observed.rotation is not None
    ends, margin = observed.endpoints[0], CROPPED * 2.0 * float(observed.radius.mean())
    along = ends[:, 1] - ends[:, 0]
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    depth = np.einsum("nwk,wk->nw", observed.position[0][:, None] - ends[None, :, 0], inward)
    cache = np.flatnonzero((depth > margin).all(axis=1))
    return replace(
        observed, id=observed.id[cache], radius=observed.radius[cache], position=observed.position[:, cache],
        rotation=observed.rotation[:, cache], endpoints=observed.endpoints[:, :0], wall_names=(), outer=True,
        known=replace(observed.known, pressure={}),
    )  # fmt: skip


def in_turn(first: Departure, second: Departure) -> Departure:
    """Depart in two ways, one after the other."""

    def both(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        return second(first(observed, rng), rng)

    return both


def omit_loads(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State no load of any wall."""
    return replace(observed, known=replace(observed.known, pressure={}))


def state_membrane(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State as the boundary all rods that a membrane on the right touches in any photograph."""
    top = observed.endpoints[:, observed.wall_names.index("top"), :, 1].mean(axis=1)
    bottom = observed.endpoints[:, observed.wall_names.index("bottom"), :, 1].mean(axis=1)
    touched = [
        membrane_width(position - [0.0, low], observed.radius, high - low) > 0.0
        for position, low, high in zip(observed.position, bottom, top, strict=True)
    ]
    return replace(observed, boundary=observed.id[np.any(touched, axis=0)])


def state_pins(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State a few rods in any place as boundary; the forces on them balance all the same."""
    count = max(round(PINNED * len(observed.id)), 1)
    return replace(observed, boundary=np.sort(rng.choice(observed.id, count, replace=False)))


def move_camera(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Shift every photograph relative to the walls, which were measured independently."""
    shift = rng.uniform(-CAMERA_SHIFT, CAMERA_SHIFT, (len(observed.position), 1, 2))
    return replace(observed, position=observed.position + shift)


def displace_centres(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Offset every centre by a vector fixed in the rod; the stated precision is the size of this error."""
    assert observed.rotation is not None
    x, y = rng.normal(0.0, CENTRE_ERROR, (2, len(observed.id)))
    cosine, sine = np.cos(observed.rotation), np.sin(observed.rotation)
    error = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return replace(observed, position=observed.position + error, precision=CENTRE_ERROR)


def scatter_radii(fraction: float) -> Departure:
    """Add random errors to the radii; their standard deviation is this fraction of the mean radius."""

    def depart(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        error = fraction * observed.radius.mean() * rng.standard_normal(len(observed.id))
        return replace(observed, radius=observed.radius + error)

    return depart


def shrink_radii(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Reduce all radii by the same length."""
    return replace(observed, radius=observed.radius - RADIUS_OFFSET * observed.radius.mean())


def misstate_friction(friction: float) -> Departure:
    """State another coefficient of friction, for rods and walls."""

    def depart(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        return replace(observed, known=replace(observed.known, friction=friction, wall_friction=friction))

    return depart


def keep_ten_frames(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Scatter the radii slightly and keep the first ten photographs."""
    observed = scatter_radii(0.003)(observed, rng)
    assert observed.rotation is not None
    kept = slice(TEN_FRAMES)
    return replace(
        observed, position=observed.position[kept], rotation=observed.rotation[kept],
        endpoints=observed.endpoints[kept], load=observed.load[kept],
    )  # fmt: skip


def state_photoelastic_discs(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Reduce all radii and remove the rotations, as in photoelastic tests."""
    return replace(shrink_radii(observed, rng), rotation=None)


def _crossing(start: Array, along: Array, other_start: Array, other_along: Array) -> Array:
    """Return the intersections (f, 2) [m] of lines through start (f, 2) along (f, 2) with other lines."""
    cross = along[:, 0] * other_along[:, 1] - along[:, 1] * other_along[:, 0]
    between = other_start - start
    s = (between[:, 0] * other_along[:, 1] - between[:, 1] * other_along[:, 0]) / cross
    return start + s[:, None] * along
