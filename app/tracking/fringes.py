"""Squared brightness gradient of photoelastic discs, G², in every photograph.

Fringes become denser as the forces on a disc grow. The squared gradient of brightness, integrated over the disc and
over the squared brightness of the photograph's light, is one number a disc, which needs no solution of the fringe
pattern. It is integrated, not averaged: most of it lies about the contacts, whose fringes depend on their forces and
not on the size of the disc.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..experiment.photographs import Photographs
from ..experiment.pictures.image import Image
from ..experiment.units import Scale
from ..process.counts import state_count
from ..process.errors import InputError
from ..process.progress import Progress, no_progress
from ..solver.bodies.grains import Array
from ..tracks import Tracks

INNER = 0.85  # radii: part of a disc that is measured; its rim has an edge of its own
SMOOTHING = 1.0  # px, standard deviation of the smoothing before the gradient
LIGHT_QUANTILE = 0.995  # of the brightness in discs, above the darkest: fringes of full light
DARK_QUANTILE = 0.005
FEWEST_PIXELS = 30


def measure_fringes(photographs: Photographs, tracks: Tracks, scale: Scale, progress: Progress = no_progress) -> Array:
    """Measure G² of every disc in every photograph.

    Parameters
    ----------
    photographs : Photographs
        Through the polariser, in the channel of the fringes; one for every frame.
    tracks : Tracks
        In the picture's own frame, f frames of n discs.
    scale : Scale
    progress : Progress

    Returns
    -------
    ndarray, shape (f, n)
        π R² ⟨|∇I|²⟩/L², with the mean over the inner disc and L the range of brightness in all discs; NaN: no pose.

    Raises
    ------
    InputError
        There are fewer photographs than frames.
    """
    if len(photographs) < tracks.frame_count:
        raise InputError(
            photographs.files[0], "key photographs.fringes",
            f"gives {state_count(len(photographs), 'photograph')} for {state_count(tracks.frame_count, 'frame')}",
        )  # fmt: skip
    found = np.full((tracks.frame_count, tracks.grain_count), np.nan)
    for k in range(tracks.frame_count):
        centre = scale.to_pixels(tracks.position[k])
        radius = tracks.radius / scale.size_at(np.where(np.isfinite(centre), centre, 0.0))
        found[k] = squared_gradients(photographs[k], centre, radius)
        progress("fringes", k + 1, tracks.frame_count)
    return found


def squared_gradients(image: Image, centre: Array, radius: Array) -> Array:
    """Squared gradient integrated over each disc (n,), over the squared range of brightness in all discs.

    Parameters
    ----------
    image : (H, W) array
        Brightness.
    centre : (n, 2) array
        Column and row [px], NaN where a disc is missing.
    radius : (n,) array
        [px]
    """
    smooth = cv2.GaussianBlur(np.asarray(image, np.float32), (0, 0), SMOOTHING)
    along_x = 0.5 * (np.roll(smooth, -1, axis=1) - np.roll(smooth, 1, axis=1))
    along_y = 0.5 * (np.roll(smooth, -1, axis=0) - np.roll(smooth, 1, axis=0))
    square = along_x**2 + along_y**2
    found, levels = np.full(len(centre), np.nan), []
    height, width = image.shape
    for disc in np.flatnonzero(np.isfinite(centre).all(axis=1)):
        (x, y), size = centre[disc], INNER * radius[disc]
        if x < size + 1 or y < size + 1 or x > width - size - 2 or y > height - size - 2:
            continue
        rows = np.arange(int(y - size), int(y + size) + 2)
        columns = np.arange(int(x - size), int(x + size) + 2)
        inside = (columns[None] - x) ** 2 + (rows[:, None] - y) ** 2 < size**2
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        if inside.sum() < FEWEST_PIXELS:
            continue
        found[disc] = float(square[window][inside].mean()) * np.pi * radius[disc] ** 2
        levels.append(np.quantile(smooth[window][inside], [DARK_QUANTILE, LIGHT_QUANTILE]))
    if not levels:
        return found
    dark, light = np.array(levels).T
    level = float(np.quantile(light, LIGHT_QUANTILE) - np.quantile(dark, DARK_QUANTILE))
    return found / max(level, 1e-6) ** 2
