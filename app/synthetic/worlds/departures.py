"""How the folders of laboratories depart from the truth: one function each, of what is told to what is told instead.

Sizes are those that were met; where a packing's size matters they are shares of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from solver.bodies.grains import Array

from .told import Told

Departure = Callable[[Told, np.random.Generator], Told]

SHORT = 0.08 / 0.6  # of a side's length that is not told
UNSEEN = 0.03  # of the rods
CUT = 1.5  # mean diameters from the walls within which nothing is told
CAMERA = 6e-5  # [m], greatest shift of a photograph: half a pixel
CENTRE_ERROR = 5e-5  # [m] rms of either component
LOW, HIGH = 0.2, 0.4  # friction told
OFFSET = 0.03  # of the mean radius
TEN = 10  # photographs


def tell_truly(told: Told, rng: np.random.Generator) -> Told:
    """Nothing but noise is wrong."""
    return told


def tell_corners(told: Told, rng: np.random.Generator) -> Told:
    """Walls end where the bars meet: a corner slides along a bar, whose points the ends are taken to be."""
    w = len(told.wall_names)
    start, along = told.endpoints[:, :, 0], told.endpoints[:, :, 1] - told.endpoints[:, :, 0]
    corner = np.stack([_crossing(start[:, k - 1], along[:, k - 1], start[:, k], along[:, k]) for k in range(w)], axis=1)
    return replace(told, endpoints=np.stack([corner, np.roll(corner, -1, axis=1)], axis=2))


def tell_short_walls(told: Told, rng: np.random.Generator) -> Told:
    """The sides' upper ends are told too low."""
    endpoints = told.endpoints.copy()
    right, left = told.wall_names.index("right"), told.wall_names.index("left")
    endpoints[:, right, 1] -= SHORT * (endpoints[:, right, 1] - endpoints[:, right, 0])
    endpoints[:, left, 0] -= SHORT * (endpoints[:, left, 0] - endpoints[:, left, 1])
    return replace(told, endpoints=endpoints)


def hide_rods(told: Told, rng: np.random.Generator) -> Told:
    """Some rods were never seen."""
    n = len(told.id)
    seen = np.sort(rng.permutation(n)[round(UNSEEN * n) :])
    assert told.rotation is not None
    return replace(
        told, id=told.id[seen], radius=told.radius[seen], position=told.position[:, seen],
        rotation=told.rotation[:, seen],
    )  # fmt: skip


def cut_out(told: Told, rng: np.random.Generator) -> Told:
    """The middle of a packing alone: neither its walls nor what lies near them is in the picture."""
    assert told.rotation is not None
    ends, margin = told.endpoints[0], CUT * 2.0 * float(told.radius.mean())
    along = ends[:, 1] - ends[:, 0]
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    depth = np.einsum("nwk,wk->nw", told.position[0][:, None] - ends[None, :, 0], inward)
    kept = np.flatnonzero((depth > margin).all(axis=1))
    return replace(
        told, id=told.id[kept], radius=told.radius[kept], position=told.position[:, kept],
        rotation=told.rotation[:, kept], endpoints=told.endpoints[:, :0], wall_names=(), outer=True,
        known=replace(told.known, pressure={}),
    )  # fmt: skip


def move_camera(told: Told, rng: np.random.Generator) -> Told:
    """Every photograph is shifted against the walls, which were measured otherwise."""
    shift = rng.uniform(-CAMERA, CAMERA, (len(told.position), 1, 2))
    return replace(told, position=told.position + shift)


def displace_centres(told: Told, rng: np.random.Generator) -> Told:
    """Every centre is wrong by a vector that turns with the rod, and the precision told is that error."""
    assert told.rotation is not None
    x, y = rng.normal(0.0, CENTRE_ERROR, (2, len(told.id)))
    cosine, sine = np.cos(told.rotation), np.sin(told.rotation)
    error = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return replace(told, position=told.position + error, precision=CENTRE_ERROR)


def scatter_radii(share: float) -> Departure:
    """Radii are wrong at random by this share of the mean radius (standard deviation)."""

    def depart(told: Told, rng: np.random.Generator) -> Told:
        return replace(told, radius=told.radius + share * told.radius.mean() * rng.standard_normal(len(told.id)))

    return depart


def shrink_radii(told: Told, rng: np.random.Generator) -> Told:
    """All radii are too small by the same length."""
    return replace(told, radius=told.radius - OFFSET * told.radius.mean())


def tell_friction(friction: float) -> Departure:
    """Another coefficient of friction is told, of rods and of walls."""

    def depart(told: Told, rng: np.random.Generator) -> Told:
        return replace(told, known=replace(told.known, friction=friction, wall_friction=friction))

    return depart


def stop_after_ten(told: Told, rng: np.random.Generator) -> Told:
    """Radii are a little wrong, and the last photographs were not taken."""
    told = scatter_radii(0.003)(told, rng)
    assert told.rotation is not None
    return replace(
        told, position=told.position[:TEN], rotation=told.rotation[:TEN], endpoints=told.endpoints[:TEN],
        load=told.load[:TEN]
    )  # fmt: skip


def photograph_discs(told: Told, rng: np.random.Generator) -> Told:
    """Discs as photoelastic tests show them: no rotations, and all radii too small."""
    return replace(shrink_radii(told, rng), rotation=None)


def _crossing(start: Array, along: Array, other_start: Array, other_along: Array) -> Array:
    """Where lines through start (f, 2) along (f, 2) meet others (f, 2) [m]."""
    cross = along[:, 0] * other_along[:, 1] - along[:, 1] * other_along[:, 0]
    between = other_start - start
    s = (between[:, 0] * other_along[:, 1] - between[:, 1] * other_along[:, 0]) / cross
    return start + s[:, None] * along
