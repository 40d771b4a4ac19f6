"""B-spline interpolation of a photograph, and its pyramid.

The image is I(x, y) = Σ c[l, k] β(x − k) β(y − l) with pixel centres at whole coordinates. β is the cubic B-spline, or
the quintic one for accuracies of a hundredth of a pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from ...experiment.pictures.image import Image
from ..interpolation.recursive_filter import quintic_coefficients

# Unser, Aldroubi & Eden 1993: the inverse of the sampled cubic B-spline is sqrt(3) z^|k|, z = sqrt(3) − 2.
# The first tap that is omitted is 1e-6 of the middle one: a thousandth of a grey level.
HALF_WIDTH = 10
POLE = np.sqrt(3.0) - 2.0
PREFILTER = (np.sqrt(3.0) * POLE ** np.abs(np.arange(-HALF_WIDTH, HALF_WIDTH + 1))).astype(np.float32)

# Fraction of the variance of white noise that quintic interpolation halfway between two pixels preserves.
HALFWAY_VARIANCE = 0.8365


def spline_coefficients(image: Image) -> Image:
    """Compute the cubic spline coefficients c of an image (H, W), mirrored at its borders."""
    filtered = cv2.sepFilter2D(image, cv2.CV_32F, PREFILTER, PREFILTER, borderType=cv2.BORDER_REFLECT_101)
    return np.asarray(filtered, dtype=np.float32)


def shrink(image: Image, factor: int) -> Image:
    """Average squares of factor × factor pixels. Pixel X lies at factor · X + (factor − 1)/2 of the image."""
    if factor == 1:
        return image
    height, width = image.shape[0] // factor, image.shape[1] // factor
    small = cv2.resize(image[: height * factor, : width * factor], (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class Pyramid:
    """One photograph with its shrunk copies and spline coefficients, each computed at its first use."""

    image: Image
    _levels: dict[int, Image] = field(default_factory=dict)
    _coefficients: dict[int, Image] = field(default_factory=dict)
    _quintic: list[Image] = field(default_factory=list)

    def level(self, factor: int) -> Image:
        """Return the photograph shrunk by a factor."""
        if factor not in self._levels:
            self._levels[factor] = shrink(self.image, factor)
        return self._levels[factor]

    def quintic_coefficients(self) -> Image:
        """Return the quintic spline coefficients of the photograph itself."""
        if not self._quintic:
            self._quintic.append(quintic_coefficients(self.image))
        return self._quintic[0]

    def coefficients(self, factor: int = 1) -> Image:
        """Return the cubic spline coefficients of a level."""
        if factor not in self._coefficients:
            self._coefficients[factor] = spline_coefficients(self.level(factor))
        return self._coefficients[factor]
