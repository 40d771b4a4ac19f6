"""Local deformation around every grain between two frames, and how far its neighbours depart from it (D²min)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.cell import Cell
from ..bodies.grains import Array

REACH = 1.0  # mean diameters between the surfaces of neighbours: the first shell and what fills its gaps
MIN_NEIGHBOURS = 3  # two determine the gradient exactly and leave no residual
DEGENERATE = 1e-6  # ratio of the moments of the neighbours' places below which they lie on a line


@dataclass(frozen=True, slots=True)
class LocalMotion:
    """Local motion of every grain from one frame to the next; NaN where it is unknown."""

    strain: Float[Array, "n 2 2"]  # [–] logarithmic, extension positive
    d2min: Float[Array, " n"]  # [m²] mean squared departure of the neighbours from the local gradient
    rotation: Float[Array, " n"]  # [rad] rigid rotation of the neighbourhood, counter-clockwise


def measure_local_motion(
    before: Float[Array, "n 2"],
    after: Float[Array, "n 2"],
    radius: Float[Array, " n"],
    cells: tuple[Cell, Cell] | None = None,
) -> LocalMotion:
    """Fit the deformation gradient of every grain's neighbourhood, and measure what it does not explain.

    Parameters
    ----------
    before, after : (n, 2)
        Positions [m] in both frames; NaN: not seen.
    radius : (n,)
        Radii [m].
    cells : tuple of Cell, optional
        The periodic cell in both frames.

    Returns
    -------
    LocalMotion
        NaN for grains with fewer than MIN_NEIGHBOURS neighbours, or with all of them on one line.

    Notes
    -----
    With the distances d_j of the neighbours j before and d_j′ after, F minimises Σ |d_j′ − F d_j|², and
    D²min = (1/m) Σ |d_j′ − F d_j|² over the m neighbours (M. L. Falk & J. S. Langer, Phys. Rev. E 57, 7192, 1998, eqs.
    2.11–2.14, there without 1/m). Neighbours are the grains whose surfaces are less than one mean diameter apart
    before. The strain is ½ ln(F Fᵀ), NaN where det F ≤ 0; the rotation is that of the polar decomposition,
    atan2(F_yx − F_xy, F_xx + F_yy).
    """
    count = len(radius)
    d2min = np.full(count, np.nan)
    present = np.asarray(np.isfinite(np.hstack([before, after])).all(axis=1))
    if not present.any():
        return LocalMotion(np.full((count, 2, 2), np.nan), d2min, d2min)
    i, old, new = _neighbours(before, after, radius, present, cells)
    moments, mixed = _sum_of_products(i, old, old, count), _sum_of_products(i, new, old, count)
    neighbours = np.bincount(i, minlength=count)
    known = (neighbours >= MIN_NEIGHBOURS) & _spanning(moments)
    gradient = np.full((count, 2, 2), np.nan)
    gradient[known] = mixed[known] @ np.linalg.inv(moments[known])
    left = np.sum((new - np.einsum("cab,cb->ca", gradient[i], old)) ** 2, axis=1)
    total = np.bincount(i, weights=np.where(known[i], left, 0.0), minlength=count)
    d2min[known] = total[known] / neighbours[known]
    rotation = np.arctan2(gradient[:, 1, 0] - gradient[:, 0, 1], gradient[:, 0, 0] + gradient[:, 1, 1])
    return LocalMotion(_logarithmic_strains(gradient), d2min, rotation)


def _sum_of_products(i: NDArray[np.intp], a: Array, b: Array, count: int) -> Float[Array, "n 2 2"]:
    """Σ a_c b_cᵀ over the vectors a, b (c, 2) of every grain i (c,)."""
    sums = [np.bincount(i, a[:, p] * b[:, q], count) for p in range(2) for q in range(2)]
    return np.stack(sums, axis=1, dtype=np.float64).reshape(count, 2, 2)


def _logarithmic_strains(deformation: Float[Array, "n 2 2"]) -> Float[Array, "n 2 2"]:
    """Return ½ ln(F Fᵀ) of deformation gradients F; NaN where det F is not positive."""
    strain = np.full(deformation.shape, np.nan)
    sound = np.linalg.det(np.nan_to_num(deformation)) > 0.0
    stretch, axes = np.linalg.eigh(deformation[sound] @ deformation[sound].transpose(0, 2, 1))
    strain[sound] = np.einsum("nak,nk,nbk->nab", axes, 0.5 * np.log(stretch), axes)
    return strain


def _spanning(moments: Float[Array, "n 2 2"]) -> Bool[np.ndarray, " n"]:
    values = np.linalg.eigvalsh(moments)
    return values[:, 0] > DEGENERATE * np.maximum(values[:, 1], np.finfo(float).tiny)


def _neighbours(
    before: Array, after: Array, radius: Array, present: NDArray[np.bool_], cells: tuple[Cell, Cell] | None
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the first grain i of all ordered pairs of neighbours (c,), and the vectors from i to j (c, 2) [m]."""
    rows = np.flatnonzero(present)
    apart = REACH * 2.0 * float(radius[rows].mean())
    reach = 2.0 * float(radius[rows].max()) + apart
    points, owners = before[rows], np.arange(len(rows))
    if cells is not None:
        points, owners = cells[0].with_images(points, reach)
    pairs = KDTree(points[: len(rows)]).sparse_distance_matrix(KDTree(points), reach, output_type="ndarray")
    a, image = pairs["i"].astype(np.intp), pairs["j"].astype(np.intp)
    i, j = rows[a], rows[owners[image]]
    near = (a != image) & (pairs["v"] < radius[i] + radius[j] + apart)
    i, j = i[near], j[near]
    old = (points[image] - points[a])[near]
    new = after[j] - after[i]
    if cells is not None:  # the image of j before is j plus whole cell vectors, which deform with the cell
        steps = np.rint((old - (before[j] - before[i])) @ np.linalg.inv(cells[0].vectors))
        new = new + steps @ cells[1].vectors
    return i, old, new
