"""Number of discs that are detected in each channel of a small copy of a colour photograph."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...experiment.photographs import Image
from ..correlation.splines import shrink
from .detect import DetectionSettings, detect_grains

# Pixels of the copy: enough to compare channels.
MAX_PIXELS = 600_000
# Grey levels by which the channels of a colour photograph differ in some places.
MIN_COLOUR_DIFFERENCE = 12.0
# Least fraction of a disc's outline that must be detected: of accidental circles in noise it is a third.
MIN_QUALITY = 0.55
# Least radius of a grain on the copy [px].
MIN_RADIUS = 7.0


def is_coloured(channels: Mapping[str, Image]) -> bool:
    """Return whether a photograph's channels differ by more than noise in a part of the picture."""
    red, blue = channels["red"], channels["blue"]
    return bool(np.percentile(np.abs(red[::8, ::8] - blue[::8, ::8]), 95.0) > MIN_COLOUR_DIFFERENCE)


def count_discs(channels: Mapping[str, Image], settings: DetectionSettings) -> dict[str, int]:
    """Count the discs in a small copy of each channel (H, W); returns no counts where that would take too long."""
    size = next(iter(channels.values())).size
    factor = max(int(np.ceil(np.sqrt(size / MAX_PIXELS))), 1)
    least = min(settings.radii) if settings.radii else (settings.radius_range or (8.0, 0.0))[0]
    factor = max(min(factor, int(least / MIN_RADIUS)), 1)
    if size / factor**2 > 4 * MAX_PIXELS:
        return {}
    ranged = settings.radius_range
    small = replace(
        settings,
        radii=tuple(radius / factor for radius in settings.radii),
        radius_range=None if ranged is None else (max(ranged[0] / factor, 3.1), ranged[1] / factor),
    )
    found = {name: detect_grains(shrink(image, factor), small) for name, image in channels.items()}
    return {name: int((each.quality > MIN_QUALITY).sum()) for name, each in found.items()}
