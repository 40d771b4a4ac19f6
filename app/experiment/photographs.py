"""Photographs as a sequence of grey images, read one at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from ..process.errors import InputError
from .pictures.image import CHANNELS, LUMA, WHOLE_IMAGE, Image, ImageSelection, rotated
from .pictures.image_header import claimed_size
from .pictures.picture_file import MAX_PIXELS, content_of, grey_of, pixels_of, to_grey
from .pictures.png_chunks import is_whole_png
from .reading.input_files import InputFiles
from .reading.photograph_order import in_order
from .reading.photograph_pattern import photographs_of


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
        return cls(photographs_of(folder, pattern, place), source=place)

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

        A PNG holds checksums and is not decoded for this where they are right. Photographs that were read before
        through the same input files are not read again.
        """
        if self._inputs is not None and self.files in self._inputs.intact:
            return
        for frame, file in enumerate(self.files):
            content = content_of(file, self._inputs, self._max_pixels)
            stated = claimed_size(content) if is_whole_png(content) else None
            shape = self.shape if self._selection.rotation in (90, 270) else self.shape[::-1]
            if stated is None or stated != shape:
                self._check_size(frame, grey_of(file, content, self._selection))
        if self._inputs is not None:
            self._inputs.intact.add(self.files)

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, frame: int) -> Image:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._selection.cut(self._check_size(frame, self._read(frame)))

    def _read(self, frame: int) -> Image:
        file = self.files[frame]
        return grey_of(file, content_of(file, self._inputs, self._max_pixels), self._selection)

    def in_channels(self, frame: int) -> dict[str, Image]:
        """Return one photograph in each of CHANNELS, decoded once."""
        file = self.files[frame]
        pixels = pixels_of(file, content_of(file, self._inputs, self._max_pixels))
        names = CHANNELS if pixels.ndim == 3 and pixels.shape[2] > 2 else {"grey": LUMA}
        images = {
            name: self._check_size(frame, rotated(to_grey(file, pixels, weight), self._selection.rotation))
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


def _shape_of(image: Image) -> tuple[int, int]:
    return image.shape[0], image.shape[1]
