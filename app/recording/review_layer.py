"""The picture of the review page: one frame's photograph, outlines, candidates and verdicts, as .rrd bytes.

Everything is static, so that what is sent later replaces what was sent before: a verdict is a few kilobytes and
shows at once, and the viewer keeps one photograph, never all.
"""

from __future__ import annotations

import math
import uuid
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from solver.bodies.grains import Array

from .look.canvas import Canvas
from .look.colours import packed_one

APPLICATION_ID = "rodsight_review"
PHOTOGRAPH, GRAINS, WALLS = "/photograph", "/grains", "/walls"
CANDIDATES, MARKS, STROKES, SELECTION, PARTNERS = (
    "/candidates", "/verdicts", "/verdicts/strokes", "/selection", "/selection/bodies",
)  # fmt: skip
JPEG_QUALITY = 92

# Verdicts differ in shape as well as colour. Okabe & Ito's colours, made brighter for a dark ground.
UNDETECTED, DETECTED, HIDDEN, CONTACT, NO_CONTACT, UNSURE = range(6)
COLOURS = (
    (255, 176, 32, 255), (92, 190, 255, 255), (208, 212, 220, 255), (40, 224, 150, 255), (255, 84, 130, 255),
    (246, 232, 84, 255),
)  # fmt: skip
_OUTLINE, _WALL, _CHOSEN, _HALO = (206, 212, 224, 110), (206, 212, 224, 190), (255, 255, 255, 255), (0, 0, 0, 190)
_RING, _CHOSEN_RING = 0.24, 0.40  # radii, in mean grain radii
_VIEW = uuid.UUID("5f0c1c9e-6f0c-4e0e-9a57-8b1f0ad1d9c1")  # the same view in every blueprint that is sent
_ROOT = uuid.UUID("0d7b4d1e-43a4-4f27-8a43-64a1d4f3b2aa")


@dataclass(frozen=True, slots=True)
class Backdrop:
    """What stands still while one frame is judged."""

    photograph: NDArray[np.uint8] | None  # (H, W) grey
    centre: Array  # (n, 2) [m] of the present grains
    radius: Array  # (n,) [m]
    walls: list[Array]  # (w) lines (p, 2) [m]


@dataclass(frozen=True, slots=True)
class Marked:
    """Candidates and what is said of them."""

    point: Array  # (c, 2) [m]
    normal: Array  # (c, 2)
    kind: NDArray[np.int64]  # (c,) UNDETECTED … UNSURE


@dataclass(frozen=True, slots=True)
class Chosen:
    """The pair that is being judged."""

    point: Array  # (2,) [m]
    centre: Array  # (m, 2) [m] of its one or two grains
    radius: Array  # (m,) [m]


class ReviewLayer:
    """Turns a frame and its verdicts into bytes for one viewer."""

    def __init__(self, canvas: Canvas) -> None:
        rr.set_strict_mode(True)
        self.canvas = canvas
        self._recording = uuid.uuid4()

    def backdrop(self, backdrop: Backdrop) -> bytes:
        """Photograph and outlines of a frame."""
        stream, canvas = self._stream(), self.canvas
        image = rr.EncodedImage(contents=encode_jpeg(self._ground(backdrop)), media_type="image/jpeg", draw_order=-10.0)
        stream.log(PHOTOGRAPH, image, static=True)
        radius = canvas.lengths(backdrop.radius)
        stream.log(
            GRAINS,
            rr.Ellipses2D(
                centers=_px(canvas.points(backdrop.centre)), half_sizes=_px(np.stack([radius, radius], axis=1)),
                line_radii=np.float32(0.016 * canvas.grain_radius), colors=packed_one(_OUTLINE), draw_order=10.0,
            ),
            static=True,
        )  # fmt: skip
        stream.log(
            WALLS,
            rr.LineStrips2D(
                [_px(canvas.points(line)) for line in backdrop.walls], radii=np.float32(0.03 * canvas.grain_radius),
                colors=packed_one(_WALL), draw_order=5.0,
            ),
            static=True,
        )  # fmt: skip
        return _bytes(stream)

    def marks(self, marked: Marked, chosen: Chosen | None) -> bytes:
        """Candidates, verdicts and the chosen pair."""
        stream, size = self._stream(), self.canvas.grain_radius
        point, judged = self.canvas.points(marked.point), marked.kind >= CONTACT
        colour = np.array([packed_one(each) for each in COLOURS], np.uint32)[marked.kind]
        thick = np.where(marked.kind == UNDETECTED, 0.022, 0.034)
        self._rings(stream, CANDIDATES, point[~judged], _RING, colour[~judged], thick[~judged] * size, 20.0)
        self._rings(stream, MARKS, point[judged], _RING, colour[judged], np.full(judged.sum(), 0.05 * size), 22.0)
        along = np.stack([marked.normal[:, 0], -marked.normal[:, 1]], axis=1)  # y points down
        strokes, owner = _strokes(point, along, marked.kind, _RING * size)
        stream.log(
            STROKES,
            rr.LineStrips2D(strokes, radii=np.float32(0.05 * size), colors=colour[owner], draw_order=23.0),
            static=True,
        )
        self._choose(stream, chosen)
        return _bytes(stream)

    def look(self, left: float, top: float, width: float, height: float) -> bytes:
        """A blueprint that frames a part of the picture [px]."""
        # A click asks for a place, and the server knows what lies there. Were the marks themselves to be picked, a slow
        # renderer would answer some pictures late, or not at all.
        layers = (GRAINS, WALLS, CANDIDATES, MARKS, SELECTION)
        still: Any = {path: rrb.EntityBehavior(interactive=False) for path in layers}
        view = rrb.Spatial2DView(
            name="Photograph", origin="/", contents=["/**"], titlebar=False, background=[16, 17, 21], overrides=still,
            visual_bounds=rrb.VisualBounds2D(x_range=[left, left + width], y_range=[top, top + height]),
        )  # fmt: skip
        view.id = _VIEW
        root = rrb.Vertical(view)
        root.id = _ROOT
        blueprint = rrb.Blueprint(
            root, rrb.BlueprintPanel(state="hidden"), rrb.SelectionPanel(state="hidden"),
            rrb.TimePanel(state="hidden"), rrb.TopPanel(state="hidden"), auto_views=False, auto_layout=False,
        )  # fmt: skip
        stream = self._stream()
        stream.send_blueprint(blueprint, make_active=True, make_default=True)
        return _bytes(stream)

    def _ground(self, backdrop: Backdrop) -> NDArray[np.uint8]:
        """The photograph, or a plain ground: a click on it has a place, one on nothing has none."""
        if backdrop.photograph is not None:
            return backdrop.photograph
        canvas = self.canvas
        return np.full((max(1, math.ceil(canvas.bottom)), max(1, math.ceil(canvas.right))), 40, np.uint8)

    def _choose(self, stream: rr.RecordingStream, chosen: Chosen | None) -> None:
        size = self.canvas.grain_radius
        point = np.empty((0, 2)) if chosen is None else self.canvas.points(chosen.point[None])
        centre = np.empty((0, 2)) if chosen is None else self.canvas.points(chosen.centre)
        radius = np.empty(0) if chosen is None else self.canvas.lengths(chosen.radius)
        twice = np.concatenate([point, point])
        look = np.array([packed_one(_HALO), packed_one(_CHOSEN)], np.uint32)[: len(twice)]
        thick = np.array([0.075, 0.04])[: len(twice)] * size
        self._rings(stream, SELECTION, twice, _CHOSEN_RING, look, thick, 30.0)
        stream.log(
            PARTNERS,
            rr.Ellipses2D(
                centers=_px(centre), half_sizes=_px(np.stack([radius, radius], axis=1)),
                line_radii=np.float32(0.03 * size), colors=packed_one(_CHOSEN), draw_order=12.0,
            ),
            static=True,
        )  # fmt: skip

    def _rings(
        self, stream: rr.RecordingStream, path: str, point: Array, radius: float, colour: NDArray[np.uint32],
        thick: Array, order: float,
    ) -> None:  # fmt: skip
        half = np.full((len(point), 2), radius * self.canvas.grain_radius)
        stream.log(
            path,
            rr.Ellipses2D(
                centers=_px(point), half_sizes=_px(half), line_radii=thick.astype(np.float32), colors=colour,
                draw_order=order,
            ),
            static=True,
        )  # fmt: skip

    def _stream(self) -> rr.RecordingStream:
        stream = rr.RecordingStream(APPLICATION_ID, recording_id=self._recording, send_properties=False)
        stream.set_log_time_enabled(False)
        return stream


def encode_jpeg(photograph: NDArray[np.uint8]) -> bytes:
    """Encode a photograph (H, W) so that its speckles stay sharp."""
    done, data = cv2.imencode(".jpg", photograph, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not done:
        raise ValueError(f"a photograph of {photograph.shape} pixels could not be encoded as JPEG")
    return data.tobytes()


def _strokes(
    point: Array, along: Array, kind: NDArray[np.int64], size: float
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The signs of the verdicts (k, 2, 2) [px] with the candidate each belongs to (k,).

    Contact: a bond from grain to grain. No contact: a bar between them. Unsure: nothing but the ring.
    """
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    bond, bar = np.flatnonzero(kind == CONTACT), np.flatnonzero(kind == NO_CONTACT)
    owner = np.concatenate([bond, bar])
    way = np.concatenate([along[bond], across[bar]]) * size
    return _px(np.stack([point[owner] - way, point[owner] + way], axis=1)), owner


def _px(values: Array) -> NDArray[np.float32]:
    return np.asarray(values, np.float32)


def _bytes(stream: rr.RecordingStream) -> bytes:
    content = stream.binary_stream().read()
    assert content is not None
    return content
