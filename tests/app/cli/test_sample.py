"""The committed sample: checksums, truth, and the accuracy of its forces."""

import hashlib
import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.photographs import Photographs
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.walls import read_walls
from rodsight.recording.viewing.viewer import viewer_binary
from rodsight.synthetic.speckle import RodScene, SpeckleSettings, render_scene

from tests.golden import sample as golden

SAMPLE = Path(__file__).parents[3] / "sample_data" / "shear"
SEED = 12
LEAST_R = 0.90  # of every frame from the fifth on, from photographs
LEAST_MEAN_R = 0.95  # over those frames
# Sensor noise of 2 grey levels, rounding, JPEG of quality 92 (2 more): one rod in a wrong pose exceeds it.
PICTURE_NOISE = 4.0  # [grey levels] rms
BALANCE = 1e-3  # mean |ΣF| of a grain over the mean force; the truth's own check allows 1e-2


def test_the_files_are_those_of_the_checksums():
    listed = (SAMPLE.parent / "shear.sha256").read_text().splitlines()
    assert len(listed) == sum(1 for file in SAMPLE.rglob("*") if file.is_file())
    for line in listed:
        digest, name = line.split(maxsplit=1)
        assert hashlib.sha256((SAMPLE.parent / name).read_bytes()).hexdigest() == digest, name


def test_the_sample_is_small_enough_to_commit():
    assert sum(file.stat().st_size for file in SAMPLE.rglob("*") if file.is_file()) <= 20e6


@pytest.mark.thorough
@pytest.mark.parametrize("frame", [0, 12])
def test_photographs_are_rendered_again_from_the_truth(frame):
    tracks = read_table(SAMPLE / "truth_tracks.csv", ("frame", "id", "x", "y", "theta"))
    here = tracks.integers("frame") == frame
    grains = read_table(SAMPLE / "grains.csv", ("id", "radius"))
    experiment = load_experiment(SAMPLE)
    walls = read_walls(experiment, 24)
    assert walls is not None
    photographs = experiment.photographs()
    height, width = photographs.shape
    scene = render_scene(
        SpeckleSettings(),
        RodScene(
            width=width,
            height=height,
            radius=grains.numbers("radius") * SpeckleSettings().pixel_size,
            position=np.column_stack([tracks.numbers("x")[here], tracks.numbers("y")[here]]),
            rotation=tracks.numbers("theta")[here],
            bars=walls.endpoints[frame],
            pattern_seed=SEED,
        ),
    )
    difference = photographs[frame] - np.clip(scene, 0, 255)
    assert np.sqrt(np.mean(difference**2)) < PICTURE_NOISE
    # Also for every grain, since a mean can hide a single rod.
    blurred = cv2.GaussianBlur(difference**2, (0, 0), 12.0)
    assert np.sqrt(blurred.max()) < 2 * PICTURE_NOISE


def test_the_truth_is_in_equilibrium():
    truth = read_table(SAMPLE / "truth_contacts.csv", ("frame", "i", "j", "fn", "ft"))
    tracks = read_table(SAMPLE / "truth_tracks.csv", ("frame", "id", "x", "y"))
    walls = read_walls(load_experiment(SAMPLE), 24)
    assert walls is not None
    frame, i, fn, ft = truth.integers("frame"), truth.integers("i"), truth.numbers("fn"), truth.numbers("ft")
    other = truth.text("j")
    for k in (0, 11, 12, 23):
        here = tracks.integers("frame") == k
        position = np.column_stack([tracks.numbers("x")[here], tracks.numbers("y")[here]])
        total = np.zeros_like(position)
        for row in np.flatnonzero(frame == k):
            if other[row] in walls.name:
                start, end = walls.endpoints[k, walls.name.index(other[row])]
                along = (end - start) / np.linalg.norm(end - start)
                normal = np.array([along[1], -along[0]])
            else:
                branch = position[int(other[row])] - position[i[row]]
                normal = branch / np.linalg.norm(branch)
            force = fn[row] * normal + ft[row] * np.array([-normal[1], normal[0]])
            total[i[row]] -= force
            if other[row] not in walls.name:
                total[int(other[row])] += force
        assert np.linalg.norm(total, axis=1).mean() < BALANCE * fn[frame == k].mean()


@pytest.mark.thorough
def test_the_sample_gives_accurate_forces_and_a_valid_recording(tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["run", str(SAMPLE), "--out", str(tmp_path / "run"), "--set", golden.SETTING])
    assert stop.value.code == 0
    assert "Against the truth" in capsys.readouterr().out
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    r = np.array(summary["accuracy"]["r_fn"][5:])
    assert r.min() >= LEAST_R
    assert r.mean() >= LEAST_MEAN_R
    assert summary["lost_poses"] == 0
    assert summary["grain_count"] == 250
    changed = {
        name: by for name, by in golden.differences(tmp_path / "run" / "results.h5").items() if by > golden.TOLERANCE
    }
    assert not changed, "the sample's forces are not those of the stored run: see tests/golden/sample.py"
    recording = tmp_path / "run" / "recording.rrd"
    verified = subprocess.run([str(viewer_binary()), "rrd", "verify", str(recording)], capture_output=True, text=True)
    assert verified.returncode == 0, verified.stderr


def test_the_photographs_of_the_sample_are_one_sequence():
    photographs = Photographs.matching(SAMPLE, "photos/*.jpg")
    assert len(photographs) == 24
    photographs.check()
