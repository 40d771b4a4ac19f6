"""Photographs as a laboratory brings them: names without meaning, 16 bits, bolts around the box, a ruler, two rods
that are hard to see, and a reflection that hides one rod in some photographs. The truth is kept elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from rodsight.synthetic.synthesis import SHEAR_RATE, SynthesisSettings, synthesize

PIXEL = 2.5e-4  # [m]
STEP = 0.25  # [°] of shear between photographs
PAD = 170  # [px] of table seen around the frame
TICK = 0.005  # [m] between marks of the ruler
RULER = 0.15  # [m]
DIM = 0.22  # of the light: what reaches two of the rods
HIDDEN = 7  # the photograph in which a reflection hides a rod, and
STILL = 2  # in how many after it
LIT = 0.6  # [radii], radius of the reflection
CLEAR = 0.45  # of the light comes through its veil of so many
VEIL = 150.0  # [grey]
GREY = 257  # of 16 bits, for one of 8
BOLT = 22  # [px], radius of its head
FIRST = 9991  # number of the first photograph: names sort otherwise than numbers

Picture = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class LaboratorySet:
    """Where the photographs lie, and what nobody there knows."""

    folder: Path  # that is opened
    truth: Path  # the experiment with its true forces, in the coordinates of its own photographs
    poses: NDArray[np.float64]  # (f, n, 3) true x, y [px] and angle [rad] of the picture
    radius: NDArray[np.float64]  # (n,) [px]
    dim: tuple[int, int]  # rods that are hard to see
    hidden: int  # the rod under the reflection
    ruler: tuple[tuple[float, float], tuple[float, float]]  # [px], its first and last mark
    box: NDArray[np.float64]  # (4, 2, 2) [px], the bars of the first photograph: bottom, right, top, left
    interval: float  # [s]


def make_laboratory_set(folder: Path, *, grains: int = 250, frames: int = 20, seed: int = 5) -> LaboratorySet:
    """Render the photographs into folder/camera, and keep the truth in folder/truth."""
    made = synthesize(
        folder / "truth",
        SynthesisSettings(grains=grains, frames=frames, seed=seed, depth=16, pixel_size=PIXEL, step_degrees=STEP),
    )
    rows, columns = made.photograph_shape or (0, 0)
    truth = made.truth
    poses = np.dstack([
        truth.position[..., 0] / PIXEL + PAD, rows - 1 - truth.position[..., 1] / PIXEL + PAD, -truth.rotation
    ])  # fmt: skip
    radius = truth.radius / PIXEL
    dim, hidden = _choose(poses, radius)
    start = (PAD + 60.0, rows + 1.55 * PAD)
    ruler = start, (start[0] + RULER / PIXEL, start[1])
    camera = folder / "opened" / "camera roll"
    camera.mkdir(parents=True)
    surround = _surround((rows + 2 * PAD, columns + 2 * PAD), ruler)
    for k, file in enumerate(sorted((folder / "truth" / "photos").iterdir())):
        picture = surround.copy()
        picture[PAD:-PAD, PAD:-PAD] = cv2.imread(str(file), cv2.IMREAD_UNCHANGED).astype(np.float32) / GREY
        for rod in dim:
            _darken(picture, poses[k, rod], radius[rod])
        if HIDDEN <= k <= HIDDEN + STILL:
            _reflect(picture, poses[k, hidden], radius[hidden], k)
        deep = np.clip(np.rint(picture * GREY), 0, 65535).astype(np.uint16)
        assert cv2.imwrite(str(camera / f"P{FIRST + 3 * k}.png"), deep)
    ends = truth.endpoints[0] / PIXEL
    ends[..., 1] = rows - 1 - ends[..., 1]
    order = [truth.wall_names.index(name) for name in ("bottom", "right", "top", "left")]
    return LaboratorySet(
        folder / "opened", folder / "truth", poses, radius, dim, hidden, ruler, ends[order] + PAD, STEP / SHEAR_RATE
    )


def _choose(poses: NDArray[np.float64], radius: NDArray[np.float64]) -> tuple[tuple[int, int], int]:
    """Three rods well inside, far from one another: two that are dim, one that is hidden."""
    place = poses[0, :, :2]
    middle, spread = np.median(place, axis=0), place.std(axis=0)
    wanted = middle + spread * np.array([[-0.8, -0.7], [0.9, 0.6], [0.5, -0.8]])
    large = radius >= np.median(radius)
    rows = [int(np.where(large, np.hypot(*(place - each).T), np.inf).argmin()) for each in wanted]
    return (rows[0], rows[1]), rows[2]


def _surround(shape: tuple[int, int], ruler: tuple[tuple[float, float], tuple[float, float]]) -> Picture:
    """The table around the frame, with bolts and the ruler."""
    rng = np.random.default_rng(3)
    coarse = rng.normal(46.0, 5.0, (shape[0] // 8 + 2, shape[1] // 8 + 2)).astype(np.float32)
    table = cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    table = np.clip(np.rint(table + rng.normal(0.0, 2.0, shape)), 0, 255).astype(np.uint8)
    _draw_ruler(table, ruler)
    rows, columns = shape
    for x in np.linspace(0.45 * PAD, columns - 0.45 * PAD, 5):
        _draw_bolt(table, x, 0.45 * PAD)
    for y in (0.45 * rows, 0.8 * rows):
        _draw_bolt(table, 0.4 * PAD, y)
        _draw_bolt(table, columns - 0.4 * PAD, y)
    return table.astype(np.float32)


def _draw_bolt(picture: NDArray[np.uint8], x: float, y: float) -> None:
    """A bright, round head with a socket: what looks for rods sees one."""
    centre = (round(x), round(y))
    cv2.circle(picture, centre, BOLT + 5, 22.0, -1, cv2.LINE_AA)
    cv2.circle(picture, centre, BOLT, 176.0, -1, cv2.LINE_AA)
    corners = [(x + 9 * np.cos(a), y + 9 * np.sin(a)) for a in np.arange(6) * np.pi / 3]
    cv2.fillPoly(picture, [np.rint(corners).astype(np.int32)], 30.0, cv2.LINE_AA)


def _draw_ruler(picture: NDArray[np.uint8], ends: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """White, with a mark every 5 mm and numbers in centimetres; marks are as exact as a pixel's parts."""
    (left, top), (right, _) = ends
    cv2.rectangle(picture, (round(left) - 24, round(top) - 6), (round(right) + 24, round(top) + 56), 214.0, -1)
    for k in range(round(RULER / TICK) + 1):
        x, long = left + k * TICK / PIXEL, 26 if k % 2 == 0 else 15
        share = np.clip(1.25 - np.abs(np.arange(picture.shape[1]) - x), 0.0, 1.0).astype(np.float32)
        part = picture[round(top) : round(top) + long]
        part[:] = np.rint(part + share * (25.0 - part))
        if k % 2 == 0:
            words = str(k // 2)
            cv2.putText(picture, words, (round(x) - 5 * len(words), round(top) + 46), cv2.FONT_HERSHEY_SIMPLEX, 0.5,
                        25.0, 1, cv2.LINE_AA)  # fmt: skip


def _within(picture: Picture, x: float, y: float, radius: float) -> Picture:
    """How much (h, w) of every pixel lies in a disc."""
    rows, columns = np.ogrid[: picture.shape[0], : picture.shape[1]]
    return np.clip(radius + 0.5 - np.hypot(columns - x, rows - y), 0.0, 1.0).astype(np.float32)


def _darken(picture: Picture, pose: NDArray[np.float64], radius: float) -> None:
    picture *= 1.0 - (1.0 - DIM) * _within(picture, pose[0], pose[1], radius + 1.0)


def _reflect(picture: Picture, pose: NDArray[np.float64], radius: float, frame: int) -> None:
    """A lamp in the glaze: a third of the face is white, and a veil lies over the rest."""
    turn = 0.3 * frame
    x, y = pose[0] + 0.25 * radius * np.cos(turn), pose[1] + 0.25 * radius * np.sin(turn)
    face = _within(picture, pose[0], pose[1], radius - 1.0)
    picture += face * (1.0 - CLEAR) * (VEIL - picture)
    picture += face * _within(picture, x, y, LIT * radius) * (245.0 - picture)
