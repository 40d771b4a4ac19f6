"""Input that a laboratory may not know: rotations, an offset of all radii, the meaning of the ends of walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.process.errors import InputError
from rodsight.tracks import BAR, CORNER, UNSPECIFIED


def edit(folder: Path, name: str, old: str, new: str) -> None:
    file = folder / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def without_rotation(folder: Path) -> None:
    lines = (folder / "tracks.csv").read_text().splitlines()
    (folder / "tracks.csv").write_text("\n".join(line.rsplit(",", 1)[0] for line in lines) + "\n")


def test_rotations_may_be_absent_altogether(tracked) -> None:
    known = read_tracks(load_experiment(tracked))
    without_rotation(tracked)
    tracks = read_tracks(load_experiment(tracked))
    assert np.isnan(tracks.rotation).all()
    assert np.array_equal(tracks.present, known.present)
    assert np.array_equal(tracks.position, known.position)


def test_a_rotation_may_be_empty_in_some_rows(tracked) -> None:
    lines = (tracked / "tracks.csv").read_text().splitlines()
    lines[3] = lines[3].rsplit(",", 1)[0] + ","
    (tracked / "tracks.csv").write_text("\n".join(lines) + "\n")
    tracks = read_tracks(load_experiment(tracked))
    assert np.flatnonzero(np.isnan(tracks.rotation).ravel()).tolist() == [2]
    assert tracks.present.all()


def test_a_rotation_that_is_no_number_is_refused(tracked) -> None:
    lines = (tracked / "tracks.csv").read_text().splitlines()
    lines[3] = lines[3].rsplit(",", 1)[0] + ",inf"
    (tracked / "tracks.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match="row 4, theta = 'inf'"):
        read_tracks(load_experiment(tracked))


def test_a_given_radius_offset_is_added_and_a_too_negative_one_is_refused(tracked) -> None:
    plain = read_tracks(load_experiment(tracked)).radius
    corrected = load_experiment(tracked, ("tracks.radius_offset=1e-4",))
    assert read_tracks(corrected).radius == pytest.approx(plain + 1e-4)
    with pytest.raises(InputError, match="leaves a radius"):
        read_tracks(load_experiment(tracked, ("tracks.radius_offset=-0.02",)))


def test_the_meaning_of_wall_ends_is_given_per_wall(tracked) -> None:
    edit(
        tracked,
        "experiment.toml",
        "[walls.top]\n",
        '[walls.left]\nends = "corner"\n[walls.right]\nends = "bar"\n[walls.top]\n',
    )
    walls = read_walls(load_experiment(tracked), 5)
    assert walls is not None
    assert dict(zip(walls.name, walls.end_kinds.tolist(), strict=True)) == {
        "bottom": UNSPECIFIED, "right": BAR, "top": UNSPECIFIED, "left": CORNER
    }  # fmt: skip
