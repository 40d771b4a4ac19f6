"""Distortion of the picture, which a run removes, as a cause; other tests see the input without it."""

from __future__ import annotations

from collections.abc import Collection

from ...results.finding import Finding
from ...solver.boundary.camera_distortion import ANISOTROPY, CameraDistortion
from ...tracks import Tracks, WallTracks
from ..correction.boundary import correct_camera
from ..inputs import Inputs
from .causes import finding


def undistorted(inputs: Inputs, walls: WallTracks, failed: Collection[int]) -> tuple[Tracks, WallTracks, list[Finding]]:
    """Return tracks and walls as a run corrects them for the camera, and what it corrects."""
    settings = inputs.settings
    if settings.boundary is None or not settings.boundary.camera or not walls.count:
        return inputs.tracks, walls, []
    tracks, walls, _, found = correct_camera(
        inputs.material, inputs.tracks, walls, failed, radii_known=settings.radii_are_known
    )
    return tracks, walls, [] if found is None else [_name(found)]


def _name(found: CameraDistortion) -> Finding:
    """Name a stretching, or the lens where there is a radial distortion."""
    cause = "stretched_picture" if found.value[ANISOTROPY].any() and not found.radial_change() else "lens"
    return finding(cause, found.describe()[0])
