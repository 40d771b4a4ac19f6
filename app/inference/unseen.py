"""Rods that no photograph shows, added to the tracks where their neighbours say that they must be."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.inferred.unseen_rods import infer_unseen

from ..tracks import Tracks, TrackStatus, WallTracks


def add_unseen(tracks: Tracks, walls: WallTracks, sizes: Array | None, overlap: float = 0.0) -> Tracks:
    """The tracks with the rods that were inferred after the others.

    sizes (q,) [m]: the known radii, None: any; overlap [m]: the mean one of touching grains where they are soft.
    """
    present = tracks.present
    noise = float(np.sqrt(np.mean(tracks.position_sigma**2)))
    found = infer_unseen(
        tracks.radius, tracks.position, present, walls.endpoints, noise, sizes, walls.side, overlap=overlap
    )
    if not found.count:
        return replace(tracks, inferred=np.zeros(tracks.grain_count, bool))
    f, u = tracks.frame_count, found.count
    new: dict[str, NDArray] = {
        "id": tracks.id.max() + 1 + np.arange(u),
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
    }
    told = {each.name: getattr(tracks, each.name) for each in fields(tracks)}
    grown = {
        name: np.concatenate([told[name], values], axis=1 if values.ndim > 1 else 0)
        for name, values in new.items()
        if told[name] is not None
    }
    return replace(tracks, **grown, inferred=np.arange(tracks.grain_count + u) >= tracks.grain_count)
