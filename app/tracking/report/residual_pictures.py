"""What a tracking report shows of photographs: patches side by side, and what correlation leaves of them."""

from __future__ import annotations

import base64
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image

SIDE = 132  # [px] of one patch as shown
FULL_COLOUR = 0.5  # residual in standard deviations of the reference at which a colour is full
WIDEST = 1040  # [px] of a photograph as shown
MAP_WIDEST = 700  # [px] of a map of residuals as shown
SHADES = 8  # grey levels that a shown map does not tell apart: noise is most of a PNG

RAMP = ((172, 102, 33), (250, 250, 250), (43, 24, 178))  # blue, green, red of a residual below, at and above zero

Picture = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Seen:
    """One grain in the reference and in another photograph, on the reference's pixels."""

    reference: Image  # (s, s) [grey]
    current: Image  # (s, s) [grey] turned and moved back
    residual: Image  # (s, s) current − gain · reference − offset, in standard deviations of the reference
    inside: NDArray[np.bool_]  # (s, s) the grain's disc


def look_at(reference: Image, current: Image, centre: Array, pose: Array, radius: float) -> Seen:
    """Cut a grain of `radius` [px] out at `centre` (x, y) [px], and again at `pose` (x, y [px], rotation [rad])."""
    half = int(np.ceil(radius)) + 1
    dy, dx = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    first = _sample(reference, centre[0] + dx, centre[1] + dy)
    second = _sample(current, pose[0] + cos * dx - sin * dy, pose[1] + sin * dx + cos * dy)
    inside = np.hypot(dx, dy) <= radius
    design = np.stack([first[inside], np.ones(int(inside.sum()))], axis=1).astype(np.float64)
    light = np.linalg.lstsq(design, second[inside].astype(np.float64), rcond=None)[0]
    spread = max(float(first[inside].std()) * abs(float(light[0])), 1.0)
    residual = (second - light[0] * first - light[1]) / spread
    return Seen(first, second, np.asarray(residual, dtype=np.float32), np.asarray(inside, dtype=np.bool_))


def side_by_side(seen: Seen) -> Picture:
    """Reference, current, residual in one picture (SIDE, 3 SIDE + gaps, 3)."""
    low, high = np.percentile(seen.reference[seen.inside], [1.0, 99.0])
    parts = [_grey(seen.reference, low, high)]
    low, high = np.percentile(seen.current[seen.inside], [1.0, 99.0])
    parts.append(_grey(seen.current, low, high))
    residual = two_sided(seen.residual)
    residual[~seen.inside] = 245
    parts.append(residual)
    gap = np.full((SIDE, 6, 3), 255, np.uint8)
    large = [cv2.resize(part, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC) for part in parts]
    return np.asarray(np.concatenate([large[0], gap, large[1], gap, large[2]], axis=1), dtype=np.uint8)


def residual_map(reference: Image, current: Image, centre: Array, pose: Array, radius: Array) -> tuple[Picture, float]:
    """What correlation leaves of every grain, drawn where the grain was at first: picture and its scale.

    centre (n, 2), pose (n, 3), radius (n,) [px]; grains without a pose are left grey. The scale is shown px / px.
    """
    height, width = reference.shape
    residual = np.full((height, width), np.nan, np.float32)
    lost = np.zeros((height, width), np.uint8)
    for k in range(len(centre)):
        if not np.isfinite(pose[k]).all():
            cv2.circle(lost, _whole(centre[k]), round(float(radius[k])), 1, -1)
            continue
        seen = look_at(reference, current, centre[k], pose[k], 0.9 * float(radius[k]))
        # The cut is centred between pixels: it is drawn at the nearest whole one.
        half = seen.inside.shape[0] // 2
        x, y = _whole(centre[k])
        left, top = max(half - x, 0), max(half - y, 0)
        right, bottom = min(2 * half + 1, width - x + half), min(2 * half + 1, height - y + half)
        if right <= left or bottom <= top:
            continue
        part = residual[y - half + top : y - half + bottom, x - half + left : x - half + right]
        kept = seen.inside[top:bottom, left:right]
        part[kept] = seen.residual[top:bottom, left:right][kept]
    picture = two_sided(np.nan_to_num(residual))
    picture[~np.isfinite(residual)] = 235
    picture[lost > 0] = 160
    shown, scale = _fitted(picture, MAP_WIDEST)
    return np.asarray(shown // SHADES * SHADES, dtype=np.uint8), scale


def photograph_shown(image: Image) -> tuple[Picture, float]:
    """A photograph stretched to its own range and shrunk to what a page can hold: picture and its scale."""
    low, high = np.percentile(image, [0.5, 99.5])
    return _fitted(_grey(image, float(low), float(high)), WIDEST)


def two_sided(value: Image) -> Picture:
    """Blue below zero, white at zero, red above it (…, 3); full colour at FULL_COLOUR."""
    t = np.clip(value / FULL_COLOUR, -1.0, 1.0)[..., None]
    blue, white, red = np.array(RAMP, dtype=np.float64)
    colour = np.where(t < 0, white + (blue - white) * -t, white + (red - white) * t)
    return np.asarray(np.rint(colour), dtype=np.uint8)


def as_data(picture: Picture) -> str:
    """A picture as the address that an <img> takes."""
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


def _fitted(picture: Picture, widest: int) -> tuple[Picture, float]:
    height, width = picture.shape[:2]
    scale = min(1.0, widest / max(height, width))
    if scale == 1.0:
        return picture, 1.0
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8), scale


def _whole(point: Array) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
