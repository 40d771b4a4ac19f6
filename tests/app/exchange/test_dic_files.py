from __future__ import annotations

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.exchange.dic_files import read_sequence, write_sequence
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.units import Scale
from rodsight.process.errors import InputError

SCALE = Scale(1.2e-4, 4000)
ROUNDING = 1e-9  # px


def test_written_tracks_are_read_back(results, tmp_path):
    write_sequence(results.tracks, SCALE, tmp_path)
    found = read_sequence(tmp_path)
    pixels = SCALE.to_pixels(results.tracks.position)
    assert np.allclose(found.x, pixels[..., 0], atol=ROUNDING)
    assert np.allclose(found.y, pixels[..., 1], atol=ROUNDING)
    assert np.allclose(found.rotation, results.tracks.rotation, atol=ROUNDING)
    assert np.allclose(found.radius * SCALE.pixel_size, results.tracks.radius)


def test_y_points_down_and_rotation_is_counter_clockwise_as_seen(results, tmp_path):
    write_sequence(results.tracks, SCALE, tmp_path)
    first = np.loadtxt(tmp_path / "dic_out_0.txt", skiprows=1)
    later = np.loadtxt(tmp_path / "dic_out_3.txt", skiprows=1)
    assert first.shape[1] == 13
    assert np.array_equal(first[:, :2], np.rint(first[:, :2]))
    up = results.tracks.position[3, :, 1] - results.tracks.position[0, :, 1]
    assert np.allclose(later[:, 5] - first[:, 5], -up / SCALE.pixel_size, atol=ROUNDING)
    rotation = results.tracks.rotation[3] - results.tracks.rotation[0]
    assert np.allclose(later[:, 6], rotation, atol=ROUNDING)
    step = results.tracks.position[3] - results.tracks.position[2]
    assert np.allclose(later[:, 7], step[:, 0] / SCALE.pixel_size, atol=ROUNDING)


def test_a_lost_grain_is_read_back_as_lost(with_a_loss, tmp_path):
    write_sequence(with_a_loss.tracks, SCALE, tmp_path)
    found = read_sequence(tmp_path)
    assert np.argwhere(np.isnan(found.x)).tolist() == [[2, 3], [3, 3]]


def test_imported_files_are_an_experiment(with_a_loss, tmp_path, capsys):
    write_sequence(with_a_loss.tracks, SCALE, tmp_path / "dic")
    folder = tmp_path / "imported"
    arguments = ["import", "dic", str(tmp_path / "dic"), str(folder), "--pixel-size", "1.2e-4", "--interval", "30"]
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--height", "4000"])
    assert not end.value.code
    assert "2 poses lost" in capsys.readouterr().out
    tracks = read_tracks(load_experiment(folder))
    assert np.allclose(tracks.position, with_a_loss.tracks.position, atol=1e-12, equal_nan=True)
    assert np.allclose(tracks.rotation, with_a_loss.tracks.rotation, atol=1e-12, equal_nan=True)
    assert tracks.time.tolist() == [0.0, 30.0, 60.0, 90.0, 120.0]
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "already exists" in capsys.readouterr().err


def test_configurations_are_read_and_markers_are_not_grains(tmp_path):
    rows = ["4", "100.5 200 0.1 30", "160 200 0 30", "0 0 0 1", "10 10 0 2", "#CORNERS", "0 0 9 9", "#FIX_PTS"]
    (tmp_path / "CONF0001").write_text("\n".join(rows))
    (tmp_path / "CONF0002").write_text("\n".join(rows).replace("100.5", "101.5"))
    found = read_sequence(tmp_path)
    assert found.number == (1, 2)
    assert found.x.tolist() == [[100.5, 160.0], [101.5, 160.0]]
    assert found.row.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is not the number of grains"),
        ("three\n", "is not the number of grains"),
        ("2\n1 2 3 4\n", "states 2 grains"),
        ("1\n1 2 3\n", "has 3 numbers"),
        ("1\n1 2 x 9\n", "is not 4 numbers"),
        ("1\n1 2 nan 9\n", "not finite"),
        ("1\n1 2 0 2\n", "no grain"),
    ],
)
def test_damaged_files_are_named(tmp_path, text, problem):
    (tmp_path / "CONF0000").write_text(text)
    with pytest.raises(InputError, match=problem) as error:
        read_sequence(tmp_path)
    assert "CONF0000" in str(error.value)


def test_inconsistent_files_are_refused(tmp_path):
    (tmp_path / "CONF0000").write_text("1\n1 2 0 9\n")
    (tmp_path / "CONF0001").write_text("1\n1 2 0 8\n")
    with pytest.raises(InputError, match="radius 8"):
        read_sequence(tmp_path)
    with pytest.raises(InputError, match="neither"):
        read_sequence(tmp_path / "nowhere")
