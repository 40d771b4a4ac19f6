"""JPEG copies of photographs, stored while tracking reads them, so that recordings need not decode them again."""

from __future__ import annotations

from ..experiment.jpeg_photographs import JpegPhotograph, JpegPhotographs, encode_jpeg
from ..experiment.photographs import Readable
from ..experiment.pictures.image import Image
from ..process.frame_range import FrameRange
from ..results.checkpoint import Checkpoint


class CachingPhotographs:
    """Photographs whose JPEG copies are stored at the first read."""

    def __init__(self, photographs: Readable[Image], pictures: Checkpoint) -> None:
        self._photographs, self._pictures = photographs, pictures

    def __getitem__(self, frame: int) -> Image:
        image = self._photographs[frame]
        if not self._pictures.has(frame):
            self._pictures.save(frame, encode_jpeg(image))
        return image


class CachedPhotographs:
    """JPEG copies of a run's photographs: stored ones, else read again."""

    def __init__(self, photographs: Readable[Image], frames: FrameRange, pictures: Checkpoint) -> None:
        """Take the photographs of the whole experiment and those that the run covers."""
        self._uncached, self._frames, self._pictures = JpegPhotographs(photographs, frames), frames, pictures

    def __getitem__(self, frame: int) -> JpegPhotograph:
        stored = self._pictures.find(self._frames.number(frame), JpegPhotograph)
        return self._uncached[frame] if stored is None else stored
