"""The setting photographs.follow = "outline" through the command line."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.tracks import TrackStatus

from tests.app.tracking.outline.discs import BLACK, WHITE, Light, lay_row_by_row, photograph_discs
from tests.app.tracking.photographed import track

PIXEL = 1e-4  # [m]
SHAPE = (190, 190)
EXPERIMENT = """
name = "plain"
[photographs]
files = "photos/*.png"
pixel_size = 1e-4
interval = 1.0
radii = [0.0013, 0.0018]
follow = "outline"
[material]
density = 1200.0
length = 0.006
friction = 0.3
"""


@pytest.mark.thorough
@pytest.mark.parametrize("light", [WHITE, BLACK], ids=["white on black", "black on white"])
def test_plain_discs_are_detected_and_followed_without_rotation(tmp_path: Path, light: Light) -> None:
    x, y, radius = lay_row_by_row(3, 3, (13.0, 18.0))
    (tmp_path / "photos").mkdir()
    for k in range(3):
        image = photograph_discs(light, SHAPE, x + 2.0 * k, y - k, radius, 0.0 * x, k)
        cv2.imwrite(str(tmp_path / "photos" / f"{k}.png"), np.clip(np.rint(image), 0, 255).astype(np.uint8))
    (tmp_path / "experiment.toml").write_text(EXPERIMENT)
    tracks, walls = track(tmp_path, tmp_path / "out")
    assert walls is None
    assert tracks.grain_count == len(x)
    assert np.isnan(tracks.rotation).all()
    assert (tracks.status == TrackStatus.OK).all()
    moved = (tracks.position - tracks.position[0]) / PIXEL
    assert np.abs(moved - np.array([2.0, 1.0]) * np.arange(3)[:, None, None]).max() < 0.2
