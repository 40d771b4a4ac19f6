"""Quality of photographs before tracking: light, noise, speckle pattern and expected standard deviation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..experiment.pictures.image import FULL_SCALE, Image
from ..solver.bodies.grains import Array
from ..solver.even_subset import even_subset
from .correlation.noise import image_noise
from .correlation.patches import Patches
from .correlation.splines import Pyramid
from .settings import TrackingSettings

SAMPLED_FRAMES = 12  # photographs, evenly over the test
MAX_DISCS = 80  # discs whose pattern is measured
DEFAULT_RADIUS = 20.0  # [px] of a disc where rods are not known yet
SURROUNDINGS = 12  # [px] around a disc: the support of the splines
GRID_COUNT = 24  # discs along the longer side, where rods are not known yet

# Full width at half maximum of a Gaussian autocorrelation, over its length: the size of a speckle.
FWHM_OF_LENGTH = 2.0 * np.sqrt(2.0 * np.log(2.0))

MIN_SPECKLE = 2.5  # [px] least speckle that a camera samples
MAX_SPECKLE_RATIO = 0.5  # greatest speckle / radius: a rod shows few larger ones
MAX_CLIPPED = 0.01  # greatest fraction of saturated pixels
MIN_CONTRAST = 8.0  # [grey] least contrast of a pattern that can be tracked, in light of half the range
MAX_SIGMA = 0.03  # [px]: at a usual step rods slide by a tenth of a pixel
MAX_DRIFT = 0.25  # greatest relative change of the light
MIN_CONTRAST_RATIO = 0.4  # least contrast / that of the first photograph
MAX_BLUR_RATIO = 1.3  # greatest speckle / that of the first photograph


@dataclass(frozen=True, slots=True)
class PictureQuality:
    """Measurements on k photographs, and on discs of the first of them. Grey levels are of 255."""

    frame: NDArray[np.int64]  # (k,) numbers of the photographs
    light: Array  # (k,) [grey] mean
    contrast: Array  # (k,) [grey] standard deviation within a disc, median
    speckle: Array  # (k,) [px] full width at half maximum of the pattern's autocorrelation, median; NaN: no pattern
    clipped: Array  # (k,) fraction of the pixels that are saturated
    noise: float  # [grey] of a pixel
    patch_radius: float  # [px] radius of the discs, median
    sigma: float  # [px] of a component of a rod's displacement between two photographs; NaN: no pattern
    rods: bool  # whether the discs are rods; else places with more contrast than half of all
    patterned: bool = True  # whether rods are tracked by their pattern; else by their rims

    def facts(self) -> list[str]:
        """Return sentences that describe the photographs."""
        body = "a rod" if self.rods else f"a disc of {self.patch_radius:.0f} px radius"
        facts = [f"The noise is {self.noise:.1f} of 255 grey levels, the contrast {self.contrast[0]:.0f}."]
        if self.patterned and np.isfinite(self.sigma):
            facts.append(
                f"The speckles are {self.speckle[0]:.1f} px wide: the position of {body} will have a standard "
                f"deviation of {self.sigma:.2g} px at best."
            )
        return facts

    def faults(self) -> list[str]:
        """Return sentences that name faults and their cures."""
        return [*(self._faults_of_pattern() if self.patterned else []), *self._faults_of_light()]

    def _faults_of_pattern(self) -> list[str]:
        faults = []
        # Cameras of 10 or 12 bits leave most of the range of 16 bits empty.
        least = MIN_CONTRAST * min(1.0, self.light[0] / (0.5 * FULL_SCALE))
        if not np.isfinite(self.sigma) or self.contrast[0] < least:
            faults.append(
                "The rods show hardly any pattern: paint the ends, or track plain discs by their rims "
                '(follow = "outline").'
            )
        elif self.speckle[0] < MIN_SPECKLE:
            faults.append(
                f"The speckles are finer than {MIN_SPECKLE:g} px, which a camera does not sample: use coarser paint or "
                "more pixels."
            )
        elif self.rods and self.speckle[0] > MAX_SPECKLE_RATIO * self.patch_radius:
            faults.append("The speckles are so wide that a rod shows few of them: use finer paint.")
        if self.sigma > MAX_SIGMA:
            faults.append(
                f"The expected standard deviation of {self.sigma:.2g} px is coarse: use more light, less noise or more "
                "pixels per rod."
            )
        blur = np.nan_to_num(self.speckle / self.speckle[0]) if np.isfinite(self.speckle[0]) else np.zeros(1)
        if blur.max() > MAX_BLUR_RATIO:
            faults.append(f"Photograph {self.frame[blur.argmax()]} is blurred: check the focus and the camera's mount.")
        return faults

    def _faults_of_light(self) -> list[str]:
        faults, first = [], self.frame[0]
        worst = int(self.clipped.argmax())
        if self.clipped[worst] > MAX_CLIPPED:
            faults.append(
                f"{self.clipped[worst]:.0%} of the pixels of photograph {self.frame[worst]} are black or saturated: "
                "change the exposure."
            )
        contrast_ratio = self.contrast / max(self.contrast[0], 1e-9)
        if contrast_ratio.min() < MIN_CONTRAST_RATIO:
            faults.append(
                f"Photograph {self.frame[contrast_ratio.argmin()]} has {contrast_ratio.min():.0%} of the contrast of "
                f"photograph {first}: check whether it shows the packing."
            )
        drift = self.light / max(self.light[0], 1e-9) - 1.0
        far = int(np.abs(drift).argmax())
        if abs(drift[far]) > MAX_DRIFT and contrast_ratio[far] >= MIN_CONTRAST_RATIO:
            faults.append(
                f"The light changes by {drift[far]:+.0%} until photograph {self.frame[far]}: correlation corrects for "
                "it, but set exposure and lamps by hand."
            )
        return faults


def measure_pictures(
    photographs: Sequence[Image], centre: Array | None = None, radius: Array | None = None, *, patterned: bool = True
) -> PictureQuality:
    """Measure photographs evenly over the test, and discs in each.

    Parameters
    ----------
    photographs : sequence of (H, W) arrays
        The photographs [grey].
    centre : (n, 2) array, optional
        Centres of the rods in the first one [px], where they are known. The same places are measured in the later
        ones: the pattern is statistically the same everywhere.
    radius : (n,) array, optional
        Radii of the rods [px].
    patterned : bool
        Rods are tracked by their pattern, not by their rims.

    Raises
    ------
    InputError
        If a photograph cannot be read.
    """
    frames = even_subset(len(photographs), SAMPLED_FRAMES)
    first = photographs[0]
    if centre is not None and radius is not None and len(radius):
        sample = even_subset(len(radius), MAX_DISCS)
        places, patch_radius = centre[sample], TrackingSettings().patch_fraction * radius[sample]
        rods = True
    else:
        places, patch_radius, rods = *_grid_discs(first), False
    rows = [
        _measure_photograph(first if frame == 0 else photographs[int(frame)], places, patch_radius) for frame in frames
    ]
    light, clipped, contrast, speckle, sigma = np.transpose(rows)
    noise = image_noise(first)
    return PictureQuality(
        frames,
        light,
        contrast,
        speckle,
        clipped,
        noise,
        float(np.median(patch_radius)),
        noise * float(sigma[0]),
        rods,
        patterned,
    )


def _grid_discs(image: Image) -> tuple[Array, Array]:
    """Discs (n, 2), (n,) [px] on a grid, the half with more contrast: rods fill most of a photograph."""
    height, width = image.shape
    step = max(max(height, width) / GRID_COUNT, 2.0 * DEFAULT_RADIUS)
    x, y = (np.arange(0.5 * step, side - 0.5 * step, step) for side in (width, height))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    half = int(DEFAULT_RADIUS)
    contrast = np.array([
        image[int(v) - half : int(v) + half, int(u) - half : int(u) + half].std() for u, v in places
    ])  # fmt: skip
    chosen = places[contrast >= np.median(contrast)] if len(places) else np.array([[0.5 * width, 0.5 * height]])
    sample = even_subset(len(chosen), MAX_DISCS)
    return chosen[sample], np.full(len(sample), DEFAULT_RADIUS)


def _measure_photograph(image: Image, places: Array, patch_radius: Array) -> tuple[float, float, float, float, float]:
    """Mean light, saturated fraction, contrast, speckle [px], σ [px] per grey level of noise; NaN without a pattern."""
    patches = _cut_discs(image, places, patch_radius)
    seen, clipped = patches.usable, float(np.mean((image <= 0.0) | (image >= FULL_SCALE)))
    if not seen.any():
        return float(image.mean()), clipped, 0.0, np.nan, np.nan
    contrast = patches.norm[seen] / np.sqrt(patches.pixel_count[seen])
    width = FWHM_OF_LENGTH * patches.correlation_length[seen]
    sigma = np.sqrt(2.0) * patches.sigma_per_noise[seen]  # both photographs have their noise
    middle = np.median([contrast, width, sigma], axis=1)
    return float(image.mean()), clipped, float(middle[0]), float(middle[1]), float(middle[2])


def _cut_discs(image: Image, places: Array, patch_radius: Array) -> Patches:
    """The discs, cut from a small image of them and their surroundings: splines of a whole photograph take seconds."""
    side = int(np.ceil(patch_radius.max())) + SURROUNDINGS
    padded = np.pad(image, side, mode="reflect") if min(image.shape) > side else np.pad(image, side, mode="edge")
    corner = np.floor(places).astype(np.intp)
    row = [padded[y : y + 2 * side, x : x + 2 * side] for x, y in corner]
    moved = places - corner + side + 2.0 * side * np.column_stack([np.arange(len(row)), np.zeros(len(row))])
    return Patches.cut(Pyramid(np.ascontiguousarray(np.hstack(row), np.float32)), moved, patch_radius)
