"""Photographs of bars without paint: set up from flags, tracked by their edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.reading.tables import read_table
from rodsight.synthetic.speckle import SpeckleSettings
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.app.tracking.photographed import keep_first_walls, track
from tests.program import rodsight

PIXEL = 2.5e-4  # [m]
ACROSS, ALONG = 0.3, 0.5  # [px]


@pytest.fixture(scope="module", params=[0.012, 0.0015], ids=["plain", "thin"])
def experiment(request, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bars") / "photographed"
    speckle = SpeckleSettings(bar_coverage=0.0, bar_thickness=request.param)
    synthesize(folder, SynthesisSettings(preset="small", seed=5, grains=60, frames=4, speckle=speckle))
    return folder


@pytest.mark.thorough
def test_bars_without_paint_are_followed(experiment, tmp_path, capsys):
    thin = read_table(experiment / "walls.csv", ("x1",)).numbers("x1").min() < 0.01  # the picture begins nearer to them
    flags = ("--photographs", experiment / "photos" / "*.jpg", "--pixel-size", PIXEL, "--interval", 52)
    assert rodsight("init", tmp_path / "new", *flags, "--radii", "0.007,0.008,0.011") == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert ("followed by their edges: 'bottom', 'right', 'top', 'left'" in printed) != thin
    true = keep_first_walls(experiment)
    _, walls = track(experiment, tmp_path / "out")
    assert walls is not None
    # The ends that are found are corners, those of the truth are points of the bar: the lines are compared.
    off = np.abs(_lines(walls.endpoints, true)).max(axis=(0, 2)) / PIXEL
    assert (off < ACROSS).all(), off
    along = np.diff(true[:, ::2], axis=0) - np.diff(walls.endpoints[:, ::2], axis=0)  # of bottom and top
    assert np.abs(along).max() < ALONG * PIXEL, np.abs(along).max(axis=(0, 2)) / PIXEL
    rows = (tmp_path / "out" / "tracked_walls.csv").read_text().splitlines()
    seen = [float(row.rpartition(",")[2]) for row in rows[5:]]  # without the first photograph
    assert np.isnan(seen).all() if thin else min(seen) > 0.5


def _lines(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distances (f, w, 2) [m] of the true ends from the lines that were found."""
    along = found[:, :, 1] - found[:, :, 0]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
    return np.einsum("fwek,fwk->fwe", true - found[:, :, :1], normal)
