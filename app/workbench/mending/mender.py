"""One rod in one photograph, correlated again from a pose that a hand gives."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ...tracking.correlation.correlator import Fits, SearchRange
from ...tracking.registration.registration import Registration
from ...tracking.tracker import Tracker

KEPT = 3  # photographs that are ready to be correlated with
REACH = 6.0  # [px] about the given place, and
SWEEP = 0.35  # [rad] about the given angle, that are searched where the place itself does not fit
FITS = 0.6  # correlation from which on a fit from the given pose is not searched around


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
        self.ids, self.circles, self._photograph = ids, circles, photograph
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
        if not _good(after, FITS):
            within = SearchRange(given, np.full(1, REACH), SWEEP)
            best = registration.correlator.search(registration.photograph, rows, within, 1)[0, 0]
            again = registration.fit(rows, best[None, :3])
            if best[3] > 0.0 and again.converged[0] and again.zncc[0] > after.zncc[0]:
                after = again
        hopeless = float(registration.patches.accidental_zncc[rows[0]])
        found = _good(after, hopeless)
        chosen = after if found else before
        x, y, angle = (float(each) for each in (after.pose[0] if found else given[0]))
        return Mended(
            x, y, angle, float(chosen.zncc[0]), _deviation(chosen), float(before.zncc[0]), _deviation(before),
            float(after.sigma[0]) if found else float("nan"), found,
        )  # fmt: skip

    def circle(self, name: int) -> tuple[float, float, float]:
        """Centre and radius [px] of a rod on the first photograph. KeyError: no such."""
        rows = np.flatnonzero(self.ids == name)
        if len(rows) != 1:
            raise KeyError(name)
        x, y, radius = self.circles[rows[0]].tolist()
        return x, y, radius

    def _registration(self, frame: int) -> Registration:
        with self._lock:
            if frame not in self._ready:
                self._ready[frame] = self._tracker.begin(self._photograph(frame), [self._tracker.first()])
                while len(self._ready) > KEPT:
                    self._ready.popitem(last=False)
            self._ready.move_to_end(frame)
            return self._ready[frame]


def _good(fits: Fits, least: float) -> bool:
    return bool(fits.converged[0] and fits.zncc[0] > least)


def _deviation(fits: Fits) -> float:
    return float(np.sqrt(max(float(fits.residual[0]), 0.0)))
