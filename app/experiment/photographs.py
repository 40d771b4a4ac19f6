"""Photographs: a sequence of grey images, read one at a time."""

from __future__ import annotations

import errno
import io
import os
import re
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .image_header import claimed_size
from .png_chunks import is_whole_png
from .reading.input_files import InputFiles

Image = NDArray[np.float32]

# ITU-R BT.601 luma of blue, green, red: the order in which OpenCV hands out colours.
LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
Channel = Literal["grey", "red", "green", "blue"]
CHANNELS: dict[Channel, NDArray[np.float32]] = {
    "grey": LUMA,
    "red": np.array([0.0, 0.0, 1.0], dtype=np.float32),
    "green": np.array([0.0, 1.0, 0.0], dtype=np.float32),
    "blue": np.array([1.0, 0.0, 0.0], dtype=np.float32),
}

FULL_SCALE = 255.0
MAX_PIXELS = 200_000_000  # beyond any camera in a laboratory; as float32 it takes .8 GB

# What cameras call the data of their sensor; read with the optional package rawpy.
RAW_SUFFIXES = frozenset(
    (".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dng", ".iiq", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".srw")
)


@dataclass(frozen=True, slots=True)
class Look:
    """What of a photograph is looked at."""

    channel: Channel = "grey"
    region: tuple[int, int, int, int] | None = None  # [px] first and last column and row; None: all of it

    def cut(self, image: Image) -> Image:
        """The image with everything outside the region as its middle grey, so that nothing is found there."""
        if self.region is None:
            return image
        left, top, right, bottom = self.region
        inside = np.s_[max(top, 0) : bottom + 1, max(left, 0) : right + 1]
        cut = np.full_like(image, np.median(image[inside]))
        cut[inside] = image[inside]
        return cut


EVERYTHING = Look()


class Photographs(Sequence[Image]):
    """Photographs in natural order (img2 before img10); item k is read from its file when it is asked for.

    Every image is float32 (H, W), grey, on a scale where the full scale of the file's depth is 255:
    16-bit files keep all their levels as fractions. Pixels are those stored in the file: an
    orientation tag is not applied. Raises InputError for no files, an unreadable one, or one of
    another size than the first.
    """

    def __init__(
        self,
        files: Sequence[Path | str],
        *,
        source: Path | str = "photographs",
        inputs: InputFiles | None = None,
        max_pixels: int = MAX_PIXELS,
        look: Look = EVERYTHING,
    ) -> None:
        self.files: tuple[Path, ...] = tuple(sorted((Path(file) for file in files), key=natural_key))
        if not self.files:
            raise InputError(source, "", "there are no photographs")
        self._shape: tuple[int, int] | None = None
        self._inputs, self._max_pixels, self._look = inputs, max_pixels, look

    @classmethod
    def matching(cls, folder: Path, pattern: str, *, source: Path | str | None = None) -> Photographs:
        """The files of `folder` that match the glob `pattern`, such as "photos/*.png"."""
        whose = folder if source is None else source
        try:
            if Path(pattern).is_absolute():
                found = list(Path(Path(pattern).anchor).glob(str(Path(pattern).relative_to(Path(pattern).anchor))))
            else:
                found = list(folder.glob(pattern))
        except ValueError as error:
            raise InputError(whose, f"photographs.files = {pattern!r}", str(error)) from None
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
            raise InputError(whose, f"photographs.files = {pattern[:60]!r} …", "is too long for a name") from None
        files = [file for file in found if file.is_file()]
        if not files:
            raise InputError(whose, f"photographs.files = {pattern!r}", "no file matches")
        return cls(files, source=whose)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of every photograph [px]."""
        if self._shape is None:
            self._shape = _shape_of(read_photograph(self.files[0], self._inputs, self._max_pixels, self._look.channel))
            self.check_region(self._shape)
        return self._shape

    def check_region(self, shape: tuple[int, int]) -> None:
        """Raise InputError where the region reaches beyond a photograph of this many rows and columns."""
        region = self._look.region
        if region is not None and (region[2] >= shape[1] or region[3] >= shape[0]):
            what = f"key photographs.region = {list(region)}"
            raise InputError(self.files[0], what, f"reaches beyond its {shape[1]} x {shape[0]} pixels")

    def check(self) -> None:
        """Look through every photograph once, so that a bad one is known before any work begins.

        A PNG carries checksums: one that is whole is not decoded for this.
        """
        for frame, file in enumerate(self.files):
            content = _content_of(file, self._inputs, self._max_pixels)
            told = claimed_size(content) if is_whole_png(content) else None
            if told is None or told != self.shape[::-1]:
                self._of_one_size(frame, _grey_of(file, content, self._look.channel))

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, frame: int) -> Image:  # pyright: ignore[reportIncompatibleMethodOverride]
        image = read_photograph(self.files[frame], self._inputs, self._max_pixels, self._look.channel)
        return self._look.cut(self._of_one_size(frame, image))

    def in_channels(self, frame: int) -> dict[str, Image]:
        """One photograph in each of CHANNELS, decoded once."""
        file = self.files[frame]
        pixels = _pixels_of(file, _content_of(file, self._inputs, self._max_pixels))
        names = CHANNELS if pixels.ndim == 3 and pixels.shape[2] > 2 else {"grey": LUMA}
        images = {name: self._of_one_size(frame, _to_grey(file, pixels, weight)) for name, weight in names.items()}
        return {name: self._look.cut(images.get(name, images["grey"])) for name in CHANNELS}

    def _of_one_size(self, frame: int, image: Image) -> Image:
        """The image, if it has the size of the first. Raises InputError."""
        file = self.files[frame]
        if self._shape is None and file == self.files[0]:
            self._shape = _shape_of(image)
            self.check_region(self._shape)
        height, width = self.shape
        if image.shape != (height, width):
            raise InputError(
                file,
                f"photograph {range(len(self))[frame]}",
                f"is {image.shape[1]} x {image.shape[0]} pixels, the first photograph {width} x {height}",
            )
        return image

    def __iter__(self) -> Iterator[Image]:
        for frame in range(len(self)):
            yield self[frame]


P = TypeVar("P", covariant=True)


class Readable(Protocol[P]):
    def __getitem__(self, frame: int, /) -> P:
        """Photograph `frame` (H, W)."""
        ...


class ReadAhead(Generic[P]):
    """Photographs that are asked for one after the other: the next is read while one is worked at.

    To be closed, or used as a context: the thread ends with it.
    """

    def __init__(self, photographs: Readable[P], stop: int) -> None:
        self._photographs, self._stop = photographs, stop
        self._reader = ThreadPoolExecutor(1, "photographs")
        self._coming: tuple[int, Future[P]] | None = None

    def __getitem__(self, frame: int) -> P:
        """Photograph `frame`; what reading it raised is raised here."""
        coming, self._coming = self._coming, None
        image = coming[1].result() if coming is not None and coming[0] == frame else self._photographs[frame]
        if frame + 1 < self._stop:
            self._coming = (frame + 1, self._reader.submit(self._photographs.__getitem__, frame + 1))
        return image

    def __enter__(self) -> ReadAhead[P]:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.shutdown(wait=True, cancel_futures=True)


def natural_key(file: Path) -> tuple[tuple[tuple[int, int | str], ...], str]:
    """Sort key in which numbers count as numbers: img2 before img10."""
    parts = re.split(r"(\d+)", file.as_posix())
    return tuple((0, int(part)) if part.isdecimal() else (1, part.lower()) for part in parts), file.as_posix()


def read_photograph(
    file: Path, inputs: InputFiles | None = None, max_pixels: int = MAX_PIXELS, channel: Channel = "grey"
) -> Image:
    """Read one 8- or 16-bit photograph, grey or colour, as float32 grey (H, W) with full scale 255.

    channel: of CHANNELS, what of a colour photograph is taken for grey.

    Raw files of cameras are developed to 16 bits, all alike. inputs: what the file is read by, where it has to stay
    what it is; max_pixels: that it may claim to have. Raises InputError for what is not a photograph, and for
    raw files while the package that reads them is not installed.
    """
    return _grey_of(file, _content_of(file, inputs, max_pixels), channel)


def _grey_of(file: Path, content: bytes, channel: Channel) -> Image:
    return _to_grey(file, _pixels_of(file, content), CHANNELS[channel])


def _pixels_of(file: Path, content: bytes) -> NDArray:
    """The pixels of a file, of whatever depth and number of channels. Raises InputError where it holds none."""
    pixels = _develop(file, content) if file.suffix.lower() in RAW_SUFFIXES else _decode(content)
    if pixels is None:
        raise InputError(file, "", "is not a photograph that can be read (PNG, TIFF or JPEG)")
    return pixels


def _content_of(file: Path, inputs: InputFiles | None, max_pixels: int) -> bytes:
    """The bytes of a photograph; raises InputError where they are cut short or claim too many pixels."""
    try:
        content = (InputFiles() if inputs is None else inputs).read(file)
    except OSError as error:
        raise InputError(file, "", f"cannot be read: {error.strerror or error}") from None
    if file.suffix.lower() not in RAW_SUFFIXES:
        _refuse_truncated(file, content)
        _refuse_huge(file, content, max_pixels)
    return content


def _to_grey(file: Path, pixels: NDArray, weight: NDArray[np.float32]) -> Image:
    """Blue, green, red or grey (H, W[, c]) of either depth to grey, by the weight (3,) of each colour."""
    if pixels.dtype == np.uint8:
        scale = np.float32(1.0)
    elif pixels.dtype == np.uint16:
        scale = np.float32(FULL_SCALE / 65535.0)
    else:
        raise InputError(file, f"depth {pixels.dtype}", "must be 8 or 16 bits per channel")
    if pixels.ndim == 2:
        grey = pixels.astype(np.float32)
    elif pixels.shape[2] <= 2:  # grey, with or without an opacity
        grey = pixels[:, :, 0].astype(np.float32)
    else:
        import cv2

        grey = cv2.transform(pixels[:, :, :3].astype(np.float32), weight[None, :])
    if scale != 1.0:
        grey *= scale
    return np.ascontiguousarray(grey, dtype=np.float32)


def _develop(file: Path, content: bytes) -> NDArray:
    """The sensor's data as blue, green, red (H, W, 3) uint16, exposed and coloured alike in every photograph."""
    try:
        import rawpy  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            file, "", "is a camera's raw file: pip install 'rodsight[raw]' reads it, or convert it to 16-bit TIFF"
        ) from None
    try:
        with rawpy.imread(io.BytesIO(content)) as raw:
            # No brightening by the picture's own content, and no turning: photographs must stay comparable.
            colours = raw.postprocess(output_bps=16, no_auto_bright=True, use_camera_wb=True, user_flip=0)
    except (rawpy.LibRawError, OSError) as error:
        raise InputError(file, "", f"is not a raw file that can be read ({error})") from None
    return np.ascontiguousarray(colours[:, :, ::-1])


# Standard error belongs to the whole process: two threads that set it aside would not both put it back.
_DECODING = Lock()


def _decode(content: bytes) -> NDArray | None:
    if not content:
        return None
    with _DECODING:
        return _decode_alone(content)


def _decode_alone(content: bytes) -> NDArray | None:
    import cv2  # not where there are tracks

    # A decoder's complaints would reach standard error beside our own single line.
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(0)
    try:
        with _silenced():
            return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)


@contextmanager
def _silenced() -> Iterator[None]:
    """Keep what C libraries write to standard error by themselves off the screen: libpng, libjpeg and libtiff do."""
    sys.stderr.flush()
    try:
        kept = os.dup(2)
    except OSError:  # there is none
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _refuse_truncated(file: Path, content: bytes) -> None:
    """Decoders fill the missing part of a cut PNG or JPEG with grey and call it a success."""
    cut = (content.startswith(b"\x89PNG") and b"IEND" not in content[-64:]) or (
        content.startswith(b"\xff\xd8") and b"\xff\xd9" not in content[-4096:]
    )
    if cut:
        raise InputError(file, f"{len(content)} bytes", "the file is cut short")


def _refuse_huge(file: Path, content: bytes, most: int) -> None:
    """A few bytes may claim any size: what is not believed is not allocated."""
    width, height = claimed_size(content) or (0, 0)
    if width * height > most:
        raise InputError(
            file,
            f"{width} x {height} pixels",
            f"is more than photographs.max_pixels = {most}: raise it if that is true",
        )


def _shape_of(image: Image) -> tuple[int, int]:
    return image.shape[0], image.shape[1]
