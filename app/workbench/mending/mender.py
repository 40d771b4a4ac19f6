"""One rod in one photograph, correlated again from a pose that a hand gives."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ...tracking.correlation.correlator import Fits, Rows, SearchRange
from ...tracking.registration.registration import Registration
from ...tracking.tracker import Tracker

KEPT = 3  # photographs that are ready to be correlated with
NEAR = 6.0, 0.35  # [px], [rad] about the given pose that are searched where the pose itself does not fit, and
WIDE = (
    0.9  # [radii], at any angle, where nothing is found there: a rod that is dropped on its place is meant to be there
)
FITS = 0.6  # correlation from which on nothing else is searched
WHOLE = 0.8  # correlation from which on nothing covers a rod
KEPT_LEAST = 0.25  # share of a rod that must be seen where the rest is covered,
AGREES = 0.9  # with which correlation,
LEASH = 0.3  # [radii] no farther from where it was looked for
LEAST_RESIDUAL = 2.0  # [grey] that noise alone leaves
INNER = 0.9  # of the radius, within which the light is told by
LEAST_GAIN = 0.15  # of the light: less is a cover, which has one grey
LIGHTS = 300  # lines through two pixels,
SAME = 9.0  # [grey] to which others agree
SIDE = 88  # pixels of a picture of a rod
SURE = 0.5  # correlation that a fit from a wide search must have: among many poses some correlate by accident


@dataclass(frozen=True, slots=True)
class Mended:
    """A pose before and after its correlation; places in pixels, angles in radians of the picture."""

    x: float
    y: float
    angle: float
    zncc: float  # as found
    residual: float  # [grey] deviation of what the fit leaves
    zncc_before: float  # as it was given
    residual_before: float
    sigma: float  # [px] of a component of the place; NaN where nothing fits
    found: bool  # whether the correlation converged; else the given pose stands


class Mender:
    """Compares photographs with the first one, as the tracker does; the photographs used last are kept ready."""

    def __init__(self, ids: NDArray[np.int64], circles: Array, photograph: Callable[[int], Image]) -> None:
        """ids (n,) and circles (n, 3): centre and radius [px] of the rods on photograph 0."""
        self.ids, self.circles, self._read = ids, circles, photograph
        x, y, radius = circles.T
        self._tracker = Tracker(photograph(0), (x, y, radius), workers=1)
        self._ready: OrderedDict[int, Registration] = OrderedDict()
        self._lock = threading.Lock()

    def correlate(self, frame: int, name: int, pose: tuple[float, float, float]) -> Mended:
        """Fit a rod from x, y [px] and the angle [rad] of the picture from the first photograph. KeyError: no such."""
        rows = np.flatnonzero(self.ids == name)
        if len(rows) != 1:
            raise KeyError(name)
        registration, given = self._registration(frame), np.array([pose], dtype=np.float64)
        before = registration.fit(rows, given, steps=0)
        after = registration.fit(rows, given)
        reach = max(NEAR[0], WIDE * float(self.circles[rows[0], 2]))
        for within, least in ((NEAR, 0.0), ((reach, np.pi), SURE)):
            if not _good(after, FITS):
                again = _searched(registration, rows, given, within)
                if _good(again, least) and (again.zncc[0] > after.zncc[0] or not after.converged[0]):
                    after = again
        hopeless = float(registration.patches.accidental_zncc[rows[0]])
        found = _good(after, hopeless)
        if not _good(after, WHOLE):
            hidden = self._partly_hidden(registration, rows, np.concatenate([after.pose, given]))
            after, found = (after, found) if hidden is None else (hidden, True)
        chosen = after if found else before
        x, y, angle = (float(each) for each in (after.pose[0] if found else given[0]))
        return Mended(
            x, y, angle, float(chosen.zncc[0]), _deviation(chosen), float(before.zncc[0]), _deviation(before),
            float(after.sigma[0]) if found else float("nan"), found,
        )  # fmt: skip

    def _partly_hidden(self, registration: Registration, rows: Rows, starts: Array) -> Fits | None:
        """The fit from poses (m, 3) in which most of the rod agrees, where a part of it is covered; None: none is.

        The tracker asks for more of the rod, and for the light of its neighbours: here a person says that it is there.
        """
        patches, best = registration.patches, None
        norm, mean = patches.norm[rows], patches.mean[rows]
        circle = self.circles[rows[0]]
        first = _cut_out(self._photograph(0), (circle[0], circle[1], 0.0), circle[2])
        disc = np.hypot(*_offsets(circle[2])) < INNER * circle[2]
        for start in (each for each in starts for _ in range(2)):
            if best is not None:
                start = best.pose[0]  # the light is told better from where most agrees
            x, y, angle = start.tolist()
            here = _cut_out(registration.photograph.image, (x, y, angle), circle[2])
            gain, offset = _light(first[disc], here[disc])
            fits = registration.correlator.fit_robust(
                registration.photograph, rows, start[None], np.full(1, LEASH * circle[2]), LEAST_RESIDUAL, gain * norm,
                gain * mean + offset,
            )  # fmt: skip
            agrees = fits.converged[0] and fits.kept[0] > KEPT_LEAST and fits.zncc[0] > AGREES
            if agrees and (best is None or fits.zncc[0] > best.zncc[0]):
                best = fits
        return best

    def prepare(self, frame: int) -> None:
        """Make a photograph ready to be correlated with."""
        self._registration(frame)

    def circle(self, name: int) -> tuple[float, float, float]:
        """Centre and radius [px] of a rod on the first photograph. KeyError: no such."""
        rows = np.flatnonzero(self.ids == name)
        if len(rows) != 1:
            raise KeyError(name)
        x, y, radius = self.circles[rows[0]].tolist()
        return x, y, radius

    def pictures(self, frame: int, name: int, poses: Sequence[tuple[float, float, float]]) -> list[NDArray[np.uint8]]:
        """Squares of SIDE pixels: the rod on the first photograph, then the photograph `frame` at each of the poses,
        turned back as if the rod had not moved, each with what it differs from the first by (128: by nothing)."""
        x, y, radius = self.circle(name)
        first = _cut_out(self._photograph(0), (x, y, 0.0), radius)
        there = _offsets(radius)
        disc = np.hypot(*there) < 0.92 * radius
        told = [first]
        for pose in poses:
            here = _cut_out(self._photograph(frame), pose, radius)
            told += [here, _difference(here, first, disc) + 128.0]
        return [np.clip(np.rint(each), 0, 255).astype(np.uint8) for each in told]

    def _photograph(self, frame: int) -> Image:
        """A photograph; the first, with which all are compared, is at hand anyway."""
        return self._tracker.patches.reference.image if frame == 0 else self._read(frame)

    def _registration(self, frame: int) -> Registration:
        with self._lock:
            if frame not in self._ready:
                self._ready[frame] = self._tracker.begin(self._photograph(frame), [self._tracker.first()])
                while len(self._ready) > KEPT:
                    self._ready.popitem(last=False)
            self._ready.move_to_end(frame)
            return self._ready[frame]


def _offsets(radius: float) -> tuple[Array, Array]:
    """Of the pixels of a square that holds a rod, x and y from its centre [px of the photograph]."""
    along = 1.1 * radius * (2.0 * (np.arange(SIDE) + 0.5) / SIDE - 1.0)
    y, x = np.meshgrid(along, along, indexing="ij")
    return x, y


def _cut_out(image: Image, pose: tuple[float, float, float], radius: float) -> Array:
    """A rod (SIDE, SIDE) [grey], turned back by the angle of its pose."""
    x, y = _offsets(radius)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    column, row = pose[0] + c * x - s * y, pose[1] + s * x + c * y
    cut = cv2.remap(
        image, column.astype(np.float32), row.astype(np.float32), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return cut.astype(np.float64)


def _difference(here: Array, first: Array, disc: NDArray[np.bool_]) -> Array:
    """What is left [grey] within a disc once the light is taken off; 0 outside."""
    a, b = here[disc] - here[disc].mean(), first[disc] - first[disc].mean()
    gain = float(a @ b / max(float(a @ a), 1e-9))
    left = np.zeros_like(here)
    left[disc] = max(gain, 0.0) * a - b
    return left


def _light(first: Array, here: Array) -> tuple[float, float]:
    """Gain and offset by which most pixels of a rod (p,) became what they are: of many lines through two, the best."""
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, len(first), (2, LIGHTS))
    apart = np.abs(first[a] - first[b]) > 4.0 * SAME
    gain = (here[a] - here[b])[apart] / (first[a] - first[b])[apart]
    offset = here[a][apart] - gain * first[a][apart]
    some = rng.integers(0, len(first), min(len(first), 1500))
    agree = (np.abs(here[some] - gain[:, None] * first[some] - offset[:, None]) < SAME).sum(axis=1)
    agree[gain < LEAST_GAIN] = 0
    best = int(agree.argmax()) if len(agree) else -1
    return (float(gain[best]), float(offset[best])) if best >= 0 else (1.0, 0.0)


def _searched(registration: Registration, rows: Rows, given: Array, within: tuple[float, float]) -> Fits:
    """The fit from the most similar pose about a given one, so far [px] and so far turned [rad]."""
    reach, sweep = within
    around = SearchRange(given, np.full(1, reach), sweep)
    best = registration.correlator.search(registration.photograph, rows, around, 1)[0, 0]
    return registration.fit(rows, best[None, :3] if best[3] > 0.0 else given)


def _good(fits: Fits, least: float) -> bool:
    return bool(fits.converged[0] and fits.zncc[0] > least)


def _deviation(fits: Fits) -> float:
    return float(np.sqrt(max(float(fits.residual[0]), 0.0)))
