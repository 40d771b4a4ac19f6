"""A lens calibrated by OpenCV becomes the keys of [photographs.lens], with its meaning."""

import cv2
import numpy as np
import pytest
from rodsight.exchange.photographic.opencv_calibration import read_calibration
from rodsight.experiment.lens import OpenCVLens
from rodsight.process.errors import InputError

MATRIX = np.array([[1500.0, 0.0, 640.5], [0.0, 1490.0, 361.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([[-0.21, 0.08, 1e-3, -5e-4, 0.01]])


def write(file, matrix=MATRIX, distortion=DISTORTION, size=(1280, 720)):
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", size[0])
    storage.write("image_height", size[1])
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", distortion)
    storage.release()
    return file


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
def test_the_lens_distorts_as_opencv_does(tmp_path, suffix):
    keys = read_calibration(write(tmp_path / f"camera{suffix}"), (720, 1280))
    lens = OpenCVLens(**keys)
    points = np.array([[100.0, 80.0], [640.0, 360.0], [1200.0, 700.0]])
    flat = (points - [MATRIX[0, 2], MATRIX[1, 2]]) / [MATRIX[0, 0], MATRIX[1, 1]]
    expected, _ = cv2.projectPoints(np.column_stack([flat, np.ones(3)]), np.zeros(3), np.zeros(3), MATRIX, DISTORTION)
    np.testing.assert_allclose(lens.distort(points), expected[:, 0], atol=1e-6)


def test_arrays_of_numpy_are_a_calibration(tmp_path):
    np.savez(tmp_path / "camera.npz", mtx=MATRIX, dist=DISTORTION)
    assert read_calibration(tmp_path / "camera.npz") == read_calibration(write(tmp_path / "camera.yml"))


def test_what_is_no_lens_of_these_photographs_is_refused(tmp_path):
    good = write(tmp_path / "good.yml")
    with pytest.raises(InputError, match="1280 x 720 px, these are of 640 x 480 px"):
        read_calibration(good, (480, 640))
    with pytest.raises(InputError, match="are more than k1"):
        read_calibration(write(tmp_path / "more.yml", distortion=np.full((1, 8), 0.1)))
    with pytest.raises(InputError, match="camera matrix"):
        read_calibration(write(tmp_path / "skew.yml", matrix=MATRIX + np.diag([5.0, 5.0], 1)))
    (tmp_path / "text.yml").write_text("nothing: 1\n")
    with pytest.raises(InputError, match=r"is no YAML|holds no camera matrix"):
        read_calibration(tmp_path / "text.yml")
    with pytest.raises(InputError, match="no such file"):
        read_calibration(tmp_path / "none.yml")
