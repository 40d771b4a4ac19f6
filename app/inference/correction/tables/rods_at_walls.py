"""Rods beside, near and at straight walls, as the corrections of walls read them from tracks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import behind_body, beside_wall, distance_from_walls
from ....solver.boundary.touching_pairs import find_near_pairs
from ....solver.even_subset import even_subset
from ....tracks import Tracks, WallTracks

NEAR = 1.0  # mean radius up to which the gap of a rod is looked at
SIGMAS = 3.0  # standard deviations of a position up to which a gap is that of a contact
FRAMES, COVERED = 4, 0.9  # photographs in which the overlaps of rods are read, and the part of them that is usual
ROUGH = 2e-3  # mean radius, the same of rods whose radii are known no better


@dataclass(frozen=True, slots=True)
class RodsAtWalls:
    """Rods of all photographs, with the gaps of those that are near a wall and of those that touch it."""

    tracks: Tracks
    reach: float  # [m] greatest gap or overlap of a rod that is near a wall
    width: float  # [m] of a rod that touches it

    @classmethod
    def of(cls, tracks: Tracks) -> RodsAtWalls:
        """Rods touch within three standard deviations of a position, .002 mean radii, or the overlaps between rods."""
        radius = float(tracks.radius.mean())
        noise = SIGMAS * float(np.nanmedian(tracks.position_sigma))
        return cls(tracks, NEAR * radius, max(noise, ROUGH * radius, _overlap(tracks, noise)))

    def beside(self, k: int, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Rods (m,) of photograph k that project onto a wall (2, 2), and their gaps from it (m,) [m]."""
        here = np.flatnonzero(self.tracks.present_in(k))
        here = here[beside_wall(ends, None, self.tracks.position[k, here], np.zeros(len(here)))]
        return here, self.gaps(k, here, ends)

    def near(self, k: int, ends: Array) -> tuple[NDArray[np.intp], Array]:
        """Rods (m,) of photograph k near a wall (2, 2), and their gaps from it (m,) [m]."""
        here, gap = self.beside(k, ends)
        near = np.abs(gap) < self.reach
        return here[near], gap[near]

    def nearest_gap(self, k: int, walls: WallTracks, w: int, number: int) -> float:
        """Gap [m] between wall w and one of the nearest rods beside it, from number 1 on; NaN: there is none."""
        rows, gap = self.beside(k, walls.endpoints[k, w])
        if not np.isnan(walls.endpoints[k]).any():
            gap = gap[~behind_body(walls.endpoints[k], walls.sides, self.tracks.position[k, rows])[:, w]]
        return float(np.sort(gap)[number - 1]) if len(gap) >= number else np.nan

    def gaps(self, k: int, rows: NDArray[np.intp], ends: Array) -> Array:
        """Gaps [m] of rods (m,) of photograph k from a wall (2, 2), (m,), or with ends (t, 1, 2, 2), (t, m)."""
        return distance_from_walls(ends, None, self.tracks.position[k, rows]) - self.tracks.radius[rows]

    def surface_motion(self, k: int, rows: NDArray[np.intp], along: Array) -> Array:
        """Motion (m,) [m] to photograph k, in the direction (2,) of a wall, of the points of rods (m,) at the wall.

        The wall runs counter-clockwise around the packing. NaN where a rod is missing; unknown rotations count as none.
        """
        tracks = self.tracks
        moved = tracks.position[k, rows] - tracks.position[k - 1, rows]
        turned = np.nan_to_num(tracks.rotation[k, rows] - tracks.rotation[k - 1, rows])
        return moved @ along + turned * tracks.radius[rows]

    def touching(self, k: int, rows: NDArray[np.intp], ends: Array) -> NDArray[np.bool_]:
        """Whether rods (m,) of photograph k touch a wall that has ends (t, 2, 2): (t, m)."""
        return np.abs(self.gaps(k, rows, ends[:, None])) < self.width


def _overlap(tracks: Tracks, noise: float) -> float:
    """Overlap [m] that nine of ten rods that touch each other do not exceed; noise: greatest gap [m] of such rods."""
    gaps = [np.empty(0)]
    for k in even_subset(tracks.frame_count, FRAMES):
        position = np.where(tracks.present_in(k)[:, None], tracks.position[k], np.nan)
        gap = find_near_pairs(position, tracks.radius, tracks.boundary).gap
        gaps.append(gap[gap < noise])
    touching = np.concatenate(gaps)
    return float(np.quantile(-touching, COVERED)) if len(touching) else 0.0
