"""What the rims of rods show: given places more exactly, that known radii do not fit, and places that are uncertain."""

from __future__ import annotations

import numpy as np

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from .detect import Detection, refine_grains

FEWEST_RIMS = 10  # from which a common error of the radii is read
# Error of radii by the pixel size that is reported, and that of the place of a rim [px], in blurred pictures too.
WRONG_SCALE, UNSHARP = 0.01, 0.3
# Fraction of a rim that rods at wrong places show at most: of 70 kinds of paint and light (150 rods, two packings) the
# least of rods at their places is .27 and more, but .04 to .2 with hot pixels, dust and paint like the background.
FAINT = 0.2
NAMED = 8  # rods that a sentence lists
MANY = 0.1  # of the rods: where so many are faint, the paint is


def refine_given(image: Image, x: Array, y: Array, radius: Array) -> Detection:
    """Refine given circles; those of whose rims little is seen stay where they are.

    Glare, dust and paint can resemble another rim. The given place is then more certain, and the distance of that rim
    is part of its standard deviation.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    x, y, radius : (n,) array
        Circles accurate to two pixels [px].
    """
    found = refine_grains(image, x, y, radius)
    faint = (found.quality > 0.0) & (found.quality < FAINT)
    moved = np.hypot(found.x - x, found.y - y)
    return Detection(
        np.where(faint, x, found.x), np.where(faint, y, found.y), found.radius,
        np.where(faint, np.hypot(found.sigma, moved), found.sigma), found.quality,
    )  # fmt: skip


def describe_scale(image: Image, rods: Detection) -> str:
    """State that the rims show other radii than the known ones, which a wrong pixel size does; empty: they agree."""
    ratio = _rims_over_radii(image, rods)
    off = abs(ratio - 1.0)
    if not (off > WRONG_SCALE and off * float(np.median(rods.radius)) > UNSHARP):
        return ""
    return (
        f"By their rims the rods are {100.0 * off:.1f} % {'larger' if ratio > 1.0 else 'smaller'} than the known radii "
        "at this pixel size: measure it along a known length (rodsight open, step Scale), or check the radii."
    )


def describe_wide_rims(image: Image, rods: Detection) -> str:
    """State that radii were found smaller than the rims show; empty: they agree."""
    reduced = 1.0 - 1.0 / _rims_over_radii(image, rods)
    if not reduced > WRONG_SCALE:
        return ""
    return (
        f"By their rims neighbours would overlap: radii were reduced by {100.0 * reduced:.0f} % until they touch. The "
        "rims of thick discs show their sides, too; known radii are better (--radii)."
    )


def _rims_over_radii(image: Image, rods: Detection) -> float:
    """Return the median ratio of the rims' radii and the given ones; 1 of too few rims."""
    free = refine_grains(image, rods.x, rods.y, rods.radius, fixed_radius=False)
    seen = (free.quality > FAINT) & np.isfinite(free.sigma)
    return float(np.median(free.radius[seen] / rods.radius[seen])) if seen.sum() >= FEWEST_RIMS else 1.0


def describe_faint_rims(rods: Detection) -> str:
    """Name rods of whose rims so little is seen that they may be elsewhere; empty: none, or paint hides all rims."""
    faint = np.flatnonzero(rods.quality < FAINT)
    if not len(faint) or len(faint) > MANY * rods.count:
        return ""
    listed = ", ".join(map(str, faint[:NAMED])) + (", …" if len(faint) > NAMED else "")
    rods_are, they = ("rod", "it") if len(faint) == 1 else ("rods", "they")
    return (
        f"Of {rods_are} {listed} less than a fifth of the rim is seen: {they} may be elsewhere, or no rod. Look at "
        "understood.png, and place them by rodsight open."
    )
