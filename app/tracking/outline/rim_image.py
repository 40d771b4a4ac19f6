"""One photograph in which the rims of discs are searched for and measured."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ..correlation.noise import image_noise
from ..correlation.splines import spline_coefficients
from .rim_kernels import COLUMNS, QUALITY, SIGMA, X, Y, find_rings, measure_rims

# Half widths of the search for edges [px]: the first around a ring, the second around the circle that was then fitted.
WINDOWS = (2.5, 1.3)
# Standard deviation of the apparent radius about that of the first photograph [px]: edges move with the light.
RADIUS_SD = 0.3


class RimImage:
    """One photograph with the gradients and coefficients that rims are measured with."""

    def __init__(self, image: Image) -> None:
        image = np.ascontiguousarray(image, np.float32)
        self._coefficients = spline_coefficients(image)
        self._noise = image_noise(image)
        smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
        slope: dict[str, Any] = {"ddepth": cv2.CV_32F, "ksize": 3, "scale": 1.0 / 8.0}
        self._slope_x = np.asarray(cv2.Sobel(smooth, dx=1, dy=0, **slope), np.float32)
        self._slope_y = np.asarray(cv2.Sobel(smooth, dx=0, dy=1, **slope), np.float32)

    def measure(self, centre: Array, radius: Array, radius_sd: Array) -> Array:
        """Measure the circles (n, 6) through the edges around centre (n, 2) [px]; see `measure_rims`."""
        found = np.empty((len(radius), COLUMNS))
        x, y = np.array(centre[:, 0], np.float64), np.array(centre[:, 1], np.float64)
        for width in WINDOWS:
            window = np.minimum(width, 0.4 * radius)
            measure_rims(self._coefficients, x, y, radius, window, float(radius_sd[0]), self._noise, found)
            good = np.isfinite(found[:, SIGMA])
            x, y = np.where(good, found[:, X], x), np.where(good, found[:, Y], y)
        return found

    def find(self, guess: Array, radius: Array, window: Array) -> Array:
        """Measure the circle (m, 6) of the best ring around each guess (m, 2) [px]."""
        x, y = np.ascontiguousarray(guess[:, 0]), np.ascontiguousarray(guess[:, 1])
        places = self.ring_strength(x, y, radius, window, 1.0, 1)
        centre = np.where(places[:, 0, 2:] > 0.0, places[:, 0, :2], guess)
        radius_sd = np.full(len(radius), RADIUS_SD)
        found, at_guess = self.measure(centre, radius, radius_sd), self.measure(guess, radius, radius_sd)
        # Fringes may be stronger than the rim; the circle at the guess is then the better one.
        return np.where((at_guess[:, QUALITY] > found[:, QUALITY])[:, None], at_guess, found)

    def ring_strength(self, x: Array, y: Array, radius: Array, window: Array, step: float, count: int) -> Array:
        """Find the best rings (n, count, 3) within windows (n,) [px]: x, y [px], mean root of the radial slope."""
        places = np.empty((len(x), count, 3))
        find_rings(self._slope_x, self._slope_y, x, y, radius, window, step, places)
        return places

    def find_strongest(self, middle: Array, radius: float, window: float, count: int) -> Array:
        """Find the best rings (c, 3) in a wide window: x, y [px], mean root of the radial slope."""
        x, y = middle[:1].astype(np.float64), middle[1:2].astype(np.float64)
        return self.ring_strength(x, y, np.array([radius]), np.array([window]), max(1.0, 0.08 * radius), count)[0]
