"""Two ids on one rod are refused with file, frame and ids; a jump into another rod is left to the correction."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import rodsight
from rodsight.experiment.coincident_rods import refuse_coincident_rods
from rodsight.experiment.experiment import load_experiment, read_grain_guess
from rodsight.process.errors import InputError

from tests.app.experiment.tables import edit
from tests.app.experiment.test_boundary import in_cell
from tests.program import refuse

R, FRAMES = 0.01, 8
IDS = np.array([10, 11, 12, 13, 14])


def rods_in_a_row() -> np.ndarray:
    x = 2.0 * R * np.arange(len(IDS))
    return np.tile(np.stack([x, np.zeros_like(x)], axis=1), (FRAMES, 1, 1))


def find(position: np.ndarray, radius: float = R, cell: np.ndarray | None = None) -> str:
    try:
        refuse_coincident_rods("tracks.csv", IDS, np.full(len(IDS), radius), position, cell)
    except InputError as error:
        return str(error)
    return ""


def test_the_same_centre_in_one_frame_is_refused():
    position = rods_in_a_row()
    assert find(position) == ""
    position[5, 1] = position[5, 3]
    assert find(position).startswith("tracks.csv: frame 5: grains 11 and 13 have the same centre, (0.06, 0)")


@pytest.mark.parametrize(
    ("frames", "refused"),
    [([4], False), ([2, 4, 6], False), ([3, 4, 5], True), (range(FRAMES), True), ([0, 1, 3, 4, 6], True)],
)
def test_near_centres_are_one_rod_where_they_stay_near(frames, refused):
    position = rods_in_a_row()
    for k in frames:
        position[k, 2] = position[k, 1] + [0.05 * R, 0.0]
    found = find(position)
    assert bool(found) == refused
    if refused:
        assert f"frame {frames[0]}: the centres of grains 11 and 12 are 0.05 of a radius apart" in found
        assert f"in {len(frames)} of the 8 frames" in found


def test_lost_rods_and_radii_in_another_unit_are_no_coincidence():
    position = rods_in_a_row()
    position[2:, 1] = np.nan
    assert find(position) == ""
    assert find(position, radius=1e3 * R) == ""
    assert find(position[:, :1].repeat(5, axis=1))


def test_centres_that_coincide_across_a_periodic_cell_are_refused():
    position, cell = rods_in_a_row(), np.tile(0.2 * np.eye(2), (FRAMES, 1, 1))
    assert find(position, cell=cell) == ""
    position[3, 4] = position[3, 0] + [0.2, -0.2]
    assert find(position) == ""
    assert "frame 3: grains 10 and 14 have the same centre" in find(position, cell=cell)


def test_the_commands_and_python_name_file_frame_and_ids(tracked, tmp_path, capsys):
    poses = pd.read_csv(tracked / "tracks.csv")
    merged = (poses.frame == 2) & (poses.id == 9)
    poses.loc[merged, ["x", "y"]] = poses.loc[(poses.frame == 2) & (poses.id == 8), ["x", "y"]].to_numpy()
    poses.to_csv(tracked / "tracks.csv", index=False)
    words = "tracks.csv: frame 2: grains 8 and 9 have the same centre"
    assert words in refuse(capsys, tmp_path / "out", "run", str(tracked))
    tracks = poses.merge(pd.read_csv(tracked / "grains.csv"), on="id")
    with pytest.raises(rodsight.InputError, match=r"^tracks: frame 2: grains 8 and 9"):
        rodsight.solve(tracks, pd.read_csv(tracked / "walls.csv"))


def test_tables_of_a_cell_are_examined_across_its_edges(tmp_path, capsys):
    folder = in_cell(tmp_path)
    edit(folder / "tracks.csv", "1,5,0.11,0.01,0", "1,5,0.13,0.01,0")  # the cell is 0.12 m wide: rod 0 is at 0.01
    assert "cell.csv: frame 1: grains 0 and 5" in refuse(capsys, tmp_path / "out", "run", str(folder))


def test_two_rods_marked_at_one_place_of_the_first_photograph_are_refused(tmp_path):
    (tmp_path / "experiment.toml").write_text(
        'name = "marked"\n[photographs]\nfiles = "*.png"\npixel_size = 1e-4\ninterval = 30.0\ngrains = "grains.csv"\n'
    )
    (tmp_path / "grains.csv").write_text("id,x,y,radius\n3,100,100,40\n4,180,100,40\n5,101,101,40\n")
    with pytest.raises(InputError, match=r"grains\.csv: frame 0: the centres of grains 3 and 5 are 0\.035 of a radius"):
        read_grain_guess(load_experiment(tmp_path))
