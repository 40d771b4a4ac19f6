"""Distortion of the camera from the gaps of touching pairs, for packings without walls.

Surfaces of touching grains meet wherever in the picture they are and in whatever direction they touch. Gaps that grow
towards the rim of the picture, or that depend on the direction of the pair, show a lens or pixels that are not square.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from .touching_pairs import TouchingFit, count_classes, find_near_pairs, fit_touching_pairs

MOST_FRAMES = 8  # of which gaps are read, evenly over the sequence
FEWEST_PAIRS = 100  # in a frame
SIGNIFICANT = 5.0  # standard errors
EXPLAINED = 0.95  # greatest ratio of the robust scatter of touching gaps after a correction to that before
ANISOTROPY, RADIAL, PERSPECTIVE, UNKNOWNS = slice(0, 2), slice(2, 4), slice(4, 6), 6  # unknowns of the model
MODELS = ((2,), (0, 1), (2, 3), (0, 1, 2), (0, 1, 2, 3), (0, 1, 4, 5), (0, 1, 2, 3, 4, 5))
MAX_OVERLAP = 2.5  # mean overlap over the scatter of touching gaps, above which readings of radii must be too large
# Mean overlap of soft grains over the scatter of their touching gaps: forces have a standard deviation of .8 of their
# mean.
TYPICAL_OVERLAP = 1.25
SECTORS, RINGS = 8, 3  # parts of the picture in which gaps are compared
UNEXPLAINED = 1.0  # robust standard deviations of a touching gap: range of its mean over the parts of the picture


@dataclass(frozen=True, slots=True)
class CameraDistortion:
    """Distortion of the picture about its middle, with lengths over its half-width L.

    Notes
    -----
    x_true = x + L [a (X, −Y) + b (Y, X) + (k |ξ|² + m |ξ|⁴ + p X + q Y) ξ] with ξ = (x − x_0)/L = (X, Y).
    """

    value: Array  # (6,) a, b, k, m, p, q
    sd: Array  # (6,) standard error, as if errors were the same in all frames
    middle: Array  # (2,) [m] x_0
    half_width: float  # [m] L
    scatter: float  # [m] robust standard deviation of the gaps of candidate pairs as they were measured
    explained: float  # [m] after the correction; the same without one
    applied: bool
    unexplained: float  # [m] range over the picture of the mean touching gap that remains; 0: within its error
    radius_error: Array  # (q,) [m] true minus given radius of every class, if touching surfaces just meet
    touching_scatter: float  # [m] robust standard deviation of the gaps of touching pairs after the correction

    def correct(self, position: Array) -> Array:
        """Return undistorted positions (…, 2) [m]."""
        if not self.applied:
            return position
        return position + np.tensordot(self.value, _displacements(position, self.middle, self.half_width), 1)

    def class_correction(self) -> Array | None:
        """Return what to add to the radii of every class (q,) [m] of soft grains; None: overlaps may explain the gaps.

        Notes
        -----
        The correction leaves every class a mean overlap of 1.25 s, s the scatter of touching gaps. Overlaps of forces
        explain neither classes that differ by more than s nor overlaps above 2.5 s.
        """
        error, scatter = self.radius_error, self.touching_scatter
        if len(error) < 2:
            return None
        if np.ptp(error) < scatter and -2.0 * float(error.mean()) < MAX_OVERLAP * scatter:
            return None
        return error + 0.5 * TYPICAL_OVERLAP * scatter

    def describe(self) -> list[str]:
        """Describe the correction and what remains in sentences for the user."""
        sentences = []
        if self.applied:
            parts = []
            if self.value[RADIAL].any():
                parts.append(
                    f"a radial distortion of {100 * float(self.value[RADIAL].sum()):.2g} % at the picture's rim"
                )
            if self.value[ANISOTROPY].any():
                size = 100 * float(np.hypot(*self.value[ANISOTROPY]))
                parts.append(f"a stretching of {size:.2g} % along one direction")
            if self.value[PERSPECTIVE].any():
                size = 100 * float(np.hypot(*self.value[PERSPECTIVE]))
                parts.append(f"a perspective of {size:.2g} %")
            sentences.append(
                f"{', '.join(parts)} {'was' if len(parts) == 1 else 'were'} removed, since gaps of near grains then "
                f"scatter by {1e6 * self.explained:.0f} instead of {1e6 * self.scatter:.0f} µm"
            )
        if self.unexplained > 0.0:
            sentences.append(
                f"gaps of touching grains depend on their place in the picture by {1e6 * self.unexplained:.0f} µm, "
                "which neither lens nor pixels explain: calibrate the camera"
            )
        return sentences


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Pairs that may touch, of all frames that are read."""

    gap: Array  # (m,) [m] as measured
    design: Array  # (m, 6 + q) change of the gap by the unknowns of the camera and by an error of the radii by class
    middle: Array  # (m, 2) of the pair over the half-width
    frames: int


def find_camera_distortion(position: Array, radius: Array, size_class: NDArray[np.integer]) -> CameraDistortion | None:
    """Find the distortion of the camera.

    Parameters
    ----------
    position : (f, n, 2)
        Measured positions [m], NaN where a grain is missing.
    radius : (n,)
        Radii [m].
    size_class : (n,)
        Class of each grain by its size, from 0; the error of a class's radius is found with the distortion.

    Returns
    -------
    CameraDistortion or None
        None: too few grains are near one another.

    Notes
    -----
    Weighted least squares of g + n·(u(x_j) − u(x_i)) − δ_i − δ_j = 0 over pairs, with u the displacement of
    `CameraDistortion` and δ the error of a class's radius. Weights (1 + (g/s)²)⁻² for positive residuals g, with s
    shrinking from a fraction of a diameter to twice the robust standard deviation: pairs that do not touch stand apart.
    A model with more unknowns is applied where it reduces the robust scatter of all pairs to 0.95 of that of a simpler
    one, if one of its unknowns exceeds five standard errors. Forces of soft grains depend on direction and place, too,
    but do not change the scatter of their gaps so much.
    """
    rows = np.unique(np.linspace(0, len(position) - 1, min(MOST_FRAMES, len(position))).astype(int))
    present = position[np.isfinite(position[..., 0])]
    if not len(present):
        return None
    middle = 0.5 * (present.min(axis=0) + present.max(axis=0))
    half_width = 0.5 * float(np.ptp(present, axis=0).max())
    pairs = _pairs_with_design(position[rows], radius, size_class, middle, half_width)
    if len(pairs.gap) < FEWEST_PAIRS * pairs.frames:
        return None
    diameter = 2.0 * float(radius.mean())
    none = _fit(pairs, (), diameter)
    best, chosen = none, ()
    for unknowns in MODELS:
        found = _fit(pairs, unknowns, diameter)
        significant = np.abs(found.value[list(unknowns)]) > SIGNIFICANT * found.sd[list(unknowns)]
        if significant.any() and found.misfit < EXPLAINED * best.misfit:
            best, chosen = found, unknowns
    value = np.where(np.isin(np.arange(UNKNOWNS), chosen), best.value[:UNKNOWNS], 0.0)
    return CameraDistortion(
        value, best.sd[:UNKNOWNS], middle, half_width, none.misfit, best.misfit, bool(chosen),
        _place_dependence(pairs, best), best.value[UNKNOWNS:], best.scatter,
    )  # fmt: skip


def _displacements(position: Array, middle: Array, half_width: float) -> Array:
    """Displacements (6, …, 2) [m] of points (…, 2) [m] by a unit of each unknown."""
    x = (position - middle) / half_width
    square = np.sum(x**2, axis=-1, keepdims=True)
    return half_width * np.stack(
        [x * np.array([1.0, -1.0]), x[..., ::-1], square * x, square**2 * x, x[..., :1] * x, x[..., 1:] * x]
    )


def _pairs_with_design(
    position: Array, radius: Array, size_class: NDArray[np.integer], middle: Array, half_width: float
) -> _Pairs:
    classes, parts = int(size_class.max()) + 1, []
    for place in position:
        near = find_near_pairs(place, radius)
        moved = _displacements(place, middle, half_width)
        along = np.einsum("pck,ck->cp", moved[:, near.j] - moved[:, near.i], near.normal)
        own = count_classes(near, size_class, classes)
        centre = (0.5 * (place[near.i] + place[near.j]) - middle) / half_width
        parts.append((near.gap, np.column_stack([along, -own]), centre))
    gap, design, centre = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _Pairs(gap, design, centre, len(position))


def _fit(pairs: _Pairs, unknowns: tuple[int, ...], diameter: float) -> TouchingFit:
    """Fit some unknowns of the camera, and the errors of radii."""
    count = pairs.design.shape[1]
    used = [*unknowns, *range(UNKNOWNS, count)]
    found = fit_touching_pairs(
        pairs.gap, pairs.design[:, used], np.arange(len(used)) >= len(unknowns), diameter, pairs.frames
    )
    value, sd = np.zeros(count), np.zeros(count)
    value[used], sd[used] = found.value, found.sd
    return replace(found, value=value, sd=sd)


def _place_dependence(pairs: _Pairs, fit: TouchingFit) -> float:
    """Compute the range of the mean touching gap over the picture [m]; 0 where it is within scatter and error."""
    touching = fit.weight > 0.5
    x, y = pairs.middle[touching].T
    ring = np.minimum((np.hypot(x, y) * RINGS).astype(int), RINGS - 1)
    part = ring * SECTORS + ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    count = np.bincount(part, minlength=SECTORS * RINGS)
    known = count > FEWEST_PAIRS
    if known.sum() < 2:
        return 0.0
    mean = np.bincount(part, fit.residual[touching], minlength=SECTORS * RINGS)[known] / count[known]
    error = fit.scatter * np.sqrt(pairs.frames / count[known])
    spread = float(np.ptp(mean))
    beyond = spread > UNEXPLAINED * fit.scatter and spread > SIGNIFICANT * float(error.max())
    return spread if beyond else 0.0
