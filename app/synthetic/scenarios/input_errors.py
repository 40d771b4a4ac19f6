"""Wrong input: mistakes that people make in tables and settings, one function each.

Sizes are those met in practice: a sign, a unit, a row too late, a few per cent of a radius.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from .departures import Departure
from .observed_data import ObservedData

OUTLIERS, OUTLIER_SIZE = 0.02, (3e-4, 2e-3)  # of all poses; [m]
MISSING = 0.1  # of all poses
WRONG_CLASS = 0.1  # of the rods
MISSTATED = 0.2  # of the rods whose radii are stated too large by CLASS_ERROR
CLASS_ERROR = 0.02  # of one class of radii
INSIDE = 2e-3  # [m], by which a side is stated inside the packing
WALL_SCATTER = 1e-4  # [m] of a component of an end of a wall
EXCHANGED = 0.02  # of the rods, each with the one nearest to it
JUMP = 1e-3  # [m] of one rod in one photograph
OVERHANG = 0.05  # [m] of the bars beyond the packing at either end
CORRELATED_NOISE, CORRELATION = 1e-5, 0.9  # [m] of a position component; from photograph to photograph


def reverse_time(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """List the photographs in reverse order."""
    return _reorder(observed, np.arange(len(observed.position))[::-1])


def shuffle_frames(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """List the photographs in random order."""
    return _reorder(observed, rng.permutation(len(observed.position)))


def swap_frames(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Swap every second photograph with its successor."""
    order = np.arange(len(observed.position))
    for k in range(2, len(order) - 1, 3):
        order[[k, k + 1]] = order[[k + 1, k]]
    return _reorder(observed, order)


def duplicate_frame(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Take one photograph twice."""
    order = np.arange(len(observed.position))
    order[len(order) // 2 :] -= 1
    return _reorder(observed, order)


def scale_rotation(factor: float) -> Departure:
    """State rotations times a factor: −1 clockwise, 0 unknown but stated, 180/π in degrees."""

    def depart(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        assert observed.rotation is not None
        return replace(observed, rotation=factor * observed.rotation)

    return depart


def drop_rotation(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State no rotations."""
    return replace(observed, rotation=None)


def delay_walls(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the walls one photograph late."""
    late = np.maximum(np.arange(len(observed.position)) - 1, 0)
    return replace(observed, endpoints=observed.endpoints[late])


def delay_left(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the left side half a photograph late."""
    endpoints, left = observed.endpoints.copy(), observed.wall_names.index("left")
    endpoints[1:, left] = 0.5 * (observed.endpoints[1:, left] + observed.endpoints[:-1, left])
    return replace(observed, endpoints=endpoints)


def fix_top(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the plate at rest."""
    endpoints, top = observed.endpoints.copy(), observed.wall_names.index("top")
    endpoints[:, top] = endpoints[0, top]
    return replace(observed, endpoints=endpoints)


def shift_side_inwards(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the right side inside the packing, so that rods stand beyond it."""
    endpoints, right = observed.endpoints.copy(), observed.wall_names.index("right")
    endpoints[:, right, :, 0] -= INSIDE
    return replace(observed, endpoints=endpoints)


def scatter_walls(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the ends of all walls with an error that is another in every photograph."""
    error = WALL_SCATTER * rng.standard_normal(observed.endpoints.shape)
    return replace(observed, endpoints=observed.endpoints + error)


def stretch_picture(factor: float) -> Departure:
    """Stretch x of rods and walls by a relative error, as non-square pixels do."""

    def depart(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        scale = np.array([1.0 + factor, 1.0])
        return replace(observed, position=observed.position * scale, endpoints=observed.endpoints * scale)

    return depart


def distort_picture(factor: float) -> Departure:
    """Move rods and ends of walls outward as a lens does, by a relative distance at the farthest corner."""

    def depart(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
        middle = 0.5 * (observed.endpoints.min(axis=(0, 1, 2)) + observed.endpoints.max(axis=(0, 1, 2)))
        farthest = float(np.linalg.norm(observed.endpoints - middle, axis=-1).max())

        def distorted(points: Array) -> Array:
            offset = points - middle
            square = np.sum(offset**2, axis=-1, keepdims=True) / farthest**2
            return points + factor * square * offset

        return replace(
            observed, position=distorted(observed.position), endpoints=distorted(observed.endpoints)
        )  # fmt: skip

    return depart


def misstate_class(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the radius of the middle class too large."""
    radius, middle = observed.radius.copy(), np.median(observed.radius)
    radius[np.isclose(radius, middle)] *= 1.0 + CLASS_ERROR
    return replace(observed, radius=radius)


def misstate_some(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the radii of some rods of all sizes too large."""
    radius = observed.radius.copy()
    radius[rng.permutation(len(radius))[: round(MISSTATED * len(radius))]] *= 1.0 + CLASS_ERROR
    return replace(observed, radius=radius)


def confuse_classes(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State some rods as of another class."""
    radius, classes = observed.radius.copy(), np.unique(observed.radius)
    chosen = rng.permutation(len(radius))[: round(WRONG_CLASS * len(radius))]
    radius[chosen] = classes[(np.searchsorted(classes, radius[chosen]) + 1) % len(classes)]
    return replace(observed, radius=radius)


def exchange_ids(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State rods under the names of their nearest neighbours from the middle of the sequence on, some pairs of them."""
    position, middle = observed.position.copy(), len(observed.position) // 2
    rotation = None if observed.rotation is None else observed.rotation.copy()
    row = np.arange(len(observed.radius))
    for one in rng.permutation(len(row))[: max(round(EXCHANGED * len(row)), 1)].tolist():
        apart = np.linalg.norm(position[middle] - position[middle, one], axis=1)
        other = int(np.argsort(apart)[1])
        if row[one] == one and row[other] == other:
            row[one], row[other] = other, one
    position[middle:] = position[middle:, row]
    if rotation is not None:
        rotation[middle:] = rotation[middle:, row]
    return replace(observed, position=position, rotation=rotation)


def extend_bars(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the ends of the plate, which overhangs the packing, as its wall."""
    endpoints, top = observed.endpoints.copy(), observed.wall_names.index("top")
    along = endpoints[:, top, 1] - endpoints[:, top, 0]
    along *= OVERHANG / np.linalg.norm(along, axis=1)[:, None]
    endpoints[:, top, 0] -= along
    endpoints[:, top, 1] += along
    return replace(observed, endpoints=endpoints)


def add_outliers(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Displace some poses of single photographs by .3 to 2 mm."""
    frames, n = observed.position.shape[:2]
    wrong = rng.random((frames, n)) < OUTLIERS
    wrong[0] = False
    size, angle = rng.uniform(*OUTLIER_SIZE, (frames, n)), rng.uniform(0.0, 2.0 * np.pi, (frames, n))
    shift = np.where(wrong, size, 0.0)[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return replace(observed, position=observed.position + shift)


def displace_one_pose(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Displace one rod in one photograph in the middle."""
    position, frame, rod = observed.position.copy(), len(observed.position) // 2, len(observed.id) // 2
    angle = rng.uniform(0.0, 2.0 * np.pi)
    position[frame, rod] += JUMP * np.array([np.cos(angle), np.sin(angle)])
    return replace(observed, position=position)


def lose_poses(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Leave rods out of some photographs, other ones in each."""
    lost = rng.random(observed.position.shape[:2]) < MISSING
    lost[0] = False
    return replace(observed, lost=lost)


def correlate_noise(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """Add errors of the centres that change slowly from photograph to photograph."""
    error = CORRELATED_NOISE * rng.standard_normal(observed.position.shape)
    for k in range(1, len(error)):
        error[k] = CORRELATION * error[k - 1] + np.sqrt(1.0 - CORRELATION**2) * error[k]
    return replace(observed, position=observed.position + error)


def state_walls_rough(observed: ObservedData, rng: np.random.Generator) -> ObservedData:
    """State the rods' friction for smooth walls, too."""
    return replace(observed, known=replace(observed.known, wall_friction=observed.known.friction))


def _reorder(observed: ObservedData, order: NDArray[np.int64]) -> ObservedData:
    """List the photographs (f,) in another order; their truth follows them."""
    rotation: Array | None = None if observed.rotation is None else observed.rotation[order]
    return replace(
        observed, position=observed.position[order], rotation=rotation, endpoints=observed.endpoints[order], shown=order
    )
