"""Errors that a run removes, exchanged sizes and a distorted picture, as causes; other tests see the input without."""

from __future__ import annotations

from collections.abc import Collection

from ...results.finding import Finding
from ...solver.boundary.camera_distortion import ANISOTROPY, CameraDistortion
from ...tracks import Tracks, WallTracks
from ..correction.boundary import correct_camera
from ..correction.radii import correct_exchanged_sizes
from ..correction.softness import assume_softness
from ..inputs import Inputs
from .causes import finding


def undistorted(
    inputs: Inputs, walls: WallTracks, failed: Collection[int], *, camera: bool | None = None
) -> tuple[Tracks, WallTracks, list[Finding]]:
    """Return tracks and walls as a run corrects them for exchanged sizes and the camera, and what it corrects.

    camera: whether to look for its distortion; None: as a run.
    """
    settings, tracks, exchanged = inputs.settings, inputs.tracks, ""
    if settings.calibration is not None:
        tracks, exchanged = correct_exchanged_sizes(tracks, walls)
    named = [finding("exchanged_sizes", exchanged)] if exchanged else []
    if not (seeks_distortion(inputs, walls, failed) if camera is None else camera):
        return tracks, walls, named
    tracks, walls, _, found = correct_camera(
        inputs.material, tracks, walls, failed, radii_known=settings.radii_are_known
    )
    if found is None or not found.applied:
        return tracks, walls, named
    return tracks, walls, [*named, _name(found, corrected=not _overlaps_are_forces(inputs, walls, failed))]


def seeks_distortion(inputs: Inputs, walls: WallTracks, failed: Collection[int]) -> bool:
    """Whether a run looks for a distortion of the camera in the gaps between rods, and no overlaps hide it."""
    if not inputs.seeks_distortion or walls.cell is not None:
        return False
    return walls.count > 0 or not _overlaps_are_forces(inputs, walls, failed)


def _overlaps_are_forces(inputs: Inputs, walls: WallTracks, failed: Collection[int]) -> bool:
    """Whether grains are soft: a distortion and their overlaps then look alike, and only a part of it is removed."""
    material, _ = assume_softness(inputs.material, inputs.tracks, walls, failed)
    return material.stiffness not in (None, "rigid")


def _name(found: CameraDistortion, *, corrected: bool) -> Finding:
    """Name a stretching, or the lens where there is a radial distortion."""
    cause = "stretched_picture" if found.value[ANISOTROPY].any() and not found.radial_change() else "lens"
    return finding(cause, found.describe()[0], corrected=corrected)
