"""Frames of a video become photographs, by their numbers and by time."""

import cv2
import numpy as np
import pytest
from rodsight.exchange.photographic.video_frames import extract_frames, is_video
from rodsight.process.errors import InputError
from rodsight.process.frame_range import FrameRange

RATE, COUNT = 10.0, 25


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Frame k is of grey level 10 k."""
    file = tmp_path_factory.mktemp("video") / "test.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), RATE, (64, 48))
    if not writer.isOpened():
        pytest.skip("this OpenCV writes no Motion JPEG")
    for k in range(COUNT):
        writer.write(np.full((48, 64, 3), 10 * k, np.uint8))
    writer.release()
    return file


def levels(folder):
    return {int(file.stem): cv2.imread(str(file)).mean() for file in sorted(folder.iterdir())}


@pytest.mark.parametrize(
    ("frames", "interval", "numbers", "apart"),
    [
        (FrameRange(), None, range(25), 0.1), (FrameRange(2, 20, 3), None, range(2, 20, 3), 0.3),
        (FrameRange(), 0.5, range(0, 25, 5), 0.5), (FrameRange(4), 0.3, range(4, 25, 3), 0.3),
    ],
)  # fmt: skip
def test_frames_are_chosen_by_number_and_time(video, tmp_path, frames, interval, numbers, apart):
    count, found = extract_frames(video, tmp_path / "photos", frames, interval)
    seen = levels(tmp_path / "photos")
    assert list(seen) == list(numbers)
    assert count == len(seen)
    assert found == pytest.approx(apart, rel=0.05)
    for number, level in seen.items():
        assert level == pytest.approx(10 * number, abs=3.0)


def test_what_cannot_be_extracted_leaves_nothing(video, tmp_path):
    with pytest.raises(InputError, match="chooses none"):
        extract_frames(video, tmp_path / "photos", FrameRange(30, 40))
    text = tmp_path / "text.mp4"
    text.write_text("no video")
    with pytest.raises(InputError, match="no video that can be read"):
        extract_frames(text, tmp_path / "photos")
    with pytest.raises(InputError, match="no such file"):
        extract_frames(tmp_path / "none.mp4", tmp_path / "photos")
    assert not (tmp_path / "photos").exists()
    (tmp_path / "photos").mkdir()
    with pytest.raises(InputError, match="exists already"):
        extract_frames(video, tmp_path / "photos")


def test_videos_are_known_by_their_names():
    assert is_video("a/TEST.MOV")
    assert not is_video("photos/*.png")
