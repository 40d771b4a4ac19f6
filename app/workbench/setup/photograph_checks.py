"""Faults of photographs that are seen without decoding them: damaged files, sizes, numbers, cameras' notes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...experiment.pictures.image_header import claimed_size
from ...experiment.reading.camera_notes import camera_times, noted_rotation
from ...experiment.reading.photograph_order import MissingNumbers

HEADER = 1 << 18  # bytes of a photograph that contain its size
LISTED = 5  # photographs that are named
SIGNATURES = {
    ".png": b"\x89PNG", ".jpg": b"\xff\xd8", ".jpeg": b"\xff\xd8", ".tif": b"II*\0", ".tiff": b"MM\0*",
}  # fmt: skip
PNG_END, JPEG_END, JPEG_TRAILER = b"IEND", b"\xff\xd9", 4096  # some cameras write bytes after the end


def unusable(files: Sequence[Path], shape: tuple[int, int]) -> dict[int, str]:
    """Return, by their numbers, the photographs that cannot be used, each with the reason.

    Parameters
    ----------
    files : sequence of Path
        The photographs in their order.
    shape : tuple of int
        Rows and columns [px] of the first one, as it is stored.
    """
    rows, columns = shape
    found = {}
    for k, file in enumerate(files):
        fault, size = _inspect(file)
        if not fault and size is not None and size != (columns, rows):
            fault = f"is {size[0]} x {size[1]} pixels, the first photograph {columns} x {rows}"
        if fault:
            found[k] = fault
    return found


def _inspect(file: Path) -> tuple[str, tuple[int, int] | None]:
    try:
        stat = file.stat()
        return _fault_and_size(file, stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        return f"cannot be read ({error.strerror or error})", None


@lru_cache(maxsize=20_000)
def _fault_and_size(file: Path, _changed: int, size: int) -> tuple[str, tuple[int, int] | None]:
    """The fault of a file (empty: none is seen) and its width and height; read once as long as it is the same."""
    if file.suffix.lower() not in SIGNATURES:
        return "", None
    with file.open("rb") as stream:
        head = stream.read(HEADER)
        stream.seek(max(size - JPEG_TRAILER, 0))
        tail = stream.read()
    if not head:
        return "is an empty file", None
    if not head.startswith(tuple(SIGNATURES.values())):
        return "is not a photograph that can be read (PNG, TIFF or JPEG)", None
    claimed = claimed_size(head)  # None: a TIFF's may stand at its end
    cut = (head.startswith(b"\x89PNG") and PNG_END not in tail[-64:]) or (
        head.startswith(b"\xff\xd8") and JPEG_END not in tail
    )
    return "is cut short" if cut else "", claimed


def name_missing(missing: Sequence[MissingNumbers]) -> list[str]:
    """State the numbers that are missing between photographs."""
    stated = [
        f"{'A number is' if each.count == 1 else f'{each.count} numbers are'} missing between {each.after.name} and "
        f"{each.before.name}: a photograph that was lost? The time between these two is taken as one interval."
        for each in missing[:LISTED]
    ]
    return [*stated, f"Numbers are missing at {len(missing) - LISTED} more places."] if missing[LISTED:] else stated


def name_fractions(files: Sequence[Path]) -> list[str]:
    """State that names with decimal numbers are not in the order of these numbers: 0.5 stands before 0.25."""
    names = [re.fullmatch(r"(\D*)(\d+)\.(\d+)(\D*)", file.stem) for file in files]
    if len({(name[1], name[4]) if name else None for name in names}) != 1 or names[0] is None:
        return []
    values = [float(f"{name[2]}.{name[3]}") for name in names if name]
    later = next((k for k, (one, two) in enumerate(pairwise(values)) if one > two), None)
    if later is None:
        return []
    return [
        f"{files[later].name} stands before {files[later + 1].name}: parts of names are compared as whole numbers. If "
        "they are decimal numbers, write them with as many digits each, or order the photographs by rodsight open."
    ]


def compare_with_camera(files: Sequence[Path], rotation: int, interval: float | None) -> list[str]:
    """State where the camera's notes contradict the order, the interval or the rotation of the photographs."""
    stated = []
    times = camera_times(files)
    if times is not None and len(files) > 1:
        steps = np.diff(times)
        back = np.flatnonzero(steps < 0.0)
        if len(back):
            k = int(back[0])
            stated.append(
                f"By the camera's clock {files[k + 1].name} was taken before {files[k].name}, which stands before it."
            )
        elif interval is not None and (usual := float(np.median(steps))) > 1.0 and not 0.5 < usual / interval < 2.0:
            stated.append(f"By the camera's clock there are {usual:g} s between photographs, not {interval:g} s.")
    noted = noted_rotation(files)
    if noted is None:
        words = "differ: it looked down, or was moved. Look at the photographs"
        stated.append(f"The camera's notes on how it was held {words}; the pixels are used as they are stored.")
    elif noted != rotation and noted:
        stated.append(f"The camera notes that the photographs stand upright when rotated by {noted}° clockwise.")
    return stated
