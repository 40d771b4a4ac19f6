"""One rod in one photograph, correlated from a pose that a hand gives."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...tracking.correlation.correlator import Fits, Rows, SearchRange
from ...tracking.registration.registration import Registration
from ...tracking.tracker import Tracker

KEPT = 3  # photographs that are ready for correlation
NEAR = 6.0, 0.35  # [px], [rad] search range about the given pose where the pose itself does not fit
WIDE = 0.9  # [radii] search range at any angle where the near search fails: a rod is dropped near its place
FITS = 0.6  # correlation above which no search is made
WHOLE = 0.8  # correlation above which a rod counts as not covered
PLACES = 6  # places of a rod's visible half that are tried at all angles, where dirt covers a part of it
KEPT_LEAST = 0.25  # least visible fraction of a partly covered rod
AGREES = 0.9  # least correlation of its visible part
LEASH = 0.3  # [radii] largest distance of its fit from the start
LEAST_RESIDUAL = 2.0  # [grey] of noise alone
INNER = 0.9  # [radii] of the disc whose pixels give the illumination
LEAST_GAIN = 0.15  # of the illumination: a lower one belongs to a cover of uniform grey
LIGHTS = 300  # lines through two pixels that are tried,
SAME = 9.0  # [grey] within which other pixels agree with a line
Taken = Callable[[float, float, float], bool]  # whether a circle x, y, radius [px] lies on another rod
SIDE = 88  # pixels of a picture of a rod
SURE = 0.5  # least correlation of a fit from a wide search: among many poses some correlate by chance


@dataclass(frozen=True, slots=True)
class PoseFit:
    """A pose before and after its correlation; places in pixels, angles in radians, in the picture."""

    x: float
    y: float
    angle: float
    zncc: float  # of the fit
    residual: float  # [grey] standard deviation of the residual
    zncc_before: float  # of the given pose
    residual_before: float
    sigma: float  # [px] standard deviation of a coordinate; NaN where nothing fits
    found: bool  # the correlation converged; else this is the given pose


def _free(_x: float, _y: float, _radius: float) -> bool:
    """No other rod is known."""
    return False


class PoseEditor:
    """Correlates photographs with the first one, as the tracker does; those used last are kept ready."""

    def __init__(self, ids: NDArray[np.int64], circles: Array, photograph: Callable[[int], Image]) -> None:
        """ids (n,); circles (n, 3): centre and radius [px] of the rods on photograph 0."""
        self.ids, self.circles, self._read = ids, circles, photograph
        x, y, radius = circles.T
        self._tracker = Tracker(photograph(0), (x, y, radius), workers=1)
        self._ready: OrderedDict[int, Registration] = OrderedDict()
        self._lock = threading.Lock()

    def correlate(
        self,
        frame: int,
        name: int,
        pose: tuple[float, float, float],
        taken: Taken = _free,
    ) -> PoseFit:
        """Fit a rod from a pose given by hand; raise KeyError for no such rod.

        Parameters
        ----------
        frame : int
            The photograph.
        name : int
            Id of the rod.
        pose : tuple of float
            x, y [px] and the angle [rad] since the first photograph.
        taken : callable
            Returns whether a circle x, y, radius [px] lies on another rod: a fit there is none.
        """
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
        radius = float(self.circles[rows[0], 2])
        # As the tracker requires it: by chance a rod correlates with the rod beside it, too.
        found = _good(after, float(registration.results.accepted_zncc[rows[0]]))
        found = found and not taken(float(after.pose[0, 0]), float(after.pose[0, 1]), radius)
        if not (found and _good(after, WHOLE)):
            starts = np.concatenate([after.pose, given])
            hidden = self._partly_hidden(registration, rows, starts, taken)
            if hidden is None:
                starts = _visible_halves(registration, rows, given, reach)
                hidden = self._partly_hidden(registration, rows, starts, taken)
            after, found = (after, found) if hidden is None else (hidden, True)
        chosen = after if found else before
        x, y, angle = (float(each) for each in (after.pose[0] if found else given[0]))
        return PoseFit(
            x, y, angle, float(chosen.zncc[0]), _residual_sd(chosen), float(before.zncc[0]), _residual_sd(before),
            float(after.sigma[0]) if found else float("nan"), found,
        )  # fmt: skip

    def _partly_hidden(self, registration: Registration, rows: Rows, starts: Array, taken: Taken) -> Fits | None:
        """Return the fit from poses (m, 3) with the best correlation of the visible part of a rod; None: none is good.

        The tracker requires more of the rod, and the illumination of its neighbours; here a person vouches for the rod.
        """
        patches, best = registration.patches, None
        norm, mean = patches.norm[rows], patches.mean[rows]
        circle = self.circles[rows[0]]
        first = _cut_out(self._photograph(0), (circle[0], circle[1], 0.0), circle[2])
        disc = np.hypot(*_offsets(circle[2])) < INNER * circle[2]
        for start in (each for each in starts for _ in range(2)):
            if best is not None:
                start = best.pose[0]  # the illumination is estimated better where more of the rod agrees
            x, y, angle = start.tolist()
            here = _cut_out(registration.photograph.image, (x, y, angle), circle[2])
            gain, offset = _illumination(first[disc], here[disc])
            fits = registration.correlator.fit_robust(
                registration.photograph, rows, start[None], np.full(1, LEASH * circle[2]), LEAST_RESIDUAL, gain * norm,
                gain * mean + offset,
            )  # fmt: skip
            agrees = fits.converged[0] and fits.kept[0] > KEPT_LEAST and fits.zncc[0] > AGREES
            agrees = agrees and not taken(float(fits.pose[0, 0]), float(fits.pose[0, 1]), float(circle[2]))
            if agrees and (best is None or fits.zncc[0] > best.zncc[0]):
                best = fits
        return best

    def prepare(self, frame: int) -> None:
        """Make a photograph ready for correlation."""
        self._registration(frame)

    def circle(self, name: int) -> tuple[float, float, float]:
        """Return centre and radius [px] of a rod on the first photograph; raise KeyError for no such rod."""
        rows = np.flatnonzero(self.ids == name)
        if len(rows) != 1:
            raise KeyError(name)
        x, y, radius = self.circles[rows[0]].tolist()
        return x, y, radius

    def pictures(self, frame: int, name: int, poses: Sequence[tuple[float, float, float]]) -> list[NDArray[np.uint8]]:
        """Cut squares of SIDE pixels: the rod on the first photograph, then on photograph `frame` at each of the poses,
        rotated back, each followed by its difference from the first (128: none)."""
        x, y, radius = self.circle(name)
        first = _cut_out(self._photograph(0), (x, y, 0.0), radius)
        there = _offsets(radius)
        disc = np.hypot(*there) < 0.92 * radius
        squares = [first]
        for pose in poses:
            here = _cut_out(self._photograph(frame), pose, radius)
            squares += [here, _difference(here, first, disc) + 128.0]
        return [np.clip(np.rint(each), 0, 255).astype(np.uint8) for each in squares]

    def _photograph(self, frame: int) -> Image:
        """A photograph; the first one is in memory."""
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
    """x and y [px of the photograph], from its centre, of the pixels of a square that holds a rod."""
    along = 1.1 * radius * (2.0 * (np.arange(SIDE) + 0.5) / SIDE - 1.0)
    y, x = np.meshgrid(along, along, indexing="ij")
    return x, y


def _cut_out(image: Image, pose: tuple[float, float, float], radius: float) -> Array:
    """A rod (SIDE, SIDE) [grey], rotated back by the angle of its pose."""
    x, y = _offsets(radius)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    column, row = pose[0] + c * x - s * y, pose[1] + s * x + c * y
    cut = cv2.remap(
        image, column.astype(np.float32), row.astype(np.float32), cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    return cut.astype(np.float64)


def _difference(here: Array, first: Array, disc: NDArray[np.bool_]) -> Array:
    """Difference [grey] within a disc after the illumination is fitted; 0 outside."""
    a, b = here[disc] - here[disc].mean(), first[disc] - first[disc].mean()
    gain = float(a @ b / max(float(a @ a), 1e-9))
    left = np.zeros_like(here)
    left[disc] = max(gain, 0.0) * a - b
    return left


def _illumination(first: Array, here: Array) -> tuple[float, float]:
    """Gain and offset of the illumination of a rod (p,): of many lines through two pixels, that with most agreement."""
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
    """Fit from the most similar pose within a distance [px] and a rotation [rad] of a given one."""
    reach, sweep = within
    around = SearchRange(given, np.full(1, reach), sweep)
    best = registration.correlator.search(registration.photograph, rows, around, 1)[0, 0]
    return registration.fit(rows, best[None, :3] if best[3] > 0.0 else given)


def _visible_halves(registration: Registration, rows: Rows, given: Array, reach: float) -> Array:
    """The poses (m, 3) at which a half of a rod correlates best, at any angle, within `reach` [px] of a given one."""
    around = SearchRange(given, np.full(1, reach), np.pi)
    places = registration.correlator.search(registration.photograph, rows, around, PLACES, parts=True)[0]
    return places[places[:, 3] > 0.0, :3]


def _good(fits: Fits, least: float) -> bool:
    return bool(fits.converged[0] and fits.zncc[0] > least)


def _residual_sd(fits: Fits) -> float:
    return float(np.sqrt(max(float(fits.residual[0]), 0.0)))
