"""What photographs are good for, before anything is followed in them: light, noise, the pattern, expected σ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ..experiment.photographs import FULL_SCALE, Image
from .correlation.noise import image_noise
from .correlation.patches import Patches
from .correlation.splines import Pyramid
from .settings import TrackingSettings

LOOKED_AT = 12  # photographs, evenly over the test
DISCS = 80  # whose pattern is looked at
FREE_REACH = 20.0  # [px] of a disc where rods are not known yet
SURROUNDINGS = 12  # [px] around a disc, which its splines feel
DENSE_GRID = 24  # discs along the longer side, where rods are not known yet

# From a Gaussian autocorrelation's length to its full width at half maximum, which is called the size of a speckle.
WIDTH_OF_LENGTH = 2.0 * np.sqrt(2.0 * np.log(2.0))

FINEST, COARSEST = 2.5, 0.5  # [px] of a speckle that a camera still samples; over the radius, above which few are seen
CLIPPED = 0.01  # of the pixels at an end of the scale: what was there is gone
DULL = 8.0  # [grey] of contrast, below which a rod has no pattern to follow
COARSE_SIGMA = 0.03  # [px]: at a usual step rods slide by a tenth of a pixel
DRIFT = 0.25  # of the light: correlation takes that off, but something changes that should not
DARK = 0.4  # of the first photograph's contrast
BLURRED = 1.3  # over the first photograph's speckle


@dataclass(frozen=True, slots=True)
class PictureQuality:
    """What was measured on k photographs, and on discs of the first of them. Grey levels are of 255."""

    frame: NDArray[np.int64]  # (k,) which photographs
    light: Array  # (k,) [grey] mean
    contrast: Array  # (k,) [grey] standard deviation within a disc, median
    speckle: Array  # (k,) [px] full width at half maximum of the pattern's autocorrelation, median; NaN: no pattern
    clipped: Array  # (k,) share of the pixels at an end of the scale
    noise: float  # [grey] of a pixel
    reach: float  # [px] radius of the discs, median
    sigma: float  # [px] of a component of a rod's displacement between two photographs; NaN: no pattern
    rods: bool  # whether the discs are rods; else places with more contrast than half of all
    patterned: bool = True  # whether rods are followed by their pattern; else by their rims

    def facts(self) -> list[str]:
        """What a person should know of them."""
        where = "a rod" if self.rods else f"a disc of {self.reach:.0f} px radius"
        facts = [f"Noise {self.noise:.1f} of 255 grey levels, contrast {self.contrast[0]:.0f}."]
        if self.patterned and np.isfinite(self.sigma):
            facts.append(
                f"The pattern's grains are {self.speckle[0]:.1f} px wide: where {where} is will be known to "
                f"{self.sigma:.2g} px at best."
            )
        return facts

    def faults(self) -> list[str]:
        """What should be otherwise, and how."""
        return [*(self._faults_of_pattern() if self.patterned else []), *self._faults_of_light()]

    def _faults_of_pattern(self) -> list[str]:
        faults = []
        if not np.isfinite(self.sigma) or self.contrast[0] < DULL:
            faults.append(
                'Hardly any pattern is seen: paint the ends, or follow plain discs by their rims (follow = "outline").'
            )
        elif self.speckle[0] < FINEST:
            faults.append(
                f"The pattern's grains are finer than {FINEST:g} px, which a camera does not sample: coarser paint, or "
                "more pixels."
            )
        elif self.rods and self.speckle[0] > COARSEST * self.reach:
            faults.append("The pattern's grains are so wide that a rod shows few of them: finer paint.")
        if self.sigma > COARSE_SIGMA:
            faults.append(f"More light, less noise or more pixels to a rod: {self.sigma:.2g} px is coarse.")
        blur = np.nan_to_num(self.speckle / self.speckle[0]) if np.isfinite(self.speckle[0]) else np.zeros(1)
        if blur.max() > BLURRED:
            faults.append(f"Photograph {self.frame[blur.argmax()]} is blurred: focus, or something shook.")
        return faults

    def _faults_of_light(self) -> list[str]:
        faults, first = [], self.frame[0]
        worst = int(self.clipped.argmax())
        if self.clipped[worst] > CLIPPED:
            faults.append(
                f"{self.clipped[worst]:.0%} of the pixels of photograph {self.frame[worst]} are black or white as can "
                "be: another exposure."
            )
        shown = self.contrast / max(self.contrast[0], 1e-9)
        if shown.min() < DARK:
            faults.append(
                f"Photograph {self.frame[shown.argmin()]} has {shown.min():.0%} of the contrast of photograph {first}: "
                "look at it."
            )
        drift = self.light / max(self.light[0], 1e-9) - 1.0
        far = int(np.abs(drift).argmax())
        if abs(drift[far]) > DRIFT and shown[far] >= DARK:
            faults.append(
                f"The light changes by {drift[far]:+.0%} until photograph {self.frame[far]}: it is taken off, but set "
                "exposure and lamps by hand."
            )
        return faults


def measure_pictures(
    photographs: Sequence[Image], centre: Array | None = None, radius: Array | None = None, *, patterned: bool = True
) -> PictureQuality:
    """Look at photographs evenly over the test, and at discs of each.

    centre (n, 2), radius (n,) [px]: rods of the first one, where they are known. In later photographs the same places
    are looked at, for patterns are alike everywhere. patterned: rods are not followed by their rims. Raises InputError
    where a photograph cannot be read.
    """
    frames = np.unique(np.linspace(0, len(photographs) - 1, LOOKED_AT).round().astype(np.int64))
    first = photographs[0]
    if centre is not None and radius is not None and len(radius):
        some = np.unique(np.linspace(0, len(radius) - 1, DISCS).round().astype(np.intp))
        places, reach = centre[some], TrackingSettings().patch_share * radius[some]
        rods = True
    else:
        places, reach, rods = *_places(first), False
    rows = [_look(first if frame == 0 else photographs[int(frame)], places, reach) for frame in frames]
    light, clipped, contrast, speckle, sigma = np.transpose(rows)
    noise = image_noise(first)
    return PictureQuality(
        frames,
        light,
        contrast,
        speckle,
        clipped,
        noise,
        float(np.median(reach)),
        noise * float(sigma[0]),
        rods,
        patterned,
    )


def _places(image: Image) -> tuple[Array, Array]:
    """Discs (n, 2), (n,) [px] on a grid, those with more contrast than half of all: rods fill most of a photograph."""
    height, width = image.shape
    step = max(max(height, width) / DENSE_GRID, 2.0 * FREE_REACH)
    x, y = (np.arange(0.5 * step, side - 0.5 * step, step) for side in (width, height))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    reach = int(FREE_REACH)
    contrast = np.array([
        image[int(v) - reach : int(v) + reach, int(u) - reach : int(u) + reach].std() for u, v in places
    ])  # fmt: skip
    chosen = places[contrast >= np.median(contrast)] if len(places) else np.array([[0.5 * width, 0.5 * height]])
    some = np.unique(np.linspace(0, len(chosen) - 1, DISCS).round().astype(np.intp))
    return chosen[some], np.full(len(some), FREE_REACH)


def _look(image: Image, places: Array, reach: Array) -> tuple[float, float, float, float, float]:
    """Mean light, share clipped, contrast, speckle [px], and σ [px] per grey level of noise; NaN without a pattern."""
    patches = _cut_together(image, places, reach)
    seen, clipped = patches.usable, float(np.mean((image <= 0.0) | (image >= FULL_SCALE)))
    if not seen.any():
        return float(image.mean()), clipped, 0.0, np.nan, np.nan
    contrast = patches.norm[seen] / np.sqrt(patches.pixel_count[seen])
    width = WIDTH_OF_LENGTH * patches.correlation_length[seen]
    sigma = np.sqrt(2.0) * patches.sigma_per_noise[seen]  # both photographs have their noise
    middle = np.median([contrast, width, sigma], axis=1)
    return float(image.mean()), clipped, float(middle[0]), float(middle[1]), float(middle[2])


def _cut_together(image: Image, places: Array, reach: Array) -> Patches:
    """The discs, out of one small picture of them and what is around: splines of a whole photograph take seconds."""
    side = int(np.ceil(reach.max())) + SURROUNDINGS
    around = np.pad(image, side, mode="reflect") if min(image.shape) > side else np.pad(image, side, mode="edge")
    corner = np.floor(places).astype(np.intp)
    row = [around[y : y + 2 * side, x : x + 2 * side] for x, y in corner]
    moved = places - corner + side + 2.0 * side * np.column_stack([np.arange(len(row)), np.zeros(len(row))])
    return Patches.cut(Pyramid(np.ascontiguousarray(np.hstack(row), np.float32)), moved, reach)
