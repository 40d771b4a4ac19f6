"""Discs that are detected in each channel of a small copy of a photograph, light or dark ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...experiment.pictures.image import FULL_SCALE, Image
from ...solver.parallel import parallel_map
from ..correlation.noise import image_noise
from ..correlation.splines import shrink
from .detect import Detection, DetectionSettings, detect_grains

# Pixels of the copy: enough to compare channels.
MAX_PIXELS = 600_000
# Grey levels by which the channels of a colour photograph differ in some places.
MIN_COLOUR_DIFFERENCE = 12.0
# Least fraction of a disc's outline that must be detected: of accidental circles in noise it is a third.
MIN_QUALITY = 0.55
# Least radius of a grain on the copy [px].
MIN_RADIUS = 7.0


# Ratio of the score by which another channel or dark discs must be better than light discs in grey.
BETTER = 1.1
FEWEST_DISCS = 8
# Range of the grey levels over the noise, below which a channel shows nothing: of noise alone it is 4.1.
LEAST_CONTRAST, CONTRAST_PERCENTILES = 8.0, (2.0, 98.0)
SIZE_QUANTILES, SIZE_MARGIN = (0.1, 0.9), 1.7  # of the radii found, and the factor beyond them


@dataclass(frozen=True, slots=True)
class View:
    """One way to look at a photograph, and what a small copy shows of it."""

    channel: str
    dark: bool  # discs are darker than their surroundings
    count: int  # of circles
    score: float  # area that they cover, over π, weighted by the visible part of their outlines [px²]
    radius_range: tuple[float, float] | None  # [px of the photograph] of the discs; None: too few

    def lit(self, image: Image) -> Image:
        """Return the photograph (H, W) with discs that are lighter than their surroundings."""
        return lit(image, self.dark)

    def describe(self) -> str:
        """Describe the view in a few words."""
        return f"{self.count} {'dark' if self.dark else 'light'} discs in {self.channel}"


def compare_views(channels: Mapping[str, Image], settings: DetectionSettings) -> list[View]:
    """Compare the channels of a photograph, each with light and dark discs, on a small copy; the best view first.

    A view other than light discs in grey is only put first where its score is 1.1 times as large. Circles of noise are
    found in every view, but they are small.
    """
    size = next(iter(channels.values())).size
    factor = max(int(np.ceil(np.sqrt(size / MAX_PIXELS))), 1)
    if settings.radii or settings.radius_range:
        least = min(settings.radii) if settings.radii else (settings.radius_range or (8.0, 0.0))[0]
        factor = max(min(factor, int(least / MIN_RADIUS)), 1)
    small = _on_copy(settings, factor)
    names = list(channels) if is_coloured(channels) else ["grey"]
    copies = {name: shrink(channels[name], factor) for name in names}

    def look(name: str, dark: bool) -> View:
        found = detect_grains(lit(copies[name], dark), small)
        return View(name, dark, found.count, found.seen_area, _size_range(found, factor))

    shown = [name for name, copy in copies.items() if name == "grey" or _shows_anything(copy)]
    views = parallel_map([partial(look, name, dark) for name in shown for dark in (False, True)], None)
    usual = views[0].score
    return sorted(views, key=lambda view: -view.score if view.score > BETTER * usual else -usual - (view is views[0]))


def lit(image: Image, dark: bool) -> Image:
    """Return a picture (H, W) reversed where its discs are darker than their surroundings."""
    return np.float32(FULL_SCALE) - image if dark else image


def _shows_anything(image: Image) -> bool:
    """Whether the grey levels differ by more than noise, which has circles everywhere."""
    dark_level, light_level = np.percentile(image, CONTRAST_PERCENTILES)
    return bool(light_level - dark_level >= LEAST_CONTRAST * image_noise(image))


def _size_range(found: Detection, factor: int) -> tuple[float, float] | None:
    """Range of the radii [px of the photograph] around those of most of the visible outline."""
    if found.count < FEWEST_DISCS:
        return None
    order = np.argsort(found.radius)
    outline = np.cumsum((found.quality * found.radius**2)[order])
    rows = np.searchsorted(outline, np.array(SIZE_QUANTILES) * outline[-1])
    least, most = found.radius[order][np.minimum(rows, found.count - 1)]
    return max(float(factor * least / SIZE_MARGIN), 3.1), float(factor * most * SIZE_MARGIN)


def _on_copy(settings: DetectionSettings, factor: int) -> DetectionSettings:
    ranged = settings.radius_range
    return replace(
        settings,
        radii=tuple(radius / factor for radius in settings.radii),
        radius_range=None if ranged is None else (max(ranged[0] / factor, 3.1), ranged[1] / factor),
    )


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
    small = _on_copy(settings, factor)
    found = {name: detect_grains(shrink(image, factor), small) for name, image in channels.items()}
    return {name: count_clear(each) for name, each in found.items()}


def count_clear(detection: Detection) -> int:
    """Count the discs whose outline is visible for the most part."""
    return int((detection.quality > MIN_QUALITY).sum())
