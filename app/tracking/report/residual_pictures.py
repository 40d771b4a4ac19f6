"""Pictures of the tracking report: patches side by side, and maps of the residuals of correlation."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array

SIDE = 132  # [px] of one patch as shown
FULL_COLOUR = 0.5  # residual in standard deviations of the reference at which a colour is full
WIDEST = 1040  # [px] of a photograph as shown
MAP_WIDEST = 700  # [px] of a map of residuals as shown
SHADES = 8  # grey levels that are merged in a map: a PNG consists mostly of noise

RAMP = ((172, 102, 33), (250, 250, 250), (43, 24, 178))  # blue, green, red of a residual below, at and above zero

Picture = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class PatchComparison:
    """One grain in the reference and in another photograph, on the reference's pixels."""

    reference: Image  # (s, s) [grey]
    current: Image  # (s, s) [grey] rotated and moved back
    residual: Image  # (s, s) current − gain · reference − offset, in standard deviations of the reference
    inside: NDArray[np.bool_]  # (s, s) the grain's disc


def compare_patches(reference: Image, current: Image, centre: Array, pose: Array, radius: float) -> PatchComparison:
    """Cut a grain of `radius` [px] from two photographs, at `centre` (x, y) [px] and at `pose` (x, y [px], angle)."""
    half = int(np.ceil(radius)) + 1
    dy, dx = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    first = _sample(reference, centre[0] + dx, centre[1] + dy)
    second = _sample(current, pose[0] + cos * dx - sin * dy, pose[1] + sin * dx + cos * dy)
    inside = np.hypot(dx, dy) <= radius
    design = np.stack([first[inside], np.ones(int(inside.sum()))], axis=1).astype(np.float64)
    gain_offset = np.linalg.lstsq(design, second[inside].astype(np.float64), rcond=None)[0]
    contrast = max(float(first[inside].std()) * abs(float(gain_offset[0])), 1.0)
    residual = (second - gain_offset[0] * first - gain_offset[1]) / contrast
    return PatchComparison(first, second, np.asarray(residual, dtype=np.float32), np.asarray(inside, dtype=np.bool_))


def side_by_side(comparison: PatchComparison) -> Picture:
    """Join reference, current image and residual in one picture (SIDE, 3 SIDE + gaps, 3)."""
    low, high = np.percentile(comparison.reference[comparison.inside], [1.0, 99.0])
    parts = [_grey(comparison.reference, low, high)]
    low, high = np.percentile(comparison.current[comparison.inside], [1.0, 99.0])
    parts.append(_grey(comparison.current, low, high))
    residual = two_sided(comparison.residual)
    residual[~comparison.inside] = 245
    parts.append(residual)
    gap = np.full((SIDE, 6, 3), 255, np.uint8)
    large = [cv2.resize(part, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC) for part in parts]
    return np.asarray(np.concatenate([large[0], gap, large[1], gap, large[2]], axis=1), dtype=np.uint8)


def residual_map(reference: Image, current: Image, centre: Array, pose: Array, radius: Array) -> tuple[Picture, float]:
    """Draw the residuals of all grains at their first positions.

    Parameters
    ----------
    reference, current : (H, W) array
        The first photograph and another one [grey].
    centre, pose, radius : (n, 2), (n, 3), (n,) array
        The grains on the first one [px] and their poses on the other one [px, px, rad]; without a pose they are grey.

    Returns
    -------
    picture : (h, w, 3) array
    scale : float
        Pixels of the picture per pixel of the photograph.
    """
    height, width = reference.shape
    residual = np.full((height, width), np.nan, np.float32)
    lost = np.zeros((height, width), np.uint8)
    for k in range(len(centre)):
        if not np.isfinite(pose[k]).all():
            cv2.circle(lost, _nearest_pixel(centre[k]), round(float(radius[k])), 1, -1)
            continue
        comparison = compare_patches(reference, current, centre[k], pose[k], 0.9 * float(radius[k]))
        # The cut is centred between pixels and drawn at the nearest whole one.
        half = comparison.inside.shape[0] // 2
        x, y = _nearest_pixel(centre[k])
        left, top = max(half - x, 0), max(half - y, 0)
        right, bottom = min(2 * half + 1, width - x + half), min(2 * half + 1, height - y + half)
        if right <= left or bottom <= top:
            continue
        part = residual[y - half + top : y - half + bottom, x - half + left : x - half + right]
        kept = comparison.inside[top:bottom, left:right]
        part[kept] = comparison.residual[top:bottom, left:right][kept]
    picture = two_sided(np.nan_to_num(residual))
    picture[~np.isfinite(residual)] = 235
    picture[lost > 0] = 160
    shown, scale = _shrink(picture, MAP_WIDEST)
    return np.asarray(shown // SHADES * SHADES, dtype=np.uint8), scale


def display_photograph(image: Image) -> tuple[Picture, float]:
    """Stretch a photograph to its own range and shrink it to the page's width; returns picture and scale."""
    low, high = np.percentile(image, [0.5, 99.5])
    return _shrink(_grey(image, float(low), float(high)), WIDEST)


def two_sided(value: Image) -> Picture:
    """Colour values: blue below zero, white at zero, red above it (…, 3), saturated at FULL_COLOUR."""
    t = np.clip(value / FULL_COLOUR, -1.0, 1.0)[..., None]
    blue, white, red = np.array(RAMP, dtype=np.float64)
    colour = np.where(t < 0, white + (blue - white) * -t, white + (red - white) * t)
    return np.asarray(np.rint(colour), dtype=np.uint8)


def as_data(picture: Picture) -> str:
    """Encode a picture as a data address for an <img>."""
    if (picture[..., 0] == picture[..., 1]).all() and (picture[..., 0] == picture[..., 2]).all():
        picture = np.ascontiguousarray(picture[..., 0])
    good, content = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert good
    return "data:image/png;base64," + base64.b64encode(content.tobytes()).decode("ascii")


def _sample(image: Image, x: Array, y: Array) -> Image:
    mapped = cv2.remap(
        image, x.astype(np.float32), y.astype(np.float32), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(mapped, dtype=np.float32)


def _grey(image: Image, low: float, high: float) -> Picture:
    value = np.clip((image - low) * (255.0 / max(high - low, 1.0)), 0.0, 255.0)
    return np.repeat(np.rint(value).astype(np.uint8)[..., None], 3, axis=2)


def _shrink(picture: Picture, widest: int) -> tuple[Picture, float]:
    height, width = picture.shape[:2]
    scale = min(1.0, widest / max(height, width))
    if scale == 1.0:
        return picture, 1.0
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), scale


def _nearest_pixel(point: Array) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
