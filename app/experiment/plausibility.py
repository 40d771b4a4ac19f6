"""Whether tracks, radii and walls can belong together: mistaken units, origins and directions are refused early."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from solver.bodies.grains import Array

from ..errors import InputError
from ..tracks import Tracks, WallTracks
from .experiment import Experiment

NEIGHBOURS = 8  # of a grain, among which is the one it is closest to in radii
SPACING = (0.93, 1.15)  # of neighbours over their radii, median: packed rods touch, whatever the noise
GREATEST_RADIUS = 0.5  # [m] of a rod
NEAR = 0.05  # radii from a wall's line: a rod as near as that may bear on it
BEYOND = 0.5  # radii past a wall's end


def check_radii(experiment: Experiment, tracks: Tracks) -> None:
    """Packed rods touch: their nearest neighbours must lie about the sum of two radii away.

    Diameters given as radii, another unit or another scale leave nothing to compute forces from.
    """
    section = experiment.config.tracks
    file = experiment.file if section is None else experiment.folder / section.grains
    key = "key photographs.pixel_size or photographs.radii" if section is None else "column radius"
    middle = float(np.median(tracks.radius))
    if middle > GREATEST_RADIUS:
        raise InputError(file, key, f"makes the median radius {middle:g} m: lengths are in metres")
    spacing = neighbour_spacing(tracks.position[0][tracks.present[0]], tracks.radius[tracks.present[0]])
    if len(spacing) and not SPACING[0] <= (found := float(np.median(spacing))) <= SPACING[1]:
        state = "overlap" if found < 1.0 else "stand apart"
        raise InputError(
            file, key, f"does not fit the positions: neighbours {state}, their distance is {found:.2f} times "
            "the sum of their radii (median of frame 0); radii, not diameters, in metres",
        )  # fmt: skip


def rods_beyond_ends(tracks: Tracks, walls: WallTracks) -> list[str]:
    """A sentence for every wall on whose line rods bear beyond its ends: walls are taken as endless lines.

    Such a wall was perhaps measured too short, which does no harm; or these rods bear on nothing, and forces are wrong.
    """
    start = walls.endpoints[:, :, 0]
    along = walls.endpoints[:, :, 1] - start
    length = np.linalg.norm(along, axis=-1)  # (f, w)
    unit = along / length[..., None]
    sentences = []
    for w, name in enumerate(walls.name):
        place = tracks.position - start[:, None, w]
        ahead = np.einsum("fnk,fk->fn", place, unit[:, w])
        inside = place[..., 1] * unit[:, None, w, 0] - place[..., 0] * unit[:, None, w, 1]
        near = np.abs(inside - tracks.radius) < NEAR * tracks.radius  # NaN of lost grains compares false
        past = np.maximum(-ahead, ahead - length[:, None, w]) > BEYOND * tracks.radius
        rods = int((near & past).any(axis=0).sum())
        if rods:
            sentences.append(
                f"{rods} rod{'s' if rods > 1 else ''} may bear on the line of wall {name!r} beyond its end, and will "
                "be taken to: is the wall longer than its two points tell?"
            )
    return sentences


def neighbour_spacing(position: Array, radius: Array) -> Array:
    """Least distance over the sum of radii to another grain (n,); position (n, 2) and radius (n,) [m]."""
    count = min(NEIGHBOURS + 1, len(radius))
    if count < 2:
        return np.empty(0)
    distance, other = (np.asarray(found) for found in KDTree(position).query(position, count))
    return (distance[:, 1:] / (radius[:, None] + radius[other[:, 1:]])).min(axis=1)


def check_inside(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> None:
    """No centre may lie beyond a wall by more than the grain's radius: a mistaken unit, origin or direction."""
    section = experiment.config.walls
    assert section is not None
    start = walls.endpoints[:, :, 0]
    along = walls.endpoints[:, :, 1] - start
    outward = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
    for w, name in enumerate(walls.name):
        beyond = np.einsum("fnk,fk->fn", tracks.position - start[:, None, w], outward[:, w])
        outside = np.argwhere(beyond > tracks.radius)  # NaN of lost grains compares false
        if len(outside):
            k, row = (int(v) for v in outside[0])
            raise InputError(
                experiment.folder / section.file,
                f"frame {k}, wall {name!r}",
                f"grain {tracks.id[row]} lies {beyond[k, row] * 1e3:.4g} mm beyond it; "
                "the packing must lie to the left of the line from (x1, y1) to (x2, y2), all in metres",
            )
