"""Correction of the boundary and the noise before calibration."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ...solver.bodies.grains import Array
from ...solver.bodies.rods import RodMaterial
from ...solver.boundary.boundary_correction import Boundary, BoundarySettings, correct_boundary
from ...solver.boundary.camera_distortion import CameraDistortion, find_camera_distortion
from ...solver.boundary.size_classes import group_readings
from ...solver.boundary.touching_pairs import find_near_pairs
from ...solver.boundary.walls_in_picture import correct_walls_in_picture
from ...solver.detection.precision import contradiction, describe_contradiction, measure_precision
from ...solver.even_subset import even_subset
from ...solver.mixture.soft_grains import find_soft_overlap
from ...solver.posterior.sequence_evidence import gather_position_evidence
from ...tracks import Tracks, WallTracks, held_once
from ..snapshots import grains_of, make_snapshots, measure_sequence, pack_seen
from .calibration import radius_classes

# Rms change of the gaps of near grains over the mean overlap of soft ones, below which a distortion is none of the
# picture: forces are larger in the direction of the greatest stress, or at greater depth, and so are overlaps. In seven
# packings with right positions it was at most .43, in fourteen with a distorted picture 1.2 or more.
BY_FORCES = 0.7
CHANGED_FRAMES = 4  # in which these changes are measured


def measure_noise(tracks: Tracks, walls: WallTracks) -> tuple[Tracks, str]:
    """Replace the stated noise by the noise that the gaps show, where they contradict.

    The noise is read from changes of the gaps of touching rods in time, so constant errors of centres and radii do not
    enter.

    Returns
    -------
    Tracks
    str
        A sentence on the contradiction; empty: none.
    """
    grains = grains_of(tracks)
    found = measure_precision(grains, make_snapshots(replace(tracks, centre_sigma=None), walls))
    if found is None:
        return tracks, ""
    factor = contradiction(found, _stated_noise(tracks))
    if factor == 1.0:
        return tracks, ""
    return replace(tracks, sigma=held_once(factor * tracks.sigma)), describe_contradiction(found, factor)


def correct_camera(
    material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int], *, radii_known: bool = False
) -> tuple[Tracks, WallTracks, str, CameraDistortion | None]:
    """Remove the camera's distortion where gaps of touching pairs show one.

    Walls are corrected as well unless the given ones fit the corrected grains better. In a packing without walls the
    radii of each size of soft grains, which are not calibrated later, are corrected where no overlap explains their
    gaps.

    Parameters
    ----------
    material : RodMaterial
    tracks : Tracks
    walls : WallTracks
    failed : collection of int
        Unusable frames.
    radii_known : bool
        Whether the radii are exact, and give the pixel size of a distorted picture; else they are adapted.

    Returns
    -------
    Tracks
    WallTracks
    str
        Sentences on the correction and on what remains; empty: neither.
    CameraDistortion or None
        The distortion and the errors of the radii; None: not sought, or with walls: none.
    """
    if walls.cell is not None:
        return tracks, walls, "", None
    soft = material.stiffness not in (None, "rigid")
    classes = group_readings(tracks.radius)  # whole pixels are few different radii, but no sizes
    classes = radius_classes(tracks.radius) if classes is None else classes
    position = np.where(tracks.present[..., None], tracks.position, np.nan)
    classes = np.zeros(tracks.grain_count, np.int64) if classes is None else classes
    found = find_camera_distortion(
        position, tracks.radius, classes, soft=soft and not walls.count, boundary=tracks.boundary
    )
    if found is None:
        return tracks, walls, "", None
    if walls.count:
        if not found.applied:  # calibration finds a lesser distortion with the walls
            return tracks, walls, "", None
        # Touching surfaces of hard grains meet by other distances, or by other radii if read in the same picture.
        if material.stiffness != "rigid":
            undistorted = replace(tracks, position=found.correct(tracks.position))
            overlap = find_soft_overlap(*pack_seen(material, undistorted, walls, failed))
            if _changed_gap(found, position, tracks.radius) < BY_FORCES * overlap:
                return tracks, walls, "", None
            soft = soft or overlap > 0.0  # overlaps are forces then, and no error of the scale
        scale = 1.0 if soft else found.common_scale()
        distance, radius = (scale, tracks.radius) if radii_known else (1.0, tracks.radius / scale)
        corrected = found.correct_scaled(position, distance)
        ends = correct_walls_in_picture(found, walls.endpoints, walls.side, corrected, radius, scale=distance)
        sentences = found.describe()
        if not soft:
            changed = (
                f"distances were multiplied by {scale:.4f}" if radii_known else f"radii were divided by {scale:.4f}"
            )
            sentences[0] += f", and {changed}, so that touching grains meet"
        if ends is walls.endpoints:
            sentences.append("walls were not in this picture: they are used as given")
        kept = np.where(tracks.present[..., None], corrected, tracks.position)
        moved = replace(tracks, position=kept, radius=radius)
        return moved, replace(walls, endpoints=ends), "; ".join(sentences), found
    sentences, radius = found.describe(), tracks.radius
    correction = found.class_correction(_noise_of_gaps(material, tracks, walls, failed)) if soft else None
    if correction is not None:
        radius = radius + correction[classes]
        found = replace(found, radius_factor=1.0 + correction / found.size)
        changes = ", ".join(
            f"{1e6 * each:+.0f} ± {1e6 * sd:.0f}" for each, sd in zip(correction, found.radius_error_sd, strict=True)
        )
        sentences.append(f"radii of the sizes are corrected by {changes} µm, so that grains of all sizes touch alike")
    return (
        replace(tracks, position=found.correct(tracks.position), radius=radius), walls, "; ".join(sentences), found,
    )  # fmt: skip


def _changed_gap(found: CameraDistortion, position: Array, radius: Array) -> float:
    """Standard deviation of the change of gaps [m] by a correction of positions (f, n, 2) [m], over near grains."""
    change = [np.empty(0)]
    for k in even_subset(len(position), CHANGED_FRAMES):
        near, corrected = find_near_pairs(position[k], radius), found.correct(position[k])
        apart = np.linalg.norm(corrected[near.j] - corrected[near.i], axis=1)
        change.append(apart - radius[near.i] - radius[near.j] - near.gap)
    changes = np.concatenate(change)
    return float(np.std(changes)) if len(changes) else 0.0


def _noise_of_gaps(material: RodMaterial, tracks: Tracks, walls: WallTracks, failed: Collection[int]) -> float:
    """Standard deviation of a position component [m] by the changes of gaps; the stated one without near grains."""
    try:
        return gather_position_evidence(*pack_seen(material, tracks, walls, failed)).noise.sigma
    except ValueError:  # no two bodies are near
        return _stated_noise(tracks)


def _stated_noise(tracks: Tracks) -> float:
    """Standard deviation of a position component [m], rms over all poses."""
    return float(np.sqrt(np.mean(tracks.sigma[tracks.present] ** 2)))


def correct_walls(
    settings: BoundarySettings, tracks: Tracks, walls: WallTracks
) -> tuple[Tracks, WallTracks, Boundary | None]:
    """Correct walls to rigid bars that meet, and rods in the frame of the walls; None without motion."""
    if tracks.frame_count < 2 or walls.count == 0:
        return tracks, walls, None
    measured = measure_sequence(tracks, walls)
    found, boundary = correct_boundary(measured, _stated_noise(tracks), walls.end_kinds, settings)
    rotation = np.where(np.isfinite(tracks.rotation), found.rotation, np.nan)
    corrected = replace(tracks, position=found.position, rotation=rotation)
    return corrected, replace(walls, endpoints=found.endpoints), boundary
