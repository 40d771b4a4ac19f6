"""Photographs are kept as recordings show them when tracking reads them: none is decoded once more for that."""

from __future__ import annotations

from ..experiment.photographs import Image, Readable
from ..experiment.shown import ShownPhotograph, ShownPhotographs, show
from ..results.checkpoint import Checkpoint


class KeepingPictures:
    """Photographs each of which is kept as it is shown when it is first read."""

    def __init__(self, photographs: Readable[Image], pictures: Checkpoint) -> None:
        self._photographs, self._pictures = photographs, pictures

    def __getitem__(self, frame: int) -> Image:
        image = self._photographs[frame]
        if not self._pictures.has(frame):
            self._pictures.save(frame, show(image))
        return image


class KeptPictures:
    """The photographs of a run's frames as they are shown: as they were kept, or read anew."""

    def __init__(self, photographs: Readable[Image], first: int, pictures: Checkpoint) -> None:
        """photographs: of the whole experiment; first: photograph of the run's frame 0."""
        self._anew, self._first, self._pictures = ShownPhotographs(photographs, first), first, pictures

    def __getitem__(self, frame: int) -> ShownPhotograph:
        kept = self._pictures.find(self._first + frame, ShownPhotograph)
        return self._anew[frame] if kept is None else kept
