"""The canvas: the transformation from world to 2D views, and the bounds of the views."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...experiment.jpeg_photographs import shrink_factor
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from ...tracks import Tracks

NOMINAL_RADIUS = 30.0  # px, of the mean grain, where there is no photograph


@dataclass(frozen=True, slots=True)
class Canvas:
    """World coordinates in pixels of the photograph as recorded, y down.

    The viewer places the corner of the first pixel at (0, 0), so that its centre is at (½, ½).
    """

    scale: Scale
    shrink: int  # 1, or 2 where photographs are recorded at half size
    grain_radius: float  # [px] of the mean grain
    left: float  # [px] bounds of the grains in all frames
    top: float
    right: float
    bottom: float

    @classmethod
    def around(cls, tracks: Tracks, scale: Scale | None, photograph_shape: tuple[int, int] | None = None) -> Canvas:
        """Fit the canvas to every pose of every grain; raise ValueError if there is none."""
        mean_radius = float(np.mean(tracks.radius))
        points = tracks.position[tracks.present]
        if len(points) == 0:
            raise ValueError("no grain has a pose in any frame: there is nothing to draw")
        if scale is None:
            pixel_size = mean_radius / NOMINAL_RADIUS
            scale = Scale(pixel_size, math.ceil(points[:, 1].max() / pixel_size) + 1)
        shrink = 1 if photograph_shape is None else shrink_factor(photograph_shape)
        radius = mean_radius / scale.pixel_size / shrink
        pixels = (scale.to_pixels(points) + 0.5) / shrink
        margin = 2.2 * radius
        left, top = pixels.min(axis=0) - margin
        right, bottom = pixels.max(axis=0) + margin
        return cls(scale, shrink, radius, float(left), float(top), float(right), float(bottom))

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
        return 0.2 * max(self.height, 0.6 * self.width)

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
