"""Visible depth of a bar's body beside its inner face."""

from __future__ import annotations

import numpy as np

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array

# Greatest depth of a bar's body that is used, in mean radii of the grains.
MAX_BAR_DEPTH = 3.0


def visible_depth(image: Image, endpoints: Array, scale: Scale, most: float) -> Array:
    """Measure the visible depth of each bar's body beside its inner face.

    The median grey level along lines parallel to the face is compared with that of the body, outwards, until it differs
    permanently.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    endpoints : (w, 2, 2) array
        The faces [m], the body on the right of 1 → 2.
    scale : Scale
    most : float
        Greatest depth [m]: that of a bar which looks like its background.

    Returns
    -------
    (w,) array
        Depths [m].
    """
    height, width = image.shape
    depth = np.empty(len(endpoints))
    for k, (start, end) in enumerate(endpoints):
        along = end - start
        length = np.linalg.norm(along)
        outward = np.array([along[1], -along[0]]) / length
        steps = np.arange(2.0, most / scale.mean_size + 4.0) * scale.mean_size
        fraction = np.linspace(0.05, 0.95, max(int(length / scale.mean_size / 2.0), 8))
        lines = start + fraction[None, :, None] * along + steps[:, None, None] * outward
        pixel = np.rint(np.nan_to_num(scale.to_pixels(lines), nan=-1.0)).astype(np.int64)
        inside = (pixel >= 0).all(axis=-1) & (pixel[..., 0] < width) & (pixel[..., 1] < height)
        grey = np.where(inside, image[pixel[..., 1] % height, pixel[..., 0] % width], np.nan)
        seen = inside.mean(axis=1) > 0.5
        level = np.array([np.nanmedian(line) if ok else np.nan for line, ok in zip(grey, seen, strict=True)])
        body = np.nanmedian(level[:6]) if seen[:6].any() else np.nan
        with np.errstate(invalid="ignore"):
            away = np.abs(level - body)
            top = np.nanmax(away) if np.isfinite(away).any() else np.nan
            # Half of the greatest deviation, but at least a part of the image's range: the bar's marks are not its end.
            left = ~(away <= max(0.5 * top, 0.15 * float(np.ptp(image))))
        # A mark or a shadow is narrow; the background is not.
        lasting = left & np.append(left[1:], True) & np.append(left[2:], [True, True])
        first = int(np.argmax(lasting)) if lasting.any() else len(steps) - 1
        depth[k] = min(float(steps[first]) - 0.5 * scale.mean_size, most)
    return depth
