"""Errors that a run removes, exchanged sizes and a distorted picture, as causes; other tests see the input without."""

from __future__ import annotations

from collections.abc import Collection

from ...results.finding import Finding
from ...solver.boundary.camera_distortion import ANISOTROPY, CameraDistortion
from ...tracks import Tracks, WallTracks
from ..correction.boundary import correct_camera
from ..correction.radii import correct_exchanged_sizes
from ..inputs import Inputs
from .causes import finding


def undistorted(
    inputs: Inputs, walls: WallTracks, failed: Collection[int], *, camera: bool = True
) -> tuple[Tracks, WallTracks, list[Finding]]:
    """Return tracks and walls as a run corrects them for exchanged sizes and the camera, and what it corrects.

    camera: False: its distortion was sought, and there is none.
    """
    settings, tracks, exchanged = inputs.settings, inputs.tracks, ""
    if settings.calibration is not None:
        tracks, exchanged = correct_exchanged_sizes(tracks, walls)
    named = [finding("exchanged_sizes", exchanged)] if exchanged else []
    if not (camera and seeks_distortion(inputs, walls)):
        return tracks, walls, named
    tracks, walls, _, found = correct_camera(
        inputs.material, tracks, walls, failed, radii_known=settings.radii_are_known
    )
    return tracks, walls, named if found is None else [*named, _name(found)]


def seeks_distortion(inputs: Inputs, walls: WallTracks) -> bool:
    """Whether a run looks for a distortion of the camera in the gaps between rods."""
    boundary = inputs.settings.boundary
    return boundary is not None and bool(boundary.camera) and walls.count > 0


def _name(found: CameraDistortion) -> Finding:
    """Name a stretching, or the lens where there is a radial distortion."""
    cause = "stretched_picture" if found.value[ANISOTROPY].any() and not found.radial_change() else "lens"
    return finding(cause, found.describe()[0])
