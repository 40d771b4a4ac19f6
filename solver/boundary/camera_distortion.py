"""Distortion of the camera from the gaps of touching pairs.

Surfaces of touching grains meet wherever in the picture they are and in whatever direction they touch. Gaps that grow
towards the rim of the picture, or that depend on the direction of the pair, show a lens or pixels that are not square.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..even_subset import even_subset
from ..quantity import Quantity
from .touching_pairs import (
    FEWEST_PAIRS,
    SIGNIFICANT,
    TouchingFit,
    count_classes,
    find_near_pairs,
    fit_touching_pairs,
    place_dependence,
)

MOST_FRAMES = 8  # of which gaps are read, evenly over the sequence …
MOST_POSES, FEWEST_FRAMES = 20_000, 2  # … and poses in them: more show the same distortion; frames at least
EXPLAINED = 0.95  # greatest ratio of the robust scatter of touching gaps after a correction to that before
# Unknowns of the model, by their rows.
ANISOTROPY, RADIAL, PERSPECTIVE, DECENTRING, UNKNOWNS = slice(0, 2), slice(2, 6), slice(6, 8), slice(8, 10), 10
TERMS = ("a", "b", "k_1", "k_2", "k_3", "k_4", "p", "q", "c", "d")  # names of the unknowns
KINDS = ((ANISOTROPY, "a stretching"), (RADIAL, "a lens"), (PERSPECTIVE, "a perspective"), (DECENTRING, "its middle"))
MODELS = ((2,), (0, 1), (2, 3), (2, 8, 9), (0, 1, 2), (0, 1, 2, 3), (0, 1, 6, 7), (0, 1, 2, 3, 6, 7))
EXTENSIONS = ((3,), (8, 9), (4,), (4, 5))  # of a lens that was found: higher orders, another middle
GAIN = 2.0  # standard errors, by which the likelihood of pairs that were not fitted must rise for an extension
CERTAIN = 3.0  # standard errors of an extension's unknown for hard grains, for which any rise is enough then
TILT = 1.0  # standard errors above which removing a perspective that must be an error gains more than it costs
FITS = 3  # of an extension: which pairs are near enough depends on the correction
MAX_OVERLAP = 2.5  # mean overlap over the scatter of touching gaps, above which readings of radii must be too large
# Mean overlap of soft grains over the scatter s of their touching gaps: 1 − 1.6 σ/s, with σ the noise of a position, is
# near the one at which r is largest in nine simulated packings with radii read too small (.8 at σ/s = .2, .3 at .45).
OVERLAP_OF_NOISE = 1.6
# In a crystal a stretching fits whatever its few directions have, so that more must be explained.
CRYSTAL, EXPLAINED_IN_CRYSTAL = 0.5, 0.8  # order of the directions of pairs; as EXPLAINED


@dataclass(frozen=True, slots=True)
class CameraDistortion:
    """Distortion of the picture about its middle, with lengths over its half-width L.

    Notes
    -----
    x_true = x + L [a (X, −Y) + b (Y, X) + (Σ k_i |ξ|^2i + p X + q Y + 2 c X + 2 d Y) ξ + |ξ|² (c, d) − e ξ], i = 1 … 4,
    with ξ = (x − x_0)/L = (X, Y), and e such that the mean length of the pairs stays the same: the pixel size is given.
    c and d are those of Brown (1966); a lens with another middle has them, too.
    """

    value: Annotated[Array, Quantity("a, b, k_1 … k_4, p, q, c, d of the correction", dims="lens_term", since=2)]
    sd: Annotated[
        Array, Quantity("standard error of them, as if errors were the same in all frames", dims="lens_term", since=2)
    ]
    shrinking: Annotated[float, Quantity("e, which keeps the mean length of the pairs", since=2)]
    middle: Annotated[Array, Quantity("middle x_0 of the picture", "m", "xy", since=2)]
    half_width: Annotated[float, Quantity("half-width L of the picture", "m", since=2)]
    scatter: Annotated[
        float, Quantity("robust standard deviation of the gaps of candidate pairs as measured", "m", since=2)
    ]
    explained: Annotated[float, Quantity("the same after the correction", "m", since=2)]
    applied: Annotated[bool, Quantity("whether positions were corrected by it", since=2, absent=False)]
    unexplained: Annotated[
        float,
        Quantity("range over the picture of the usual touching gap that remains; 0: within its error", "m", since=2),
    ]
    radius_error: Annotated[
        Array, Quantity("true minus given radius of a size, if touching surfaces just meet", "m", "size_class", since=2)
    ]
    touching_scatter: Annotated[
        float, Quantity("robust standard deviation of the gaps of touching pairs", "m", since=2)
    ]
    radius_error_sd: Annotated[Array, Quantity("standard error of it", "m", "size_class", since=2)]
    size: Annotated[Array, Quantity("mean given radius of a size", "m", "size_class", since=2)]
    radius_factor: Annotated[
        Array, Quantity("factor by which the radii of a size were multiplied on average", dims="size_class", since=2)
    ]

    def correct(self, position: Array) -> Array:
        """Return undistorted positions (…, 2) [m]."""
        if not self.applied:
            return position
        moved = np.tensordot(self.value, _displacements(position, self.middle, self.half_width), 1)
        return position + moved - self.shrinking * (position - self.middle)

    def correct_scaled(self, position: Array, scale: float) -> Array:
        """Return undistorted positions (…, 2) [m] with all distances from the middle multiplied by a factor."""
        return self.middle + scale * (self.correct(position) - self.middle)

    def common_scale(self) -> float:
        """Return the factor of all distances with which touching surfaces meet by the given radii.

        Notes
        -----
        1 − Σ (δ/R)/s² / Σ 1/s² over the sizes, with δ the error of the radius R of a size and s the relative one's
        standard error.
        """
        weight = (self.size / np.maximum(self.radius_error_sd, 1e-12)) ** 2
        return 1.0 - float(np.average(self.radius_error / self.size, weights=weight))

    def radial_change(self) -> float:
        """Return the radial displacement at the rim of the picture over its half-width, with the middle unchanged."""
        return float(self.value[RADIAL].sum())

    def class_correction(self, noise: float) -> Array | None:
        """Return what to add to the radii of every class (q,) [m] of soft grains; None: overlaps may explain the gaps.

        Parameters
        ----------
        noise : float
            Standard deviation of a position component [m].

        Notes
        -----
        The correction leaves every class a mean overlap of s max(1 − 1.6 σ/s, 0), s the scatter of touching gaps and σ
        the noise. Overlaps of forces explain neither gaps between touching surfaces, nor classes that differ by more
        than s, nor overlaps above 2.5 s.
        """
        error, scatter = self.radius_error, self.touching_scatter
        overlap = -2.0 * float(error.mean())
        if np.ptp(error) < scatter and 0.0 <= overlap < MAX_OVERLAP * scatter:
            return None
        return error + 0.5 * max(scatter - OVERLAP_OF_NOISE * noise, 0.0)

    def describe(self) -> list[str]:
        """Describe the correction and what remains in sentences for the user."""
        sentences = []
        if self.applied:
            parts = []
            if self.value[RADIAL].any():
                parts.append(f"a radial distortion of {100 * self.radial_change():.2g} % at the picture's rim")
            if self.value[ANISOTROPY].any():
                size = 100 * float(np.hypot(*self.value[ANISOTROPY]))
                parts.append(f"a stretching of {size:.2g} % along one direction")
            if self.value[DECENTRING].any():
                size = 100 * float(np.hypot(*self.value[DECENTRING]))
                parts.append(f"a decentring of the lens of {size:.2g} %")
            if self.value[PERSPECTIVE].any():
                size = 100 * float(np.hypot(*self.value[PERSPECTIVE]))
                parts.append(f"a perspective of {size:.2g} %")
            removed = f"{', '.join(parts)} {'was' if len(parts) == 1 else 'were'} removed, since gaps of near grains"
            before, after = 1e6 * self.scatter, 1e6 * self.explained
            if after < EXPLAINED * before:
                sentences.append(f"{removed} then scatter by {after:.0f} instead of {before:.0f} µm")
            else:
                sentences.append(f"{removed} have a gradient across the picture, which forces in balance do not have")
        if self.unexplained > 0.0:
            sentences.append(
                f"gaps of touching grains depend on their place in the picture by {1e6 * self.unexplained:.0f} µm, "
                "which neither lens nor pixels explain: calibrate the camera"
            )
        return sentences

    def describe_terms(self) -> str:
        """Describe the camera and the sizes with their standard errors in one sentence, for a user."""
        values = zip(TERMS, 100.0 * self.value, 100.0 * self.sd, strict=True)
        term = [f"{name.replace('_', '')} = {each:.2g} ± {sd:.1g} %" if each else "" for name, each, sd in values]
        terms = [f"{kind} ({', '.join(filter(None, term[rows]))})" for rows, kind in KINDS if self.value[rows].any()]
        camera = f"{', '.join(terms)} of half the width" if terms else "no distortion"
        if terms and not self.applied:
            camera += " (not applied)"
        sizes = [
            f"{1e3 * size:.4g} mm {1e6 * error:+.2g} ± {1e6 * sd:.1g} µm"
            for size, error, sd in zip(self.size, self.radius_error, self.radius_error_sd, strict=True)
        ]
        return (
            f"gaps of near grains show {camera} and scatter by {1e6 * self.explained:.3g} µm"
            f"{f', {1e6 * self.scatter:.3g} µm before' if self.applied else ''}; touching surfaces meet with radii "
            f"{', '.join(sizes)}"
        ).replace("-", "−")


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Pairs that may touch, of all frames that are read."""

    gap: Array  # (m,) [m] as measured, along the normals of the corrected positions
    design: Array  # (m, 10 + q) change of the gap by the unknowns of the camera and by an error of the radii by class
    shrinking: Array  # (10,) e of a unit of each unknown
    middle: Array  # (m, 2) of the pair over the half-width
    frames: int


def find_camera_distortion(
    position: Array, radius: Array, size_class: NDArray[np.integer], *, soft: bool = False,
    boundary: NDArray[np.bool_] | None = None,
) -> CameraDistortion | None:  # fmt: skip
    """Find the distortion of the camera.

    Parameters
    ----------
    position : (f, n, 2)
        Measured positions [m], NaN where a grain is missing.
    radius : (n,)
        Radii [m].
    size_class : (n,)
        Class of each grain by its size, from 0; the error of a class's radius is found with the distortion.
    soft : bool
        Whether overlaps are forces, so that a small error of the camera matters.
    boundary : (n,), optional
        Grains of the boundary, of which two need not touch; None: none.

    Returns
    -------
    CameraDistortion or None
        None: too few grains are near one another.

    Notes
    -----
    Weighted least squares of g + n·(u(x_j) − u(x_i)) − δ_i − δ_j = 0 over pairs, with u the displacement of
    `CameraDistortion` and δ the error of a class's radius, see `fit_touching_pairs`. A model with more unknowns is
    applied where it reduces the robust scatter of all pairs to 0.95 of that of a simpler one, in a crystal 0.8, if one
    of its unknowns exceeds five standard errors. Forces of soft grains depend on direction and place, too: who knows
    their overlaps must compare the change of gaps with them. A lens that is found gets higher orders and another middle
    where these raise the likelihood of the gaps in the other frames by two standard errors. A gradient of the gaps of
    soft grains across the picture is a perspective if it exceeds its standard error: without gravity, balance allows no
    gradient of the mean pressure.
    """
    present = position[np.isfinite(position[..., 0])]
    if not len(present):
        return None
    middle = 0.5 * (present.min(axis=0) + present.max(axis=0))
    count = min(max(min(MOST_FRAMES, MOST_POSES // len(radius)), FEWEST_FRAMES), len(position))
    reading = _Reading(
        position[even_subset(len(position), count)],
        radius, size_class, middle, 0.5 * float(np.ptp(present, axis=0).max()), boundary,
    )  # fmt: skip
    pairs = reading.find_pairs(None)
    if len(pairs.gap) < FEWEST_PAIRS * pairs.frames:
        return None
    none = _fit(pairs, (), reading.diameter)
    best, chosen = none, ()
    explained = EXPLAINED_IN_CRYSTAL if _direction_order(pairs) > CRYSTAL else EXPLAINED
    for unknowns in MODELS:
        found = _fit(pairs, unknowns, reading.diameter)
        significant = np.abs(found.value[list(unknowns)]) > SIGNIFICANT * found.sd[list(unknowns)]
        if significant.any() and found.misfit < explained * best.misfit:
            best, chosen = found, unknowns
    if set(chosen) & set(range(UNKNOWNS)[RADIAL]):
        pairs, best, chosen = _extend(reading, pairs, best, chosen, soft)
    if soft:
        pairs, best, chosen = _add_perspective(reading, pairs, best, chosen)
    value = best.value[:UNKNOWNS]
    size = np.bincount(size_class, radius) / np.bincount(size_class)
    return CameraDistortion(
        value, best.sd[:UNKNOWNS], float(pairs.shrinking @ value), middle, reading.half_width, none.misfit, best.misfit,
        bool(chosen), place_dependence(best, pairs.middle, reading.diameter, pairs.frames), best.value[UNKNOWNS:],
        best.scatter, best.sd[UNKNOWNS:], size, np.ones(len(size)),
    )  # fmt: skip


def _direction_order(pairs: _Pairs) -> float:
    """Greater of |⟨exp(i m φ)⟩|, m = 4 and 6, over the directions φ of the pairs: 1 in a crystal, 0 without order."""
    twice = np.arctan2(pairs.design[:, 1], pairs.design[:, 0])  # a stretching along x and one along the diagonal
    return max(float(np.abs(np.exp(1j * half * twice).mean())) for half in (2, 3))


@dataclass(frozen=True, slots=True)
class _Reading:
    """Positions of some frames, from which pairs are read again as the correction changes."""

    position: Array  # (f, n, 2) [m]
    radius: Array  # (n,) [m]
    size_class: NDArray[np.integer]  # (n,)
    middle: Array  # (2,) [m]
    half_width: float  # [m]
    boundary: NDArray[np.bool_] | None  # (n,)

    @property
    def diameter(self) -> float:
        return 2.0 * float(self.radius.mean())

    def select(self, frames: slice) -> _Reading:
        return replace(self, position=self.position[frames])

    def find_pairs(self, fit: TouchingFit | None, shrinking: Array | None = None) -> _Pairs:
        """Find the pairs that may touch after the correction of a fit, and what each unknown changes."""
        classes = int(self.size_class.max()) + 1
        radius = self.radius if fit is None else self.radius + fit.value[UNKNOWNS:][self.size_class]
        gap, design, centre, length = [], [], [], []
        for place in self.position:
            moved = _displacements(place, self.middle, self.half_width)
            corrected = place
            if fit is not None and shrinking is not None:
                value = fit.value[:UNKNOWNS]
                corrected = place + np.tensordot(value, moved, 1) - (shrinking @ value) * (place - self.middle)
            near = find_near_pairs(corrected, radius, self.boundary)
            branch = np.einsum("mk,mk->m", place[near.j] - place[near.i], near.normal)
            along = np.einsum("pck,ck->cp", moved[:, near.j] - moved[:, near.i], near.normal)
            gap.append(branch - self.radius[near.i] - self.radius[near.j])
            design.append(np.column_stack([along, -count_classes(near, self.size_class, classes)]))
            centre.append((0.5 * (place[near.i] + place[near.j]) - self.middle) / self.half_width)
            length.append(branch)
        branches, rows = np.concatenate(length), np.concatenate(design)
        # Without this, a field of higher order could shrink the whole picture, which makes all gaps alike.
        shrinking = rows[:, :UNKNOWNS].T @ branches / float(branches @ branches)
        rows[:, :UNKNOWNS] -= branches[:, None] * shrinking
        return _Pairs(np.concatenate(gap), rows, shrinking, np.concatenate(centre), len(self.position))


def _extend(
    reading: _Reading, pairs: _Pairs, best: TouchingFit, chosen: tuple[int, ...], soft: bool
) -> tuple[_Pairs, TouchingFit, tuple[int, ...]]:
    """Add higher orders of a lens where pairs of the other half of the frames confirm them."""
    halves = reading.select(slice(0, None, 2)), reading.select(slice(1, None, 2))
    if not len(halves[1].position):
        return pairs, best, chosen
    before = _refit(halves[0], chosen)
    for more in EXTENSIONS:
        unknowns = tuple(sorted({*chosen, *more}))
        if len(unknowns) == len(chosen):
            continue
        after = _refit(halves[0], unknowns)
        gain, fit = _likelihood_gain(halves[1], before, after), after[1]
        certain = not soft and bool((np.abs(fit.value[list(more)]) > CERTAIN * fit.sd[list(more)]).any())
        if gain > GAIN or (gain > 0.0 and certain):
            before, chosen = after, unknowns
    return *_refit(reading, chosen), chosen


def _add_perspective(
    reading: _Reading, pairs: _Pairs, best: TouchingFit, chosen: tuple[int, ...]
) -> tuple[_Pairs, TouchingFit, tuple[int, ...]]:
    """Add a perspective where it exceeds its standard error."""
    tilt = range(UNKNOWNS)[PERSPECTIVE]
    unknowns = tuple(sorted({*chosen, *tilt}))
    if unknowns == chosen:
        return pairs, best, chosen
    tilted = _refit(reading, unknowns)
    value, sd = tilted[1].value[tilt], tilted[1].sd[tilt]
    return (*tilted, unknowns) if (np.abs(value) > TILT * sd).any() else (pairs, best, chosen)


def _refit(reading: _Reading, unknowns: tuple[int, ...]) -> tuple[_Pairs, TouchingFit]:
    """Fit some unknowns of the camera to pairs that are found anew with each correction."""
    pairs = reading.find_pairs(None)
    found = _fit(pairs, unknowns, reading.diameter)
    for _ in range(FITS - 1):
        pairs = reading.find_pairs(found, pairs.shrinking)
        found = _fit(pairs, unknowns, reading.diameter, found)
    return pairs, found


def _likelihood_gain(reading: _Reading, before: tuple[_Pairs, TouchingFit], after: tuple[_Pairs, TouchingFit]) -> float:
    """Compute by how many standard errors pairs of these frames are likelier after than before.

    Notes
    -----
    The likelihood of a residual g is that of a Cauchy distribution of the touching gaps' scatter s: ln 1/(1 + (g/s)²).
    Frames repeat each other's pairs, so that the standard error is that of one frame.
    """
    (fitted, one), (other, two) = before, after
    pairs = reading.find_pairs(two, other.shrinking)
    branch = pairs.shrinking  # the gauge of these pairs is replaced by those of the fits
    likelihood = []
    for gauge, fit in ((fitted.shrinking, one), (other.shrinking, two)):
        shift = float((branch - gauge) @ fit.value[:UNKNOWNS])
        residual = pairs.gap + pairs.design @ fit.value + shift * reading.diameter
        likelihood.append(-np.log1p((residual / two.scatter) ** 2))
    gain = likelihood[1] - likelihood[0]
    return float(gain.mean() / max(gain.std(), 1e-300) * np.sqrt(len(gain) / pairs.frames))


def _displacements(position: Array, middle: Array, half_width: float) -> Array:
    """Displacements (10, …, 2) [m] of points (…, 2) [m] by a unit of each unknown."""
    x = (position - middle) / half_width
    square = np.sum(x**2, axis=-1, keepdims=True)
    radial = [square**order * x for order in range(1, 5)]
    decentred = [square * axis + 2.0 * x * (x @ axis)[..., None] for axis in np.eye(2)]
    return half_width * np.stack(
        [x * np.array([1.0, -1.0]), x[..., ::-1], *radial, x[..., :1] * x, x[..., 1:] * x, *decentred]
    )


def _fit(pairs: _Pairs, unknowns: tuple[int, ...], diameter: float, start: TouchingFit | None = None) -> TouchingFit:
    """Fit some unknowns of the camera, and the errors of radii."""
    count = pairs.design.shape[1]
    used = [*unknowns, *range(UNKNOWNS, count)]
    found = fit_touching_pairs(
        pairs.gap, pairs.design[:, used], np.arange(len(used)) >= len(unknowns), diameter, pairs.frames,
        start=None if start is None else start.value[used],
    )  # fmt: skip
    value, sd = np.zeros(count), np.zeros(count)
    value[used], sd[used] = found.value, found.sd
    return replace(found, value=value, sd=sd)
