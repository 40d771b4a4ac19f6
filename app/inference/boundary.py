"""The boundary and the noise before anything is calibrated: what was measured tells both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.bodies.grains import Grains
from solver.boundary.boundary import Boundary, BoundarySettings, mend_boundary
from solver.detection.precision import contradiction, describe_contradiction, measure_precision

from ..tracks import Tracks, WallTracks
from .snapshots import make_snapshots, measure_sequence


def measure_noise(tracks: Tracks, walls: WallTracks) -> tuple[Tracks, str]:
    """Put the noise that the gaps show in the place of that stated, where they contradict, and say so.

    Constant errors of centres and radii leave it alone: it is read from what the gaps of touching rods do in time.
    """
    grains = Grains.of_rods(tracks.radius, density=1.0, length=1.0)
    found = measure_precision(grains, make_snapshots(replace(tracks, centre_sigma=None), walls))
    if found is None:
        return tracks, ""
    factor = contradiction(found, _stated_noise(tracks))
    if factor == 1.0:
        return tracks, ""
    return replace(tracks, sigma=factor * tracks.sigma), describe_contradiction(found, factor)


def _stated_noise(tracks: Tracks) -> float:
    """Standard deviation of a position component [m], rms over all poses."""
    return float(np.sqrt(np.mean(tracks.sigma[tracks.present] ** 2)))


def mend(settings: BoundarySettings, tracks: Tracks, walls: WallTracks) -> tuple[Tracks, WallTracks, Boundary | None]:
    """Walls as rigid bars that meet, rods as the walls see them; None without motion that would tell."""
    if tracks.frame_count < 2 or walls.count == 0:
        return tracks, walls, None
    measured = measure_sequence(tracks, walls)
    found, boundary = mend_boundary(measured, _stated_noise(tracks), walls.ends_told, settings)
    rotation = np.where(np.isfinite(tracks.rotation), found.rotation, np.nan)
    mended = replace(tracks, position=found.position, rotation=rotation)
    return mended, replace(walls, endpoints=found.endpoints), boundary
