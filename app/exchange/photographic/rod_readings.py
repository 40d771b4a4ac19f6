"""Rods of the first photograph as other programs have found them: label images, and tables of ImageJ.

In a label image every rod is a region of pixels with a number of its own, and 0 is background: StarDist, Cellpose and
napari store such images. ImageJ's "Analyze Particles" writes a table of regions.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...experiment.experiment import GrainGuess
from ...process.counts import state_count
from ...process.errors import InputError, MissingFileError
from ...solver.bodies.grains import Array
from ..foreign.foreign_table import column_names, read_foreign

PICTURES = frozenset((".png", ".tif", ".tiff", ".npy"))
OWN = ("id", "x", "y", "radius")
CENTRES = (("XM", "YM"), ("X", "Y"))  # of ImageJ: weighted by brightness, or of the area
LEAST_AREA = 9  # pixels: smaller regions are specks
ROUND = 0.7  # least area of a rod over that of the circle about its extent


def read_rods(file: Path, shape: tuple[int, int]) -> tuple[GrainGuess, list[str]]:
    """Read rods of the first photograph.

    Parameters
    ----------
    file : Path
        A label image (.png, .tif, .npy), a table of ImageJ, or a table id,x,y,radius in pixels.
    shape : tuple of int
        Rows and columns of the photographs.

    Returns
    -------
    GrainGuess
    list of str
        Sentences on what was left out.

    Raises
    ------
    InputError
        The file cannot be read or holds no rods.
    """
    if not file.is_file():
        raise MissingFileError(file, "", "there is no such file")
    if file.suffix.lower() in PICTURES:
        labels = _read_labels(file)
        if labels.shape != shape:
            sizes = [f"{columns} x {rows}" for rows, columns in (labels.shape, shape)]
            raise InputError(file, "", f"is {sizes[0]} pixels, the photographs are {sizes[1]}")
        rods, remarks = rods_of_labels(labels)
        if not len(rods.id) and len(np.unique(labels)) == 2:
            raise InputError(file, "", "has one label for all rods: give each rod a number of its own")
    else:
        rods, remarks = _read_table(file)
        outside = (rods.x < 0.0) | (rods.y < 0.0) | (rods.x > shape[1]) | (rods.y > shape[0])
        if outside.any():
            row = int(np.flatnonzero(outside)[0])
            raise InputError(
                file, f"rod {rods.id[row]}",
                f"at {rods.x[row]:g}, {rods.y[row]:g} lies outside the photograph: lengths must be pixels",
            )  # fmt: skip
    if not len(rods.id):
        raise InputError(file, "", "holds no rods")
    return rods, remarks


def rods_of_labels(labels: NDArray[np.integer]) -> tuple[GrainGuess, list[str]]:
    """Find centre and radius of every round region of a label image (H, W); the others are left out and counted.

    Notes
    -----
    The centre is the mean of a region's pixels, the radius √(A/π) of its area A.
    """
    number, compact = np.unique(labels, return_inverse=True)
    compact = compact.reshape(labels.shape)
    row, column = np.indices(labels.shape)
    area = np.bincount(compact.ravel()).astype(np.float64)
    x = np.bincount(compact.ravel(), column.ravel()) / area
    y = np.bincount(compact.ravel(), row.ravel()) / area
    extent = _greatest_distance(compact, x, y)
    region = number != 0
    speck = region & (area < LEAST_AREA)
    angular = region & ~speck & (area < ROUND * np.pi * extent**2)
    kept = region & ~speck & ~angular
    remarks = [
        f"Left out: {state_count(int(which.sum()), 'region')} of the label image {reason}."
        for which, reason in ((speck, f"with fewer than {LEAST_AREA} pixels"), (angular, "without a round outline"))
        if which.any()
    ]
    radius = np.sqrt(area / np.pi)
    return GrainGuess(number[kept].astype(np.int64), x[kept], y[kept], radius[kept]), remarks


def _greatest_distance(compact: NDArray[np.integer], x: Array, y: Array) -> Array:
    """Greatest distance [px] of a pixel's middle from the centre of its region, plus half a pixel."""
    row, column = np.indices(compact.shape)
    distance = np.hypot(column - x[compact], row - y[compact])
    found = np.zeros(len(x))
    np.maximum.at(found, compact.ravel(), distance.ravel())
    return found + 0.5


def _read_labels(file: Path) -> NDArray[np.integer]:
    if file.suffix.lower() == ".npy":
        try:
            labels = np.load(file, allow_pickle=False)
        except (OSError, ValueError) as error:
            raise InputError(file, "", f"cannot be read ({error})") from None
    else:
        import cv2  # imported late: it takes a tenth of a second

        labels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)
        if labels is None:
            raise InputError(file, "", "is no picture that can be read")
    if labels.ndim != 2 or (labels != np.rint(labels)).any() or labels.min() < 0:
        raise InputError(file, "", "is no label image: one whole number of every pixel is expected, 0 for background")
    return labels.astype(np.int64)


def _read_table(file: Path) -> tuple[GrainGuess, list[str]]:
    names = column_names(file)
    if all(name in names for name in OWN):
        table = read_foreign(file, OWN)
        return GrainGuess(table.integers("id"), *(table.numbers(name) for name in OWN[1:])), []
    centre = next((pair for pair in CENTRES if all(name in names for name in pair)), None)
    if centre is None or not ("Area" in names or {"Major", "Minor"} <= set(names)):
        raise InputError(
            file, "", "is neither a table id,x,y,radius nor one of ImageJ with X, Y and Area "
            f"(columns: {', '.join(name or '(row)' for name in names[:12])})"
        )  # fmt: skip
    size = ("Area",) if "Area" in names else ("Major", "Minor")
    table = read_foreign(file, [*centre, *size], ("Slice",))
    first = np.ones(len(table), np.bool_)
    if "Slice" in names:
        number = table.numbers("Slice")
        first = number == number.min()
    area = table.numbers("Area") if "Area" in names else 0.25 * np.pi * table.numbers("Major") * table.numbers("Minor")
    x, y = (table.numbers(name)[first] - 0.5 for name in centre)  # ImageJ counts from the corner of the first pixel
    remarks = (
        []
        if first.all()
        else [f"Not used, since rods are followed: {state_count(int((~first).sum()), 'row')} of later slices."]
    )
    radius = np.sqrt(area[first] / np.pi)
    return GrainGuess(np.arange(len(x)), x, y, radius), remarks
