"""All conversions between pixels and metres, degrees and radians.

A photograph's pixel (column 0, row 0) is its top left one; pixel centres have whole coordinates.
The world has its origin at the centre of the bottom left pixel, x to the right, y up, angles
counter-clockwise. An angle measured in the photograph (x right, y down) is positive clockwise as
seen, so it changes its sign. Where the lens distorts the picture, tracked points are corrected before
the conversion to metres; photographs are never resampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..solver.bodies.grains import Array
from .lens import Lens, jacobian


@dataclass(frozen=True, slots=True)
class Scale:
    """Size of a pixel in the world."""

    pixel_size: float  # [m] of a pixel along the rows
    height: int  # [px], rows of a photograph
    pixel_height: float | None = None  # [m] of a pixel along the columns; None: square pixels
    lens: Lens | None = None  # None: no distortion

    @property
    def sides(self) -> Array:
        """Width and height of a pixel (2,) [m]."""
        return np.array([self.pixel_size, self.pixel_size if self.pixel_height is None else self.pixel_height])

    @property
    def mean_size(self) -> float:
        """Side of the square with the area of a pixel [m]."""
        return float(np.sqrt(self.sides.prod()))

    def to_world(self, pixels: Array) -> Array:
        """Convert points (…, 2) [px] (column, row) to (…, 2) [m]."""
        pixels = np.asarray(pixels, dtype=np.float64)
        if self.lens is not None:
            pixels = self.lens.undistort(pixels)
        return np.stack([pixels[..., 0], (self.height - 1) - pixels[..., 1]], axis=-1) * self.sides

    def to_pixels(self, points: Array) -> Array:
        """Convert points (…, 2) [m] to (…, 2) [px] (column, row)."""
        points = np.asarray(points, dtype=np.float64) / self.sides
        pixels = np.stack([points[..., 0], (self.height - 1) - points[..., 1]], axis=-1)
        return pixels if self.lens is None else self.lens.distort(pixels)

    def size_at(self, pixels: Array) -> Array:
        """Return the side of the square with the area of a pixel at points (…, 2) [px], (…) [m].

        Notes
        -----
        √|det J|, J the derivative of `to_world`.
        """
        pixels = np.asarray(pixels, dtype=np.float64)
        if self.lens is None:
            return np.full(pixels.shape[:-1], self.mean_size)
        return np.sqrt(np.abs(np.linalg.det(jacobian(self.to_world, pixels))))

    def angle_to_world(self, angle: Array) -> Array:
        """Convert angles in the photograph [rad] to angles in the world [rad]; its own inverse.

        Lens distortion and non-square pixels shear a small part of the photograph but do not rotate it.
        """
        return -np.asarray(angle, dtype=np.float64)


def pixel_size_between(start: Array, end: Array, distance: float, lens: Lens | None = None) -> float:
    """Return the side of a square pixel [m] from two points (2,) [px] of the photograph at a known distance [m]."""
    points = np.array([start, end], dtype=np.float64)
    if lens is not None:
        points = lens.undistort(points)
    return float(distance / np.linalg.norm(points[1] - points[0]))
