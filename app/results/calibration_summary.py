"""The results of the self-calibration as numbers for summary.json."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..solver.bodies.grains import Array
from ..solver.boundary.camera_distortion import TERMS, CameraDistortion
from ..solver.calibration.calibrate import Calibration


def calibration_facts(found: Calibration, walls: tuple[str, ...]) -> dict[str, Any]:
    """Return the corrections with their standard deviations, and the rms gap of touching surfaces before and after.

    Lengths are in m, angles in rad. Corrections and standard deviations of centres and radii are rms over grains, of a
    component and of a radius.
    """
    return {
        "applied": found.applied,
        "verdict": found.verdict,
        "centre_rms": _rms(found.offset),
        "centre_sd": _rms(found.offset_sd),
        "radius_rms": _rms(found.radius),
        "radius_sd": _rms(found.radius_sd),
        "wall": {
            name: {
                "outward": float(found.wall[w]),
                "outward_sd": float(found.wall_sd[w]),
                "tilt": float(found.wall_tilt[w]),
                "tilt_sd": float(found.wall_tilt_sd[w]),
            }
            for w, name in enumerate(walls)
        },
        "pixel_size": found.pixel_size,
        "pixel_size_sd": found.pixel_size_sd,
        "walls_follow_pixel_size": found.walls_follow,
        "radius_offset": found.radius_offset,
        "radius_offset_sd": found.radius_offset_sd,
        "radius_factor": found.radius_factor,
        "radius_factor_sd": found.radius_factor_sd,
        "walls_decide": found.walls_decide,
        "lens": found.lens,
        "lens_sd": found.lens_sd,
        "gap_rms_before": found.before.spread,
        "gap_rms_after": found.after.spread,
        "wall_gap_rms_before": found.before.wall_spread,
        "wall_gap_rms_after": found.after.wall_spread,
        "noise_factor": found.noise_factor,
    }


def camera_facts(found: CameraDistortion) -> dict[str, Any]:
    """Return the terms of the camera's distortion over the half-width of the picture, and the errors of radii [m]."""
    return {
        "applied": found.applied,
        "description": found.describe_terms(),
        "terms": {name: {"value": float(found.value[k]), "sd": float(found.sd[k])} for k, name in enumerate(TERMS)},
        "gap_scatter_before": found.scatter,
        "gap_scatter_after": found.explained,
        "gap_range_unexplained": found.unexplained,
        "sizes": [
            {"radius": radius, "error": error, "error_sd": sd, "factor": factor}
            for radius, error, sd, factor in zip(
                *(
                    each.tolist()
                    for each in (found.size, found.radius_error, found.radius_error_sd, found.radius_factor)
                ),
                strict=True,
            )
        ],
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(np.square(values)))) if np.isfinite(values).any() else 0.0
