"""Tracking of the discs in the corners of a frame, as the grains are tracked, by their texture.

A disc is given by its centre in the first photograph and by its radius, which was measured by itself. Its rim refines
the centre.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..experiment.experiment import Experiment
from ..experiment.walls import place_corners
from ..solver.bodies.wall_shapes import OUT, circle_parameters
from ..tracks import WallTracks
from .detection.detect import Detection, refine_grains
from .follow import Execution, ReferenceGrains, Series, follow_photographs

CORNERS = "tracked_corners.csv"
FARTHEST = 3.0  # [px] of a rim's centre from the given one: beyond, it is the rim of something else


def follow_corners(
    experiment: Experiment, series: Series, walls: WallTracks, execution: Execution
) -> tuple[WallTracks, dict[str, NDArray[Any]]]:
    """Track the corner discs of the first photograph, and the bars through their centres.

    Parameters
    ----------
    experiment : Experiment
        With `walls.corners`.
    series : Series
        The photographs.
    walls : WallTracks
        The discs are the last walls, complete in frame 0.
    execution : Execution
        Threads, checkpoints and progress.

    Returns
    -------
    WallTracks
        NaN where a disc is not found.
    dict
        The table frame,corner,x,y,radius,theta,zncc of the tracked discs.
    """
    discs = np.flatnonzero(walls.sides == OUT)
    centre, radius, _ = circle_parameters(walls.endpoints[0, discs])
    pixels = series.scale.to_pixels(centre)
    reference = _refine(series, pixels, radius / series.scale.size_at(pixels))
    found = follow_photographs(
        series, ReferenceGrains(np.arange(len(discs)), reference, radius), execution
    )  # fmt: skip
    position = np.where(found.present[..., None], found.position, np.nan)
    given = np.isfinite(walls.endpoints[:, discs]).all(axis=(2, 3)) & (np.arange(len(walls.endpoints)) > 0)[:, None]
    centres, _, _ = circle_parameters(walls.endpoints[:, discs])
    position = np.where(given[..., None], centres, position)
    sigma = np.full(walls.endpoints.shape[:2], np.nan)
    sigma[:, discs] = np.where(found.present & ~given, found.sigma, np.nan)
    frame, row = (part.ravel() for part in np.indices(given.shape))
    table: dict[str, NDArray[Any]] = {
        "frame": frame, "corner": np.array([walls.name[w] for w in discs])[row], "x": position[..., 0].ravel(),
        "y": position[..., 1].ravel(), "radius": radius[row],
        "theta": found.rotation.ravel(), "zncc": found.zncc.ravel(),
    }  # fmt: skip
    seen = np.isfinite(table["x"])
    placed = place_corners(experiment, walls, position, found.rotation)
    return replace(placed, sigma=sigma), {name: values[seen] for name, values in table.items()}


def _refine(series: Series, pixels: NDArray[np.float64], radius: NDArray[np.float64]) -> Detection:
    """Centre the discs on their rims where these are seen."""
    found = refine_grains(series.photographs[0], pixels[:, 0], pixels[:, 1], radius)
    away = np.hypot(found.x - pixels[:, 0], found.y - pixels[:, 1])
    rim = np.isfinite(found.sigma) & (away < FARTHEST)
    return Detection(
        np.where(rim, found.x, pixels[:, 0]), np.where(rim, found.y, pixels[:, 1]), radius,
        np.where(rim, found.sigma, np.nan), found.quality,
    )  # fmt: skip
