"""Tracks and walls as the solver reads them: one snapshot a photograph."""

from __future__ import annotations

from solver.bodies.motion import Snapshot

from ..tracks import Tracks, WallTracks


def make_snapshots(tracks: Tracks, walls: WallTracks) -> list[Snapshot]:
    """What the solver reads of tracks and walls."""
    present, sigma = tracks.present, tracks.position_sigma
    return [
        Snapshot(
            float(tracks.time[k]), tracks.position[k], tracks.rotation[k], present[k], walls.endpoints[k],
            float(sigma[k]),
        )
        for k in range(tracks.frame_count)
    ]  # fmt: skip
