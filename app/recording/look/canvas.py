"""The canvas: the transformation from world to 2D views, and the bounds of the views."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...experiment.jpeg_photographs import shrink_factor
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import IN
from ...tracks import Tracks, WallTracks

NOMINAL_RADIUS = 30.0  # px, of the mean grain, where there is no photograph
BLOCK = 64  # frames whose bounds are found at a time
MARGIN = 2.2, 0.5  # [grain radii] around centres of grains, and around a ring
WIDEST = 2.5  # of the grains' extent: a larger ring is not shown whole


@dataclass(frozen=True, slots=True)
class Canvas:
    """World coordinates in pixels of the photograph as recorded, y down.

    The viewer places the corner of the first pixel at (0, 0), so that its centre is at (½, ½).
    """

    scale: Scale
    shrink: int  # 1, or 2 where photographs are recorded at half size
    grain_radius: float  # [px] of the mean grain
    left: float  # [px] bounds of the grains, and of rings around them, in all frames
    top: float
    right: float
    bottom: float

    @classmethod
    def around(
        cls,
        tracks: Tracks,
        scale: Scale | None,
        photograph_shape: tuple[int, int] | None = None,
        walls: WallTracks | None = None,
    ) -> Canvas:
        """Fit the canvas to every pose of every grain and to rings around them; raise ValueError if there is none."""
        mean_radius = float(np.mean(tracks.radius))
        if scale is None:
            pixel_size = mean_radius / NOMINAL_RADIUS
            highest = max((float(each[:, 1].max()) for each in _places(tracks)), default=0.0)
            scale = Scale(pixel_size, math.ceil(highest / pixel_size) + 1)
        shrink = 1 if photograph_shape is None else shrink_factor(photograph_shape)
        radius = mean_radius / scale.pixel_size / shrink
        ends = []  # [px] of the bounds of some frames at a time
        for each in _places(tracks):
            pixels = (scale.to_pixels(each) + 0.5) / shrink
            ends.append((pixels.min(axis=0), pixels.max(axis=0)))
        if not ends:
            raise ValueError("no grain has a pose in any frame: there is nothing to draw")
        low, high = np.min([low for low, _ in ends], axis=0), np.max([high for _, high in ends], axis=0)
        ring = (scale.to_pixels(_rings(walls)) + 0.5) / shrink
        widest = WIDEST * float((high - low).max())
        low, high = low - MARGIN[0] * radius, high + MARGIN[0] * radius
        if len(ring) and float(np.ptp(ring, axis=0).max()) < widest:
            low = np.minimum(low, ring.min(axis=0) - MARGIN[1] * radius)
            high = np.maximum(high, ring.max(axis=0) + MARGIN[1] * radius)
        return cls(scale, shrink, radius, *low.tolist(), *high.tolist())

    def points(self, world: Array) -> Array:
        """Convert points (…, 2) from [m] to [px]."""
        return (self.scale.to_pixels(world) + 0.5) / self.shrink

    def lengths(self, metres: Array) -> Array:
        """Convert lengths from [m] to [px]."""
        return np.asarray(metres) / (self.scale.pixel_size * self.shrink)

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.bottom - self.top

    @property
    def legend_height(self) -> float:
        """Height [px] of the strip below the grains, for legends."""
        return max(0.2 * self.height, 0.225 * self.width)

    @property
    def header_height(self) -> float:
        """Height [px] of the strip above the grains, for scale bar and caption."""
        return 0.13 * max(self.height, 0.6 * self.width)

    @property
    def quantum(self) -> float:
        """Step of recorded line radii [px]: a power of two near 1/120 grain radius (¼ px for a grain of 30 px).

        Few distinct widths keep the recording small; multiples of a power of two are exact in float32.
        """
        return 2.0 ** round(math.log2(self.grain_radius / 120.0))


def _rings(walls: WallTracks | None) -> Array:
    """Corners (k, 2) [m] of the squares around circular walls with the packing inside."""
    if walls is None or walls.centre is None or walls.radius is None:
        return np.empty((0, 2))
    around = walls.sides == IN
    centre, radius = walls.centre[:, around], walls.radius[:, around, None]
    corners = np.concatenate([centre - radius, centre + radius]).reshape(-1, 2)
    return corners[np.isfinite(corners).all(axis=1)]


def _places(tracks: Tracks) -> Iterator[Array]:
    """Yield the positions (k, 2) [m] of some frames at a time, of those that have any."""
    for first in range(0, tracks.frame_count, BLOCK):
        some = tracks.frames(first, first + BLOCK)
        if some.present.any():
            yield some.position[some.present]
