"""Bars followed by their texture, or by their edge where the texture is missing or is that of something at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import outward_normals
from .edge_tracker import EdgePoses, move_to_corners
from .wall_tracker import WallPoses

FOUND_MORE = 1.25  # times as many photographs must show the edge as the texture
APART = 1.0  # [px] and …
SDS_APART = 4.0  # … standard deviations between edge and texture, from which on one of them is not the bar
AT_REST = 0.5  # motion of the texture across the bar, over that of the edge, below which it is the background


@dataclass(frozen=True, slots=True)
class BarMotion:
    """w bars in f photographs."""

    endpoints: Array  # (f, w, 2, 2) [m]; NaN where a bar is not found
    sigma: Array  # (f, w, 2) [m] of each end along the normal, against frame 0
    zncc: Array  # (f, w) of the texture; NaN for an edge
    patches: NDArray[np.int64]  # (f, w) number that agree; 0 for an edge
    edge: Array  # (f, w) fraction of the edge that is seen; NaN for a texture


def texture_or_edge(
    texture: Sequence[WallPoses],
    edges: Sequence[EdgePoses],
    given: NDArray[np.bool_],
    lined: NDArray[np.bool_],
    pixel: float,
) -> BarMotion:
    """Choose for each bar how it is followed.

    Parameters
    ----------
    texture, edges : sequence of f
        The bars found in both ways.
    given : (f, w) array of bool
        Bars whose place a table gives; it stands in both.
    lined : (w,) array of bool
        Bars whose texture does not show the motion along them.
    pixel : float
        Size of a pixel [m].

    Notes
    -----
    The texture is more precise and shows the motion along the bar. It is no bar's where it rests while the edge moves:
    a thin bar, or a shiny one, lets the background be seen beside its edge.
    """
    by_texture, by_edge = (np.stack([pose.endpoints for pose in poses]) for poses in (texture, edges))
    sigma, edge_sigma = (np.stack([pose.sigma for pose in poses]) for poses in (texture, edges))
    seen, edge_seen = (np.isfinite(ends).all(axis=(2, 3)) & ~given for ends in (by_texture, by_edge))
    chosen = edge_seen.sum(axis=0) > FOUND_MORE * seen.sum(axis=0)
    chosen |= _rests(by_texture, by_edge, np.hypot(sigma, edge_sigma), pixel)
    endpoints = np.where(chosen[:, None, None], by_edge, by_texture)
    return BarMotion(
        np.where(given[..., None, None], endpoints, move_to_corners(endpoints, chosen | lined)),
        np.where(chosen[:, None], edge_sigma, sigma),
        np.where(chosen, np.nan, np.stack([pose.zncc for pose in texture])),
        np.where(chosen, 0, np.stack([pose.patches for pose in texture])),
        np.where(chosen & ~given, np.stack([pose.fraction for pose in edges]), np.nan),
    )


def _rests(texture: Array, edge: Array, sigma: Array, pixel: float) -> NDArray[np.bool_]:
    """Which bars (w,) have a texture that rests while their edge (f, w, 2, 2) moves."""
    normal = outward_normals(texture[0])
    across, edge_across = (np.einsum("fwek,wk->fwe", ends - ends[0], normal) for ends in (texture, edge))
    apart = np.abs(across - edge_across) > APART * pixel + SDS_APART * sigma
    moved, edge_moved = (np.abs(np.nan_to_num(each)).max(axis=(0, 2)) for each in (across, edge_across))
    return np.asarray(apart.any(axis=(0, 2)) & (moved < AT_REST * edge_moved))
