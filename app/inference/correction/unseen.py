"""Rods that no photograph shows, added to the tracks where their neighbours require them."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...solver.inferred.unseen_rods import UnseenRodSettings, infer_unseen
from ...tracks import Tracks, TrackStatus, WallTracks


def add_unseen(tracks: Tracks, walls: WallTracks, sizes: Array | None, overlap: float = 0.0) -> Tracks:
    """Append inferred rods to the tracks.

    Parameters
    ----------
    tracks : Tracks
    walls : WallTracks
    sizes : ndarray, shape (q,), optional
        Known radii [m]; None: any.
    overlap : float
        Mean overlap of touching grains where they are soft [m].

    Returns
    -------
    Tracks
        The same where too little is known to seek them.
    """
    present = tracks.present
    noise = float(np.sqrt(np.mean(tracks.position_sigma**2)))
    found = infer_unseen(
        tracks.radius,
        tracks.position,
        present,
        walls.endpoints,
        UnseenRodSettings(noise, sizes, overlap, tracks.boundary),
        walls.side,
    )
    if not found.sought:
        return tracks
    if not found.count:
        return replace(tracks, inferred=np.zeros(tracks.grain_count, bool))
    f, u = tracks.frame_count, found.count
    ids = tracks.id.max() + 1 + np.arange(u)
    new: dict[str, NDArray] = {
        "id": ids,
        "radius": found.radius,
        "position": found.position,
        "rotation": np.full((f, u), np.nan),
        "sigma": found.sigma,
        "zncc": np.full((f, u), np.nan),
        "status": np.where(np.isfinite(found.sigma), TrackStatus.INFERRED, TrackStatus.LOST).astype(np.uint8),
        "centre_sigma": np.zeros(u),
        "second_zncc": np.full((f, u), np.nan),
        "reference_frame": np.zeros((f, u), np.int32),
        "boundary": np.zeros(u, np.bool_),
        "fringes": np.full((f, u), np.nan),
        "given_id": np.tile(ids, (f, 1)),
    }
    given = {each.name: getattr(tracks, each.name) for each in fields(tracks)}
    extended = {
        name: np.concatenate([given[name], values], axis=1 if values.ndim > 1 else 0)
        for name, values in new.items()
        if given[name] is not None
    }
    return replace(tracks, **extended, inferred=np.arange(tracks.grain_count + u) >= tracks.grain_count)
