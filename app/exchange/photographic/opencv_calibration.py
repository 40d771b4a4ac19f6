"""Lenses as OpenCV calibrates them: its own YAML, XML or JSON files, and arrays that NumPy has stored."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...process.errors import InputError, MissingFileError
from ...solver.bodies.grains import Array

CAMERA = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "mtx", "K", "M1")
DISTORTION = (
    "distortion_coefficients", "Distortion_Coefficients", "dist_coeffs", "distCoeffs", "dist_coeff", "dist", "D", "D1",
)  # fmt: skip
SIZE = ("image_width", "image_Width"), ("image_height", "image_Height")
KNOWN = ("k1", "k2", "p1", "p2", "k3")  # in OpenCV's order; further coefficients belong to other models
SKEW = 1e-6  # of the focal length: pixels whose sides are not at right angles


def read_calibration(file: Path, shape: tuple[int, int] | None = None) -> dict[str, float]:
    """Read the keys of [photographs.lens] from a calibration.

    Parameters
    ----------
    file : Path
        .yml, .yaml, .xml or .json of `cv2.FileStorage`, or .npz, with a camera matrix and distortion coefficients by
        one of the names that OpenCV's samples use.
    shape : tuple of int, optional
        Rows and columns of the photographs, which the calibration must have been made with.

    Returns
    -------
    dict of str to float
        fx, fy, cx, cy [px], k1, k2, p1, p2, k3.

    Raises
    ------
    InputError
        The file is no calibration, or one of another model or of other photographs.
    """
    if not file.is_file():
        raise MissingFileError(file, "", "there is no such file")
    found = _arrays_of_numpy(file) if file.suffix.lower() == ".npz" else _arrays_of_opencv(file)
    matrix = _named(found, CAMERA)
    if matrix is None or matrix.shape != (3, 3):
        raise InputError(file, "", f"holds no camera matrix of three rows and columns, such as {CAMERA[0]}")
    fx, fy, cx, cy = (float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    if not np.isfinite(matrix).all() or not (fx > 0.0 and fy > 0.0) or abs(float(matrix[0, 1])) > SKEW * fx:
        raise InputError(file, "the camera matrix", "is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    width, height = (_named(found, names) for names in SIZE)
    if shape is not None and width is not None and height is not None:
        size = int(width.ravel()[0]), int(height.ravel()[0])
        if size != shape[::-1]:
            raise InputError(
                file, "", f"is of photographs of {size[0]} x {size[1]} px, these are of {shape[1]} x {shape[0]} px"
            )
    distortion = _named(found, DISTORTION)
    values = np.zeros(len(KNOWN)) if distortion is None else np.ravel(distortion)
    if not np.isfinite(values).all() or values[len(KNOWN) :].any():
        raise InputError(file, "the distortion coefficients", f"are more than {', '.join(KNOWN)}: calibrate with these")
    return {
        "fx": fx, "fy": fy, "cx": cx, "cy": cy,
        **{name: float(value) for name, value in zip(KNOWN, values, strict=False)},
    }  # fmt: skip


def _named(arrays: dict[str, Array], names: tuple[str, ...]) -> Array | None:
    return next((arrays[name] for name in names if name in arrays), None)


def _arrays_of_numpy(file: Path) -> dict[str, Array]:
    try:
        with np.load(file, allow_pickle=False) as stored:
            return {name: np.asarray(stored[name], np.float64) for name in stored.files}
    except (OSError, ValueError, KeyError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None


def _arrays_of_opencv(file: Path) -> dict[str, Array]:
    import cv2  # imported late: it takes a tenth of a second

    storage, found = cv2.FileStorage(), {}
    try:
        if not storage.open(str(file), cv2.FILE_STORAGE_READ):
            raise InputError(file, "", "is no YAML, XML or JSON of OpenCV")
        for name in (*CAMERA, *DISTORTION, *SIZE[0], *SIZE[1]):
            node = storage.getNode(name)
            if node.empty() or node.isNone():
                continue
            value = np.array([node.real()]) if node.isReal() or node.isInt() else node.mat()
            if value is not None:
                found[name] = np.asarray(value, np.float64)
    except cv2.error:
        raise InputError(file, "", "is no YAML, XML or JSON of OpenCV") from None
    finally:
        storage.release()
    return found
