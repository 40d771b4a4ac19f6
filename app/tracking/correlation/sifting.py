"""Search for one patch after another; what is large is looked for on a coarser level first.

A search takes a sixteenth of the time on a level twice as coarse. What is most similar there need not be the true
place, so that several such places are looked at on the level itself, within a pixel of the coarse one and half a step
of its angles.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .search import angle_steps, is_same_turn, search_patch
from .search_parts import search_parts

# Half width of the look at a place of the coarser level, in pixels of the finer one; and how many more places are
# looked at once one is beyond doubt, so that the second best is known, too.
LOOK = 2.0
RUNNERS_UP = 2

# How far apart two places of one angle must be, in pixels of the level that is searched, of the one that is sifted.
SPACING, SIFTED_SPACING = 3.0, 2.0


@njit(cache=True, nogil=True)
def search_all(reference, image, factor, place, reach, pose, window, sweep, best):
    """Search for discs about `place` (m, 2) of reach (m,) around pose (m, 3); best (m, c, 4), see `search_patch`.

    reference: spline coefficients, image: the photograph, both shrunk by `factor`; all else [px] of the photograph.
    """
    for k in range(len(place)):
        _search(reference, image, factor, place[k], reach[k], pose[k], window[k], sweep, SPACING, best[k])


@njit(cache=True, nogil=True)
def search_parts_all(reference, image, factor, place, reach, pose, window, sweep, best):
    """As `search_all`, for halves of the discs, too."""
    shift = 0.5 * (factor - 1)
    for k in range(len(place)):
        search_parts(
            reference, image, (place[k, 0] - shift) / factor, (place[k, 1] - shift) / factor, reach[k] / factor,
            (pose[k, 0] - shift) / factor, (pose[k, 1] - shift) / factor, pose[k, 2], window[k] / factor, sweep,
            SPACING, best[k],
        )  # fmt: skip
        best[k, :, :2] *= factor
        best[k, :, :2] += shift


@njit(cache=True, nogil=True)
def sift_all(
    reference, image, coarse_reference, coarse_image, factor, place, reach, pose, window, sweep, looks, beyond_doubt,
    best,
):  # fmt: skip
    """As `search_all`, by way of the `looks` best places on a level twice as coarse.

    beyond_doubt (m,): ZNCC of a place after which few more are looked at.
    """
    places, looked = np.empty((looks, 4)), np.empty((looks, 1, 4))
    for k in range(len(place)):
        _search(
            coarse_reference, coarse_image, 2 * factor, place[k], reach[k], pose[k], window[k], sweep, SIFTED_SPACING,
            places,
        )  # fmt: skip
        # Half a step of the coarse angles to either side, and a pixel of the coarse level.
        half = 0.6 * sweep / angle_steps(reach[k] / (2 * factor), sweep)
        looked[:, 0, :3] = 0.0
        looked[:, 0, 3] = -1.0
        last = looks
        for m in range(looks):
            if m >= last or not places[m, 3] > 0.0:
                break
            around = places[m, :3].copy()
            _search(reference, image, factor, place[k], reach[k], around, LOOK * factor, half, SPACING, looked[m])
            if looked[m, 0, 3] > beyond_doubt[k]:
                last = min(last, m + 1 + RUNNERS_UP)
        take_most_similar(looked[:, 0], SPACING * factor, best[k])


@njit(cache=True, nogil=True)
def take_most_similar(places, spacing, best):
    """Write the best of places (m, 4) to best (c, 4), distinct by `spacing` [px] or in angle, else ZNCC −1."""
    best[:, :3] = 0.0
    best[:, 3] = -1.0
    found = 0
    for m in np.argsort(-places[:, 3], kind="mergesort"):
        if found == len(best) or not places[m, 3] > 0.0:
            return
        distinct = True
        for other in range(found):
            away = np.hypot(best[other, 0] - places[m, 0], best[other, 1] - places[m, 1])
            distinct = distinct and not (away < spacing and is_same_turn(best[other, 2], places[m, 2]))
        if distinct:
            best[found] = places[m]
            found += 1


@njit(cache=True, nogil=True)
def _search(reference, image, factor, place, reach, pose, window, sweep, spacing, best):
    """`search_patch` on a level, told and answered in pixels of the photograph, but for the spacing."""
    shift = 0.5 * (factor - 1)
    search_patch(
        reference, image, (place[0] - shift) / factor, (place[1] - shift) / factor, reach / factor,
        (pose[0] - shift) / factor, (pose[1] - shift) / factor, pose[2], window / factor, sweep, spacing, best,
    )  # fmt: skip
    best[:, :2] *= factor
    best[:, :2] += shift
