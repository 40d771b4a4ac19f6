"""Films and pictures of a figure over the frames of a run, and the film in a browser."""

from __future__ import annotations

import base64

import cv2
import pytest

from tests.program import rodsight

PLAY = """async source => {
    const video = document.createElement("video");
    document.body.append(video);
    video.muted = true;
    video.src = source;
    video.play();
    return await new Promise(answer => {
        video.onended = () => answer([video.videoWidth, video.videoHeight]);  // played to its end
        video.onerror = () => answer(video.error.message);
    });
}"""


@pytest.mark.thorough
def test_pictures_of_a_figure_have_the_width_that_was_requested(examples, tmp_path, capsys):
    run = str(examples / "runs/shear")
    assert rodsight("export", "pictures", run, "--figure", "forces", "--frames", "3:5", "--out", str(tmp_path)) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["forces_000003.png", "forces_000004.png"]
    picture = cv2.imread(str(tmp_path / "forces_000004.png"))
    assert picture is not None
    assert picture.shape[1] == 1600


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("video", "--figure", "forces", "--frames", "7:9"), "names no frame with forces"),
        (("video", "--figure", "forces", "--frames", "3:5", "--out", "x.avi"), "a film is .mp4 or .webm"),
        (("tables", "--figure", "forces"), "applies to pictures and video only"),
    ],
)
def test_wrong_options_of_films_are_named(examples, options, message, capsys):
    what, *rest = options
    assert rodsight("export", what, str(examples / "runs/shear"), *rest) == 2
    assert message in capsys.readouterr().err


@pytest.mark.screen
@pytest.mark.parametrize("suffix", [pytest.param("mp4", marks=pytest.mark.slow), "webm"])
def test_a_browser_plays_the_film(examples, tmp_path, page, suffix):
    film = tmp_path / f"film.{suffix}"
    run = str(examples / "runs/shear")
    assert rodsight("export", "video", run, "--figure", "forces", "--size", "640x480", "--out", str(film)) == 0
    size = page.evaluate(PLAY, f"data:video/{suffix};base64,{base64.b64encode(film.read_bytes()).decode()}")
    assert size[0] == 640
