"""Pictures of one run for the page: the frame with its marks for the viewer, and the magnified crop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.units import Scale
from ...recording.look.canvas import Canvas
from ...recording.review_layer import Backdrop, Chosen, Marked, ReviewLayer
from ...results.results import Results

Photograph = NDArray[np.uint8]  # (H, W) grey
PhotographSource = Callable[[int], Photograph]

CROP_WIDTH, CROP_HEIGHT = 752, 564  # [px] of the crop as sent: twice its size on the page, for sharp screens
ZOOMS = (4.4, 2.2, 1.0)  # width of the crop in mean grain diameters
NEIGHBOURHOOD = 9.0  # width of the viewer's picture in mean grain diameters
KEPT = 4  # photographs and their pictures


@dataclass(frozen=True, slots=True)
class Window:
    """A part of the photograph [px]; the corner of the first pixel is (0, 0)."""

    left: float
    top: float
    width: float
    height: float


class Picture:
    """Draws the frames of one run."""

    def __init__(self, results: Results, photograph: PhotographSource | None, scale: Scale | None) -> None:
        self.results = results
        shape = None if photograph is None else photograph(0).shape
        around = Canvas.around(results.tracks, scale, (shape[0], shape[1]) if shape else None)
        # The viewer gets the photograph in full: it is judged at its own sharpness.
        self.canvas = Canvas(
            around.scale, 1, *(each * around.shrink for each in (
                around.grain_radius, around.left, around.top, around.right, around.bottom
            ))
        )  # fmt: skip
        self.layer = ReviewLayer(self.canvas)
        self.photograph = lru_cache(KEPT)(photograph) if photograph is not None else None
        self.backdrop = lru_cache(KEPT)(self._backdrop)

    def _backdrop(self, frame: int) -> bytes:
        """Photograph and outlines of a frame, for the viewer."""
        tracks = self.results.tracks
        here = tracks.present[frame]
        image = self.photograph(frame) if self.photograph is not None else None
        return self.layer.backdrop(
            Backdrop(image, tracks.position[frame, here], tracks.radius[here], self.results.walls.outlines(frame))
        )

    def marks(self, marked: Marked, pair: tuple[int, int] | None, frame: int, point: Array | None) -> bytes:
        """Candidates, verdicts and the chosen pair of rows with its contact point, for the viewer."""
        chosen = None
        if pair is not None and point is not None:
            grains = [row for row in pair if row < self.results.grains.count]
            tracks = self.results.tracks
            chosen = Chosen(point, tracks.position[frame, grains], tracks.radius[grains])
        return self.layer.marks(marked, chosen)

    def look(self, point: Array | None, aspect: float) -> bytes:
        """Frame the neighbourhood of a point [m], or the whole packing, in a view of some width over height."""
        canvas = self.canvas
        if point is None:
            return self.layer.look(canvas.left, canvas.top, canvas.width, canvas.height)
        width = NEIGHBOURHOOD * 2.0 * canvas.grain_radius * min(max(aspect, 0.5), 2.0)
        height = width / max(aspect, 1e-3)
        x, y = canvas.points(point)
        return self.layer.look(float(x) - 0.5 * width, float(y) - 0.5 * height, width, height)

    def windows(self, point: Array) -> tuple[Window, ...]:
        """What the crop around a point [m] shows at every zoom."""
        x, y = self.canvas.points(point)
        sides = [2.0 * self.canvas.grain_radius * each for each in ZOOMS]
        ratio = CROP_HEIGHT / CROP_WIDTH
        return tuple(Window(float(x) - 0.5 * side, float(y) - 0.5 * side * ratio, side, side * ratio) for side in sides)

    def crop(self, frame: int, window: Window) -> bytes:
        """The photograph inside a window, magnified, as JPEG; grey beyond its edge and where there is none."""
        picture = np.full((CROP_HEIGHT, CROP_WIDTH), 58, np.uint8)
        if self.photograph is not None:
            zoom = CROP_WIDTH / window.width
            # Pixel centres lie at half numbers on both sides.
            shift = np.array([-window.left, -window.top]) * zoom + 0.5 * zoom - 0.5
            matrix = np.array([[zoom, 0.0, shift[0]], [0.0, zoom, shift[1]]])
            picture = cv2.warpAffine(
                self.photograph(frame), matrix, (CROP_WIDTH, CROP_HEIGHT), flags=cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_CONSTANT, borderValue=(58,),
            )  # fmt: skip
        done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
        assert done
        return data.tobytes()
