"""An experiment is set up from flags as from the page; what fails leaves nothing behind."""

import cv2
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment

from tests.program import rodsight


@pytest.fixture
def folder(photographs_only):
    return photographs_only / "my photographs"


def test_what_is_wrong_is_told_in_one_line_and_leaves_nothing(folder, capsys):
    flags = ("--photographs", "pictures/*.jpg", "--interval", "30", "--pixel-size", "2.5e-4")
    for wrong, named in (
        (("--pixel-size", "-1"), "pixel_size"), (("--photographs", "none/*.jpg"), "no file matches"),
        (("--friction", "slippery"), "material.friction"), (("--pressure", "top"), "WALL=PASCAL"),
        (("--radii", "7mm"), "--radii"), (("--interval", "0"), "interval"),
    ):  # fmt: skip
        assert rodsight("init", folder, *flags, *wrong) == 2, wrong
        told = capsys.readouterr().err
        assert named in told
        assert told.count("\n") == 1
        assert [each.name for each in folder.iterdir()] == ["pictures"], wrong


def test_an_experiment_that_is_there_is_not_overwritten(folder, capsys):
    file = folder / "experiment.toml"
    file.write_text("name = 'mine'\n")
    assert rodsight("init", folder, "--photographs", "pictures/*.jpg") == 2
    assert "is there already" in capsys.readouterr().err
    assert file.read_text() == "name = 'mine'\n"


@pytest.mark.screen
def test_flags_make_an_experiment_and_a_picture_of_what_was_understood(folder, made_photographs):
    section = load_experiment(made_photographs).config.photographs
    radii = ",".join(str(radius) for radius in section.radii)
    status = rodsight(
        "init", folder, "--photographs", "pictures/*.jpg", "--interval", 30, "--pixel-size", section.pixel_size,
        "--radii", radii, "--pressure", "top=50e3", "--friction", "measured", "--quiet",
    )  # fmt: skip
    assert status == 0
    made = load_experiment(folder).config
    assert made.walls.plates["top"].pressure == 50e3
    assert made.material.friction == "measured"
    assert rodsight("check", folder, "--quiet") == 0
    picture = cv2.imread(str(folder / "understood.png"))
    colourful = np.ptp(picture.astype(int), axis=2) > 60
    assert colourful.mean() > 0.01
