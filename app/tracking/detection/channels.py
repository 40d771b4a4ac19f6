"""In which channel of a colour photograph how many discs stand out, on a small copy of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...experiment.photographs import Image
from ..correlation.splines import shrink
from .detect import DetectionSettings, detect_grains

# Pixels of the copy: what tells channels apart is seen on it.
PIXELS = 600_000
# Grey levels by which channels of a colour photograph differ somewhere.
COLOURED = 12.0
# Noise makes circles of which a third is seen, not so much.
SEEN = 0.55
# Grains may be no smaller on the copy [px].
SMALLEST = 7.0


def is_coloured(channels: Mapping[str, Image]) -> bool:
    """Whether a photograph's channels differ by more than noise in a part of the picture."""
    red, blue = channels["red"], channels["blue"]
    return bool(np.percentile(np.abs(red[::8, ::8] - blue[::8, ::8]), 95.0) > COLOURED)


def count_discs(channels: Mapping[str, Image], settings: DetectionSettings) -> dict[str, int]:
    """How many discs are found in small copies of each channel (H, W)."""
    size = next(iter(channels.values())).size
    factor = max(int(np.ceil(np.sqrt(size / PIXELS))), 1)
    least = min(settings.radii) if settings.radii else (settings.radius_range or (8.0, 0.0))[0]
    factor = max(min(factor, int(least / SMALLEST)), 1)
    if size / factor**2 > 4 * PIXELS:
        return {}  # it would take longer than it is worth
    ranged = settings.radius_range
    small = replace(
        settings,
        radii=tuple(radius / factor for radius in settings.radii),
        radius_range=None if ranged is None else (max(ranged[0] / factor, 3.1), ranged[1] / factor),
    )
    found = {name: detect_grains(shrink(image, factor), small) for name, image in channels.items()}
    return {name: int((each.quality > SEEN).sum()) for name, each in found.items()}
