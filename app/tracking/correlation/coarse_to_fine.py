"""Exhaustive search for many patches: on one level of the pyramid, or first on a level twice as coarse.

A search takes a sixteenth of the time on a level twice as coarse. The most similar place there need not be the true
one. Several of them are therefore refined on the level itself, within a pixel of the coarse level and half a step of
its angles.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..short_sort import ascending_order
from .search import angle_steps, is_same_angle, search_patch
from .search_parts import search_parts

# Half width of the refinement around a place of the coarser level, in pixels of the finer one, and the number of
# further places that are refined once a place is certain, so that the second best is known.
REFINEMENT_WINDOW = 2.0
EXTRA_PLACES = 2

# Least distance of two places at one angle, in pixels of the level that is searched and of the coarser one.
SPACING, COARSE_SPACING = 3.0, 2.0


@njit(cache=True, nogil=True)
def search_all(reference, image, factor, place, radius, pose, window, angle_window, best):
    """Search for many discs, see `search_patch`.

    Parameters
    ----------
    reference : (h, w) array
        Spline coefficients of the reference, shrunk by `factor`.
    image : (h, w) array
        The photograph, shrunk by `factor`.
    factor : int
        Factor by which both are shrunk. All lengths below are pixels of the full photograph.
    place : (m, 2) array
        Centres of the discs in the reference [px].
    radius : (m,) array
        Radii of the discs [px].
    pose : (m, 3) array
        Middles of the searches: x [px], y [px], angle [rad].
    window : (m,) array
        Half widths of the searches [px].
    angle_window : float
        Half width of the angles [rad].
    best : (m, c, 4) array
        Receives x, y [px], angle [rad] and ZNCC, best first.
    """
    for k in range(len(place)):
        _search(reference, image, factor, place[k], radius[k], pose[k], window[k], angle_window, SPACING, best[k])


@njit(cache=True, nogil=True)
def search_parts_all(reference, image, factor, place, radius, pose, window, angle_window, best):
    """Search for many discs and for their halves; parameters as of `search_all`."""
    shift = 0.5 * (factor - 1)
    for k in range(len(place)):
        search_parts(
            reference, image, (place[k, 0] - shift) / factor, (place[k, 1] - shift) / factor, radius[k] / factor,
            (pose[k, 0] - shift) / factor, (pose[k, 1] - shift) / factor, pose[k, 2], window[k] / factor, angle_window,
            SPACING, best[k],
        )  # fmt: skip
        best[k, :, :2] *= factor
        best[k, :, :2] += shift


@njit(cache=True, nogil=True)
def search_coarse_to_fine(
    reference, image, coarse_reference, coarse_image, factor, place, radius, pose, window, angle_window, coarse_count,
    sufficient_zncc, best,
):  # fmt: skip
    """Search on a level twice as coarse, then refine its best places; other parameters as of `search_all`.

    Parameters
    ----------
    coarse_reference, coarse_image : (h, w) array
        Spline coefficients and photograph, shrunk by twice the factor.
    coarse_count : int
        Number of coarse places that are refined.
    sufficient_zncc : (m,) array
        ZNCC of a refined place after which only `EXTRA_PLACES` more are refined.
    """
    places, refined = np.empty((coarse_count, 4)), np.empty((coarse_count, 1, 4))
    for k in range(len(place)):
        _search(
            coarse_reference, coarse_image, 2 * factor, place[k], radius[k], pose[k], window[k], angle_window,
            COARSE_SPACING, places,
        )  # fmt: skip
        # Half a step of the coarse angles to either side, and a margin.
        half = 0.6 * angle_window / angle_steps(radius[k] / (2 * factor), angle_window)
        refined[:, 0, :3] = 0.0
        refined[:, 0, 3] = -1.0
        last = coarse_count
        for m in range(coarse_count):
            if m >= last or not places[m, 3] > 0.0:
                break
            around = places[m, :3].copy()
            _search(
                reference, image, factor, place[k], radius[k], around, REFINEMENT_WINDOW * factor, half, SPACING,
                refined[m],
            )  # fmt: skip
            if refined[m, 0, 3] > sufficient_zncc[k]:
                last = min(last, m + 1 + EXTRA_PLACES)
        select_distinct_places(refined[:, 0], SPACING * factor, best[k])


@njit(cache=True, nogil=True)
def select_distinct_places(places, spacing, best):
    """Write the best of places (m, 4), distinct by `spacing` [px] or in angle, to best (c, 4); ZNCC −1 fills it up."""
    best[:, :3] = 0.0
    best[:, 3] = -1.0
    found = 0
    for m in ascending_order(-places[:, 3]):
        if found == len(best) or not places[m, 3] > 0.0:
            return
        distinct = True
        for other in range(found):
            distance = np.hypot(best[other, 0] - places[m, 0], best[other, 1] - places[m, 1])
            distinct = distinct and not (distance < spacing and is_same_angle(best[other, 2], places[m, 2]))
        if distinct:
            for k in range(4):
                best[found, k] = places[m, k]
            found += 1


@njit(cache=True, nogil=True)
def _search(reference, image, factor, place, radius, pose, window, angle_window, spacing, best):
    """Run `search_patch` on a level; lengths are pixels of the photograph, but the spacing is pixels of the level."""
    shift = 0.5 * (factor - 1)
    search_patch(
        reference, image, (place[0] - shift) / factor, (place[1] - shift) / factor, radius / factor,
        (pose[0] - shift) / factor, (pose[1] - shift) / factor, pose[2], window / factor, angle_window, spacing, best,
    )  # fmt: skip
    for place_found in best:
        place_found[0] = place_found[0] * factor + shift
        place_found[1] = place_found[1] * factor + shift
