"""Tracks and walls as the solver reads them: one snapshot a photograph."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..solver.bodies.grains import Array, Grains
from ..solver.bodies.interpolation import interpolate_ignored_frames
from ..solver.bodies.motion import Snapshot
from ..solver.bodies.packing import Packing
from ..solver.bodies.rods import RodMaterial
from ..solver.calibration.gaps import MeasuredSequence
from ..solver.inferred.unknown_rotations import fill_unknown_rotations
from ..tracks import Tracks, WallTracks

MOST_SPREAD = 60.0  # over the usual standard deviation of a centre: beyond, a rim is not seen at all
INTERPOLATED_SIGMAS = (
    10.0  # standard deviations of an interpolated pose over those of a measured one: a weak measurement
)


def make_snapshots(tracks: Tracks, walls: WallTracks) -> list[Snapshot]:
    """What the solver reads of tracks and walls."""
    present, sigma = tracks.present, tracks.position_sigma
    rotation = _rotations(tracks, walls)
    return [
        Snapshot(
            float(tracks.time[k]), tracks.position[k], rotation[k], present[k], walls.endpoints[k],
            float(sigma[k]), walls.side, walls.load_at(k), None if walls.cell is None else walls.cell[k],
            walls.plate, None if tracks.fringes is None else tracks.fringes[k],
        )
        for k in range(tracks.frame_count)
    ]  # fmt: skip


def grains_of(tracks: Tracks) -> Grains:
    """The grains of tracks with their boundary, for questions of geometry: their masses are those of a unit density."""
    return Grains.of_rods(tracks.radius, density=1.0, length=1.0, boundary=tracks.boundary)


def pack_seen(
    material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int]
) -> tuple[Packing, list[Snapshot]]:
    """The packing and its snapshots, those of unusable photographs interpolated."""
    packing = material.pack(tracks.radius, walls.usual_pressure(material.length), boundary=tracks.boundary)
    return packing, interpolate_ignored_frames(make_snapshots(tracks, walls), failed)


def measure_sequence(tracks: Tracks, walls: WallTracks) -> MeasuredSequence:
    """The same as what calibration reads."""
    present = tracks.present & ~tracks.interpolated
    rotation = _rotations(tracks, walls)
    sigma = np.where(tracks.interpolated, INTERPOLATED_SIGMAS * tracks.sigma, tracks.sigma)
    sigma[~tracks.present] = 0.0
    return MeasuredSequence(
        tracks.radius, tracks.position, rotation, present, walls.endpoints, sigma, walls.side, walls.cell,
        _centre_spread(tracks), tracks.boundary,
    )  # fmt: skip


def _centre_spread(tracks: Tracks) -> Array | None:
    """Return how much more uncertain each centre is than most of them (n,); None where all are alike."""
    sd = tracks.centre_sigma
    if sd is None or not np.any(known := np.isfinite(sd) & (sd > 0.0)):
        return None
    usual = float(np.median(sd[known]))
    spread = np.where(known, np.clip(sd / usual, 1.0, MOST_SPREAD), 1.0)
    return None if np.all(spread == 1.0) else spread


def _rotations(tracks: Tracks, walls: WallTracks) -> Array:
    return fill_unknown_rotations(
        tracks.radius, tracks.position, tracks.rotation, tracks.present, walls.endpoints, side=walls.side,
        cell=walls.cell,
    )  # fmt: skip
