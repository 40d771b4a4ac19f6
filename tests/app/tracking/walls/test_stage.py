"""Walls in the tracking stage: their standard deviation is stored, and discs beyond them are no grains."""

from __future__ import annotations

from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from rodsight.experiment.reading.tables import read_table

from tests.app.tracking.photographed import Tracked, track, wall_errors

BEYOND = 140  # [px] of backing added on the right of every photograph
FACTOR = 4.0  # standard deviations that cover every error of few endpoints


def test_sigma_of_tracked_walls_is_stored(followed: Tracked) -> None:
    walls, true = followed.walls, followed.true_walls
    assert walls.sigma is not None
    assert walls.sigma.shape == true.shape[:2]
    assert np.isnan(walls.sigma[0]).all()  # given by the table
    off = np.abs(wall_errors(walls.endpoints, true))[1:].max(axis=-1)
    assert (walls.sigma[1:] > 0.0).all()
    assert (off < FACTOR * walls.sigma[1:]).all()
    assert walls.frames(1, 3).sigma == pytest.approx(walls.sigma[1:3])
    with h5py.File(followed.out / "tracks.h5") as store:
        assert store["walls/sigma"].attrs["unit"] == "m"


def test_a_wall_given_in_a_later_frame_has_no_sigma_there(partly_given: Tracked) -> None:
    walls = partly_given.walls
    assert walls.sigma is not None
    top = walls.name.index("top")
    assert np.isfinite(walls.sigma[:, top]).tolist() == [False, True, False, True]


def test_walls_of_a_table_have_no_sigma(plain: Tracked) -> None:
    assert plain.walls.sigma is None


@pytest.mark.thorough  # many seconds of photographs
def test_discs_beyond_the_walls_are_no_grains(photographed: Path, tmp_path: Path) -> None:
    table = read_table(photographed / "grains.csv", ("id", "radius"))  # of the truth: the experiment detects
    x, y = _add_a_wheel(photographed, float(np.median(table.numbers("radius"))))
    tracks, _ = track(photographed, tmp_path / "with", "--frames", "0:2")
    assert tracks.grain_count == len(table)
    assert np.hypot(*(_found(tmp_path / "with") - (x, y)).T).min() > 20.0
    # Without the walls the disc is found, so the walls exclude it.
    text = (photographed / "experiment.toml").read_text()
    (photographed / "experiment.toml").write_text(_without_walls(text))
    track(photographed, tmp_path / "without", "--frames", "0:2")
    assert np.hypot(*(_found(tmp_path / "without") - (x, y)).T).min() < 1.0


def _add_a_wheel(experiment: Path, radius: float) -> tuple[float, float]:
    """Draw a bright disc on the background on the right of all photographs; returns its centre [px]."""
    x = y = 0.0
    for file in sorted((experiment / "photos").iterdir()):
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        assert image is not None
        wide = np.pad(image, ((0, 0), (0, BEYOND)), constant_values=12)
        x, y = image.shape[1] + 0.5 * BEYOND, 0.5 * image.shape[0]
        cv2.circle(wide, (int(x), int(y)), round(radius), 170, -1, cv2.LINE_AA)
        cv2.imwrite(str(file), wide)
    return x, y


def _found(folder: Path) -> np.ndarray:
    table = read_table(folder / "detections.csv", ("x", "y"))
    return np.column_stack([table.numbers("x"), table.numbers("y")])


def _without_walls(text: str) -> str:
    sections = text.split("\n[")
    return "\n[".join(section for section in sections if not section.startswith("walls"))
