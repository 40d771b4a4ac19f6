"""Photographs as a sequence of grey images, read one at a time."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Generic, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..process.errors import InputError
from .image_header import claimed_size
from .png_chunks import is_whole_png
from .reading.input_files import InputFiles
from .reading.photograph_order import in_order

Image = NDArray[np.float32]

# ITU-R BT.601 luma of blue, green, red: the order of OpenCV's channels.
LUMA = np.array([0.114, 0.587, 0.299], dtype=np.float32)
Channel = Literal["grey", "red", "green", "blue"]
Rotation = Literal[0, 90, 180, 270]
CHANNELS: dict[Channel, NDArray[np.float32]] = {
    "grey": LUMA,
    "red": np.array([0.0, 0.0, 1.0], dtype=np.float32),
    "green": np.array([0.0, 1.0, 0.0], dtype=np.float32),
    "blue": np.array([1.0, 0.0, 0.0], dtype=np.float32),
}

FULL_SCALE = 255.0
MAX_PIXELS = 200_000_000  # more than any laboratory camera has; .8 GB as float32

# Suffixes of cameras' raw files, which the optional package rawpy reads.
RAW_SUFFIXES = frozenset(
    (".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dng", ".iiq", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".srw")
)


@dataclass(frozen=True, slots=True)
class ImageSelection:
    """The channel, the rotation, the region and the mask of a photograph: the part of it that is used."""

    channel: Channel = "grey"
    region: tuple[int, int, int, int] | None = None  # [px] first column and row, last column and row; None: all
    mask: tuple[tuple[tuple[float, float], ...], ...] = ()  # polygons [px] that are not used
    hidden: NDArray[np.bool_] | None = field(default=None, compare=False)  # (H, W) pixels that are not used; None: none
    rotation: Rotation = 0  # [degrees] clockwise, before everything else

    def cut(self, image: Image) -> Image:
        """Return the image with all other pixels set to the median grey of those that are used: they show no edge."""
        if self.region is None and not self.mask and self.hidden is None:
            return image
        used = np.ones(image.shape, np.uint8)
        if self.region is not None:
            left, top, right, bottom = self.region
            used[:] = 0
            used[max(top, 0) : bottom + 1, max(left, 0) : right + 1] = 1
        if self.mask:
            import cv2  # imported late: given tracks do not need it

            corners = [np.rint(np.array(polygon)).astype(np.int32) for polygon in self.mask]
            for each in corners:  # one by one: polygons that overlap would cancel
                cv2.fillPoly(used, [each], 0)
        if self.hidden is not None:
            used[self.hidden] = 0
        seen = used.astype(np.bool_)
        if not seen.any():
            return image
        return np.where(seen, image, np.median(image[seen]).astype(image.dtype))


WHOLE_IMAGE = ImageSelection()


class Photographs(Sequence[Image]):
    """Photographs in natural order (img2 before img10); item k is read from its file on access.

    Every image is float32 (H, W), grey, on a scale where the full scale of the file's depth is 255:
    16-bit files keep all their levels as fractions. Pixels are those stored in the file, rotated
    as the selection states: an orientation tag is not applied, because a camera that looks down
    does not know its own. Raises InputError for no files, an unreadable one, or one of another
    size than the first.
    """

    def __init__(
        self,
        files: Sequence[Path | str],
        *,
        source: Path | str = "photographs",
        inputs: InputFiles | None = None,
        max_pixels: int = MAX_PIXELS,
        selection: ImageSelection = WHOLE_IMAGE,
        ordered: bool = False,
    ) -> None:
        """Check that there are files; ordered: they are taken as they are listed, not by their names."""
        self.files: tuple[Path, ...] = tuple(map(Path, files)) if ordered else in_order(map(Path, files))
        if not self.files:
            raise InputError(source, "", "there are no photographs")
        self._shape: tuple[int, int] | None = None
        self._inputs, self._max_pixels, self._selection = inputs, max_pixels, selection

    @classmethod
    def matching(cls, folder: Path, pattern: str, *, source: Path | str | None = None) -> Photographs:
        """Return the photographs of `folder` whose names match the glob `pattern`, such as "photos/*.png"."""
        place = folder if source is None else source
        try:
            if Path(pattern).is_absolute():
                found = list(Path(Path(pattern).anchor).glob(str(Path(pattern).relative_to(Path(pattern).anchor))))
            else:
                found = list(folder.glob(pattern))
        except ValueError as error:
            raise InputError(place, f"photographs.files = {pattern!r}", str(error)) from None
        except OSError as error:
            if error.errno != errno.ENAMETOOLONG:
                raise
            raise InputError(place, f"photographs.files = {pattern[:60]!r} …", "is too long for a name") from None
        files = [file for file in found if file.is_file()]
        if not files:
            raise InputError(place, f"photographs.files = {pattern!r}", "no file matches")
        return cls(files, source=place)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of every photograph [px]."""
        if self._shape is None:
            self._shape = _shape_of(self._read(0))
            self.check_region(self._shape)
        return self._shape

    def check_region(self, shape: tuple[int, int]) -> None:
        """Raise InputError where the region reaches beyond a photograph of this many rows and columns."""
        region = self._selection.region
        if region is not None and (region[2] >= shape[1] or region[3] >= shape[0]):
            where = f"key photographs.region = {list(region)}"
            raise InputError(self.files[0], where, f"reaches beyond its {shape[1]} x {shape[0]} pixels")

    def check(self) -> None:
        """Read every photograph once, so that a damaged one is reported before any work begins.

        A PNG holds checksums and is not decoded for this where they are right.
        """
        for frame, file in enumerate(self.files):
            content = _content_of(file, self._inputs, self._max_pixels)
            stated = claimed_size(content) if is_whole_png(content) else None
            shape = self.shape if self._selection.rotation in (90, 270) else self.shape[::-1]
            if stated is None or stated != shape:
                self._check_size(frame, _grey_of(file, content, self._selection))

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, frame: int) -> Image:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._selection.cut(self._check_size(frame, self._read(frame)))

    def _read(self, frame: int) -> Image:
        file = self.files[frame]
        return _grey_of(file, _content_of(file, self._inputs, self._max_pixels), self._selection)

    def in_channels(self, frame: int) -> dict[str, Image]:
        """Return one photograph in each of CHANNELS, decoded once."""
        file = self.files[frame]
        pixels = _pixels_of(file, _content_of(file, self._inputs, self._max_pixels))
        names = CHANNELS if pixels.ndim == 3 and pixels.shape[2] > 2 else {"grey": LUMA}
        images = {
            name: self._check_size(frame, rotated(_to_grey(file, pixels, weight), self._selection.rotation))
            for name, weight in names.items()
        }
        return {name: self._selection.cut(images.get(name, images["grey"])) for name in CHANNELS}

    def _check_size(self, frame: int, image: Image) -> Image:
        """Return the image if it has the size of the first one. Raises InputError otherwise."""
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
        """Return photograph `frame` (H, W)."""
        ...


class PrefetchedPhotographs(Generic[P]):
    """Photographs in sequence; a thread reads the next one while the current one is processed.

    Use it as a context manager, which ends the thread.
    """

    def __init__(self, photographs: Readable[P], stop: int) -> None:
        self._photographs, self._stop = photographs, stop
        self._reader = ThreadPoolExecutor(1, "photographs")
        self._next: tuple[int, Future[P]] | None = None

    def __getitem__(self, frame: int) -> P:
        """Return photograph `frame`; errors of reading it are raised here."""
        prefetched, self._next = self._next, None
        image = (
            prefetched[1].result() if prefetched is not None and prefetched[0] == frame else self._photographs[frame]
        )
        if frame + 1 < self._stop:
            self._next = (frame + 1, self._reader.submit(self._photographs.__getitem__, frame + 1))
        return image

    def __enter__(self) -> PrefetchedPhotographs[P]:
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.shutdown(wait=True, cancel_futures=True)


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
    return _grey_of(file, _content_of(file, inputs, max_pixels), ImageSelection(channel))


def rotated(image: Image, rotation: Rotation) -> Image:
    """Return a photograph rotated clockwise by so many degrees."""
    return np.ascontiguousarray(np.rot90(image, -rotation // 90)) if rotation else image


def read_levels(file: Path, channel: Channel = "grey", rotation: Rotation = 0) -> NDArray[np.uint8]:
    """Read one photograph at the eight bits (H, W) that a screen shows. Raises InputError as `read_photograph`."""
    pixels = _pixels_of(file, _content_of(file, None, MAX_PIXELS))
    if pixels.dtype != np.uint8 or pixels.ndim != 2:
        pixels = np.rint(_to_grey(file, pixels, CHANNELS[channel])).astype(np.uint8)
    return np.ascontiguousarray(np.rot90(pixels, -rotation // 90)) if rotation else pixels


def _grey_of(file: Path, content: bytes, selection: ImageSelection) -> Image:
    return rotated(_to_grey(file, _pixels_of(file, content), CHANNELS[selection.channel]), selection.rotation)


def _pixels_of(file: Path, content: bytes) -> NDArray:
    """Return the pixels of a file with its depth and channels. Raises InputError where it is not a photograph."""
    pixels = _develop(file, content) if file.suffix.lower() in RAW_SUFFIXES else _decode(content)
    if pixels is None:
        raise InputError(file, "", "is not a photograph that can be read (PNG, TIFF or JPEG)")
    return pixels


def _content_of(file: Path, inputs: InputFiles | None, max_pixels: int) -> bytes:
    """Return the bytes of a photograph. Raises InputError where they are truncated or state too many pixels."""
    try:
        content = (InputFiles() if inputs is None else inputs).read(file)
    except OSError as error:
        raise InputError(file, "", f"cannot be read: {error.strerror or error}") from None
    if file.suffix.lower() not in RAW_SUFFIXES:
        _refuse_truncated(file, content)
        _refuse_huge(file, content, max_pixels)
    return content


def _to_grey(file: Path, pixels: NDArray, weight: NDArray[np.float32]) -> Image:
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
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(0)
    try:
        with _without_standard_error():
            return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)


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


def _refuse_huge(file: Path, content: bytes, most: int) -> None:
    """Raise InputError before memory is allocated for more than `most` pixels: a few bytes can state any size."""
    width, height = claimed_size(content) or (0, 0)
    if width * height > most:
        raise InputError(
            file,
            f"{width} x {height} pixels",
            f"is more than photographs.max_pixels = {most}: raise it if this is correct",
        )


def _shape_of(image: Image) -> tuple[int, int]:
    return image.shape[0], image.shape[1]
