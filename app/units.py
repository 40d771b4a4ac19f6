"""The only conversions between pixels and metres, degrees and radians.

A photograph's pixel (column 0, row 0) is its top left one; pixel centres have whole coordinates.
The world has its origin at the centre of the bottom left pixel, x to the right, y up, angles
counter-clockwise. An angle measured in the photograph (x right, y down) is positive clockwise as
seen, so it changes its sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.grains import Array


@dataclass(frozen=True, slots=True)
class Scale:
    """What one pixel is in the world."""

    pixel_size: float  # [m]
    height: int  # [px], rows of a photograph

    def to_world(self, pixels: Array) -> Array:
        """Points (…, 2) [px] (column, row) to (…, 2) [m]."""
        pixels = np.asarray(pixels, dtype=np.float64)
        return np.stack([pixels[..., 0], (self.height - 1) - pixels[..., 1]], axis=-1) * self.pixel_size

    def to_pixels(self, points: Array) -> Array:
        """Points (…, 2) [m] to (…, 2) [px] (column, row)."""
        points = np.asarray(points, dtype=np.float64) / self.pixel_size
        return np.stack([points[..., 0], (self.height - 1) - points[..., 1]], axis=-1)

    def angle_to_world(self, angle: Array) -> Array:
        """Rotations of the picture [rad] to rotations of the world [rad]; its own inverse."""
        return -np.asarray(angle, dtype=np.float64)
