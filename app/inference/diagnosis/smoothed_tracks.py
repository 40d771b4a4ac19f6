"""Tracks that were smoothed in time as a cause: the errors of their positions are no longer independent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...results.finding import Finding
from ...solver.assessment.penalties import limit_trust
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import detect_contacts
from ...solver.detection.precision import noise_by_second_changes
from ...solver.even_subset import even_subset
from ...solver.frame_forces import FrameForces
from ...solver.robust_scale import SD_OVER_MAD
from ...tracks import Tracks, TrackStatus
from ..correction.tables.outliers import walls_in
from ..snapshots import grains_of
from .causes import finding

WINDOW, WINDOWS = 12, 4  # photographs whose changes are compared, and how many such windows of a long test
FEWEST_PHOTOGRAPHS, FEWEST_PRODUCTS = 6, 250  # of fewer, correlations are too uncertain
REACH = 0.15  # [mean diameter] greatest gap of a pair in all photographs of a window
QUIET = 0.25  # fraction of these pairs whose gaps change least: noise is most of that
LAGS = 5  # [photographs]
CLIP = 3.0  # standard deviations to which a change is limited, so that a few jumps do not decide
# Chosen on 91 scenarios of seeds 20 and 22 (200 rods), as given and smoothed; the upper limit of the correlation and
# the lower one of the noise on seed 42, so that exact tracks with an overstated precision, whose gaps vary by motion
# alone, are not named. `python -m tests.app.inference.diagnosis.smoothing_study` counts both. Unnamed are mostly
# exponential filters where noise hides the motion, and cubic fits, which leave no noise.
LEAST_NOISE, LOW_NOISE = 0.08, 0.5  # noise of the quiet gaps over the stated one, between which they vary too little …
CHANGES = (-0.2, 0.2)  # … and the correlation of their successive changes: white noise gives -1/2, motion alone up to 1
SMOOTH_MOTION = -0.15  # that of second changes of all pairs, above which nothing moves suddenly: as given at most -.2 …
AVERAGED = -0.25  # … or a later lag has a correlation below this, as by a moving average of so many photographs

# Limits of T, of the expected r, and of the lower end of its interval (two thirds), by 540 named frames of seed 20
# (fourteen scenarios, moving averages of 3 and 5 and exponential filters): the median r was .92, a twentieth was below
# .61 and a sixth of the tests below .79; after exponential filters .84, .42. On the 552 of seed 42 T was above r + .03
# in .03 with this limit, in .21 without; after exponential filters in .08 and .38.
TRUST_OF_SMOOTHED, EXPECTED_OF_SMOOTHED, LOW_OF_SMOOTHED = 0.5, 0.9, 0.79
SMOOTHED = (
    "the tracks were smoothed in time: sudden motion is spread over several photographs, and errors that they share "
    "seem to be knowledge; give the tracks as measured"
)


@dataclass(frozen=True, slots=True)
class GapChanges:
    """How the gaps of neighbours change from photograph to photograph."""

    noise: float  # [m] standard deviation of a position component, by second changes of the quiet gaps
    correlation: Array  # (LAGS,) of changes of the quiet gaps, at lags of 1, 2, … photographs
    second_of_all: float  # of second changes of the gaps of all neighbours, at a lag of one photograph
    count: int  # products of second changes of the quiet gaps

    @property
    def averaged(self) -> int:
        """Photographs over which a moving average was taken: the lag of its negative correlation; 0: none."""
        lag = int(np.argmin(np.nan_to_num(self.correlation[1:], nan=0.0))) + 1
        return lag + 1 if self.correlation[lag] < AVERAGED else 0

    def smoothed(self, stated: float) -> bool:
        """Whether errors and motion vary less from photograph to photograph than a stated noise [m] leads to expect."""
        if self.count < FEWEST_PRODUCTS or not LEAST_NOISE * stated < self.noise < LOW_NOISE * stated:
            return False
        between = CHANGES[0] < self.correlation[0] < CHANGES[1]
        return between and (self.second_of_all > SMOOTH_MOTION or self.averaged > 0)


def examine_smoothing(tracks: Tracks) -> list[Finding]:
    """Look for given tracks whose positions were smoothed in time.

    Notes
    -----
    d_k = g_{k+1} - g_k are the changes of a gap g between neighbours that hardly move among each other. Errors that are
    independent from photograph to photograph (white) give d a correlation of -1/2 at a lag of one photograph and of
    zero at all others. With a moving average over n photographs
    d_k = (z_{k+m+1} - z_{k+m+1-n}) / n, z the gaps as measured: the correlation is zero up to a lag of n - 1, and -1/2
    at a lag of n. With an exponential filter, g_k = (1 - α) g_{k-1} + α z_k, it is -α/2 at the first lag and falls by
    1 - α with every further one. Either leaves less noise than is stated.

    Slow errors, or an overstated noise far below the elastic motion, look alike in gaps that rest. They leave the
    motion as sudden as it is: second changes d_k - d_{k-1} of all gaps had a correlation of -.7 to -.2 on tracks as
    given, and of -.15 to .9 after smoothing where motion exceeds the noise. So either that or the correlation of a
    moving average must show. Tracks of photographs are not examined: a run does not smooth them.
    """
    changes = find_smoothing(tracks)
    if changes is None:
        return []
    words = (
        f"the gaps of neighbours vary by a noise of {1e6 * changes.noise:.2g} µm, "
        f"{changes.noise / _stated_noise(tracks):.2f} of the stated precision, and their successive changes have a "
        f"correlation of {changes.correlation[0]:.2f}, where independent photographs give -0.50"
    )
    if changes.averaged:
        words += f", but {changes.correlation[changes.averaged - 1]:.2f} after {changes.averaged} photographs"
    return [finding("smoothed_tracks", words)]


def find_smoothing(tracks: Tracks) -> GapChanges | None:
    """Changes of gaps that show how given tracks were smoothed in time; None: they were not."""
    if not (tracks.status[tracks.present] == TrackStatus.GIVEN).all():
        return None
    changes = measure_gap_changes(tracks)
    return changes if changes is not None and changes.smoothed(_stated_noise(tracks)) else None


def limit_for_smoothing(frame: FrameForces) -> FrameForces:
    """Limit trust and expected correlation of a frame of a test whose tracks were smoothed."""
    return limit_trust(frame, TRUST_OF_SMOOTHED, EXPECTED_OF_SMOOTHED, SMOOTHED)


def measure_gap_changes(tracks: Tracks) -> GapChanges | None:
    """Measure the changes of gaps between neighbours in some windows of photographs; None: too few photographs."""
    f = tracks.frame_count
    if f < FEWEST_PHOTOGRAPHS:
        return None
    length = min(WINDOW, f)
    starts = even_subset(f - length + 1, WINDOWS).tolist()
    windows = [np.diff(_neighbouring_gaps(tracks, first, first + length), axis=0) for first in starts]
    quiet = np.concatenate([change[:, _rests(change)] for change in windows], axis=1)
    second, second_of_all = np.diff(quiet, axis=0), np.diff(np.concatenate(windows, axis=1), axis=0)
    known = second[np.isfinite(second)]
    if not len(known):
        return None
    return GapChanges(
        noise_by_second_changes(known),
        np.array([_correlation(quiet, lag) for lag in range(1, LAGS + 1)]),
        _correlation(second_of_all, 1),
        int(np.isfinite(second[1:] * second[:-1]).sum()),
    )


def _stated_noise(tracks: Tracks) -> float:
    """Median standard deviation of a position component as stated [m]."""
    return float(np.nanmedian(tracks.position_sigma))


def _neighbouring_gaps(tracks: Tracks, first: int, end: int) -> Array:
    """Gaps (f, p) [m] of the pairs that stay neighbours in photographs `first` to `end`; NaN where one is lost."""
    middle, reach = (first + end) // 2, REACH * 2.0 * float(tracks.radius.mean())
    grains = grains_of(tracks)
    near = detect_contacts(grains, tracks.position[middle], tracks.present_in(middle), walls_in(None, middle), reach)
    apart = tracks.position[first:end, near.j] - tracks.position[first:end, near.i]
    gap = np.hypot(apart[..., 0], apart[..., 1]) - tracks.radius[near.i] - tracks.radius[near.j]
    return gap[:, ~(gap > reach).any(axis=0)]


def _rests(change: Array) -> NDArray[np.bool_]:
    """Which pairs (p,) have the smallest mean square change, of changes (f, p)."""
    known = np.isfinite(change)
    count = known.sum(axis=0)
    square = np.where(known, change, 0.0) ** 2
    mean = np.where(count > 0, square.sum(axis=0) / np.maximum(count, 1), np.inf)
    moves = mean[np.isfinite(mean)]
    return mean <= np.quantile(moves, QUIET) if len(moves) else np.zeros(len(mean), np.bool_)


def _correlation(values: Array, lag: int) -> float:
    """Correlation of values (f, p) of mean zero with those `lag` rows later; NaN where there are none, or all rest."""
    known = values[np.isfinite(values)]
    limit = CLIP * SD_OVER_MAD * float(np.median(np.abs(known))) if len(known) else 0.0
    if not limit > 0.0:
        return float("nan")
    clipped = np.clip(values, -limit, limit)
    product = clipped[lag:] * clipped[:-lag]
    product = product[np.isfinite(product)]
    if not len(product):
        return float("nan")
    return float(product.mean() / np.mean(np.clip(known, -limit, limit) ** 2))
