"""Images: grey values, channels, rotation, and the part of a photograph that is used."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

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


def rotated(image: Image, rotation: Rotation) -> Image:
    """Return a photograph rotated clockwise by so many degrees."""
    return np.ascontiguousarray(np.rot90(image, -rotation // 90)) if rotation else image
