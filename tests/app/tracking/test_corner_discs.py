"""Corner discs that a table gives in the first photograph alone are found in the others, with the bars between them."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT, circle_parameters
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize
from rodsight.tracking.stage import track_first
from rodsight.tracks import WallTracks

pytestmark = pytest.mark.screen

FRAMES, STEP = 3, 0.5  # [°] of shear: the discs of the plate move by 1 mm a photograph
CLICK = np.array([1.2e-4, -1.0e-4])  # [m] error of a click, nearly a pixel
ACCURACY = 2.5e-5  # [m], a sixth of a pixel: rims are hidden where the bars begin


@pytest.fixture(scope="module")
def apparatus(tmp_path_factory) -> Path:
    """Write an apparatus whose corners are given in the first photograph, as clicked."""
    folder = tmp_path_factory.mktemp("corners") / "apparatus"
    synthesize(folder, SynthesisSettings(preset="1g2e", seed=2, grains=24, frames=FRAMES, step_degrees=STEP))
    return folder


def true_centres(folder: Path) -> dict[tuple[int, str], np.ndarray]:
    with (folder / "corners.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {(int(row["frame"]), row["corner"]): np.array([float(row["x"]), float(row["y"])]) for row in rows}


def track(folder: Path, keep: str = "") -> tuple[WallTracks, dict[tuple[int, str], np.ndarray]]:
    """Track with the first photograph's corners, displaced by CLICK, and all rows of the corner `keep`."""
    true = true_centres(folder)
    rows = [
        (frame, corner, *(at + (CLICK if corner != keep else 0.0)), 0.0206)
        for (frame, corner), at in true.items()
        if frame == 0 or corner == keep
    ]
    text = "\n".join(",".join(map(str, row)) for row in [("frame", "corner", "x", "y", "radius"), *rows])
    given = folder / "corners.csv"
    former = given.read_text(encoding="utf-8")
    try:
        given.write_text(text + "\n", encoding="utf-8")
        _, walls = track_first(load_experiment(folder), FRAMES)
    finally:
        given.write_text(former, encoding="utf-8")
    assert walls is not None
    return walls, true


def test_discs_are_centred_on_their_rims_and_followed_with_their_bars(apparatus):
    walls, true = track(apparatus)
    centre, radius, angle = circle_parameters(walls.endpoints)
    for w in np.flatnonzero(walls.sides == OUT).tolist():
        expected = np.array([true[k, walls.name[w]] for k in range(FRAMES)])
        assert np.linalg.norm(centre[:, w] - expected, axis=1).max() < ACCURACY
        np.testing.assert_allclose(radius[:, w], 0.0206, rtol=1e-9)
        assert np.abs(angle[:, w]).max() < 2e-3
        assert walls.sigma is not None
        assert 0.0 < walls.sigma[1, w] < 1e-5
    ends = walls.endpoints[:, walls.sides == STRAIGHT]
    apart = np.linalg.norm(ends[:, :, :, None] - centre[:, None, None, walls.sides == OUT], axis=-1)
    assert apart.min(axis=-1).max() < 1e-9  # every bar runs from centre to centre, in every photograph
    assert set(np.array(walls.name)[walls.sides == STRAIGHT]) == {"bottom", "right", "top", "left"}


def test_bars_of_a_table_are_followed_beside_the_discs(apparatus):
    true = true_centres(apparatus)
    around = ("bottom-left", "bottom-right", "top-right", "top-left")
    names = ("bottom", "right", "top", "left")
    ends = {name: (around[k], around[(k + 1) % 4]) for k, name in enumerate(names)}
    rows = [(0, name, *true[0, first], *true[0, second]) for name, (first, second) in ends.items()]
    bars, described = apparatus / "bars.csv", apparatus / "experiment.toml"
    text = described.read_text(encoding="utf-8")
    try:
        bars.write_text(
            "\n".join(",".join(map(str, row)) for row in [("frame", "wall", "x1", "y1", "x2", "y2"), *rows]) + "\n",
            encoding="utf-8",
        )
        described.write_text(text.replace("[walls]\n", '[walls]\nfile = "bars.csv"\n'), encoding="utf-8")
        walls, _ = track(apparatus)
    finally:
        described.write_text(text, encoding="utf-8")
        bars.unlink()
    for name, (first, second) in ends.items():
        found = walls.endpoints[:, walls.name.index(name)]
        along = found[:, 1] - found[:, 0]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        for k in range(FRAMES):
            away = [abs(float(normal[k] @ (true[k, disc] - found[k, 0]))) for disc in (first, second)]
            assert max(away) < ACCURACY, (name, k)


def test_a_corner_given_in_every_photograph_stays_as_given(apparatus):
    walls, true = track(apparatus, keep="top-left")
    centre, _, _ = circle_parameters(walls.endpoints)
    w = walls.name.index("top-left")
    expected = np.array([true[k, "top-left"] for k in range(FRAMES)])
    np.testing.assert_allclose(centre[1:, w], expected[1:], atol=1e-9)
