"""One photograph read from its file: PNG, TIFF, JPEG, or a camera's raw file."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...process.errors import InputError
from ..reading.input_files import InputFiles
from .image import CHANNELS, FULL_SCALE, Channel, Image, ImageSelection, Rotation, rotated
from .image_header import claimed_size, pages_alike

MAX_PIXELS = 200_000_000  # more than any laboratory camera has; .8 GB as float32

# Suffixes of cameras' raw files, which the optional package rawpy reads.
RAW_SUFFIXES = frozenset(
    (".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dng", ".iiq", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".srw")
)


def read_photograph(
    file: Path, inputs: InputFiles | None = None, max_pixels: int = MAX_PIXELS, channel: Channel = "grey"
) -> Image:
    """Read one 8- or 16-bit photograph, grey or colour, as float32 grey (H, W) with full scale 255.

    Cameras' raw files are developed to 16 bits, all alike.

    Parameters
    ----------
    file
        The photograph.
    inputs
        Reads the file and refuses it if it has changed since it was first read.
    max_pixels
        Largest number of pixels that the file's header may state.
    channel
        Channel of a colour photograph to use as grey, one of CHANNELS.

    Raises
    ------
    InputError
        The file is not a photograph, or a raw file without the package that reads it.
    """
    return grey_of(file, content_of(file, inputs, max_pixels), ImageSelection(channel))


def read_levels(file: Path, channel: Channel = "grey", rotation: Rotation = 0) -> NDArray[np.uint8]:
    """Read one photograph at the eight bits (H, W) that a screen shows. Raises InputError as `read_photograph`."""
    pixels = pixels_of(file, content_of(file, None, MAX_PIXELS))
    if pixels.dtype != np.uint8 or pixels.ndim != 2:
        pixels = np.rint(to_grey(file, pixels, CHANNELS[channel])).astype(np.uint8)
    return np.ascontiguousarray(np.rot90(pixels, -rotation // 90)) if rotation else pixels


def grey_of(file: Path, content: bytes, selection: ImageSelection) -> Image:
    return rotated(to_grey(file, pixels_of(file, content), CHANNELS[selection.channel]), selection.rotation)


def pixels_of(file: Path, content: bytes) -> NDArray:
    """Return the pixels of a file with its depth and channels. Raises InputError where it is not a photograph."""
    pixels = _develop(file, content) if file.suffix.lower() in RAW_SUFFIXES else _decode(content)
    if pixels is None:
        raise InputError(file, "", "is not a photograph that can be read (PNG, TIFF or JPEG)")
    return pixels


def content_of(file: Path, inputs: InputFiles | None, max_pixels: int) -> bytes:
    """Return the bytes of a photograph. Raises InputError where they are truncated or state too many pixels."""
    try:
        content = (InputFiles() if inputs is None else inputs).read(file)
    except OSError as error:
        raise InputError(file, "", f"cannot be read: {error.strerror or error}") from None
    if file.suffix.lower() not in RAW_SUFFIXES:
        _refuse_truncated(file, content)
        _refuse_huge(file, content, max_pixels)
        _refuse_stack(file, content)
    return content


def to_grey(file: Path, pixels: NDArray, weight: NDArray[np.float32]) -> Image:
    """Convert blue, green, red or grey (H, W[, c]) of 8 or 16 bits to grey by the weight (3,) of each colour."""
    if pixels.dtype == np.uint8:
        scale = np.float32(1.0)
    elif pixels.dtype == np.uint16:
        scale = np.float32(FULL_SCALE / 65535.0)
    else:
        raise InputError(file, f"depth {pixels.dtype}", "must be 8 or 16 bits per channel")
    if pixels.ndim == 2:
        grey = pixels.astype(np.float32)
    elif pixels.shape[2] <= 2:  # grey, with or without opacity
        grey = pixels[:, :, 0].astype(np.float32)
    else:
        import cv2

        grey = cv2.transform(pixels[:, :, :3].astype(np.float32), weight[None, :])
    if scale != 1.0:
        grey *= scale
    return np.ascontiguousarray(grey, dtype=np.float32)


def _develop(file: Path, content: bytes) -> NDArray:
    """Develop raw data to blue, green, red (H, W, 3) uint16, with the same exposure and colours in every photograph."""
    try:
        import rawpy  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            file, "", "is a camera's raw file: pip install 'rodsight[raw]' reads it, or convert it to 16-bit TIFF"
        ) from None
    try:
        with rawpy.imread(io.BytesIO(content)) as raw:
            # No automatic brightness and no rotation: photographs must stay comparable.
            colours = raw.postprocess(output_bps=16, no_auto_bright=True, use_camera_wb=True, user_flip=0)
    except (rawpy.LibRawError, OSError) as error:
        raise InputError(file, "", f"is not a raw file that can be read ({error})") from None
    return np.ascontiguousarray(colours[:, :, ::-1])


# Standard error belongs to the whole process: two threads that replace it at once would not restore it.
_DECODING = Lock()


def _decode(content: bytes) -> NDArray | None:
    if not content:
        return None
    with _DECODING:
        return _decode_alone(content)


def _decode_alone(content: bytes) -> NDArray | None:
    import cv2  # imported late: given tracks do not need it

    # A decoder's messages would appear on standard error beside the single line of an error.
    log: Any = getattr(cv2.utils, "logging", cv2)  # OpenCV 4 has the same functions in its main module
    level = log.getLogLevel()
    log.setLogLevel(0)
    try:
        with _without_standard_error():
            return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        log.setLogLevel(level)


@contextmanager
def _without_standard_error() -> Iterator[None]:
    """Discard output of C libraries (libpng, libjpeg, libtiff) to standard error inside the block."""
    sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # the process has no standard error
        yield
        return
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def _refuse_truncated(file: Path, content: bytes) -> None:
    """Raise InputError for a truncated PNG or JPEG, whose missing part decoders fill with grey without an error."""
    cut = (content.startswith(b"\x89PNG") and b"IEND" not in content[-64:]) or (
        content.startswith(b"\xff\xd8") and b"\xff\xd9" not in content[-4096:]
    )
    if cut:
        raise InputError(file, f"{len(content)} bytes", "the file is cut short")


def _refuse_stack(file: Path, content: bytes) -> None:
    """Raise InputError for a file of several pictures, of which only the first would be used."""
    pages = pages_alike(content)
    if pages > 1:
        raise InputError(file, "", f"holds {pages} pictures: save each as its own file (ImageJ: Image Sequence)")


def _refuse_huge(file: Path, content: bytes, most: int) -> None:
    """Raise InputError before memory is allocated for more than `most` pixels: a few bytes can state any size."""
    width, height = claimed_size(content) or (0, 0)
    if width * height > most:
        raise InputError(
            file,
            f"{width} x {height} pixels",
            f"is more than photographs.max_pixels = {most}: raise it if this is correct",
        )
