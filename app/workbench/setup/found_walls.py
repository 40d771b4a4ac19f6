"""Bars, and discs in their corners, found around the rods of the first photograph and written to the experiment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...experiment.experiment import GrainGuess
from ...experiment.pictures.image import Image
from ...experiment.plausibility import rods_cut_by_walls
from ...process.counts import state_count
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...tracking.detection.detect import Detection
from ...tracking.walls.plain_bars import can_be_followed
from . import edits
from .draft import Draft
from .validation import ValidationResult, first_tracks, validate
from .walls import bars, circles

FEWEST_BARS = 2  # of a packing with open sides; with fewer the outermost rods are its boundary


def find_frame(draft: Draft, image: Image, found: ValidationResult) -> tuple[int, int]:
    """Write the bars around the rods, and the discs where they meet; return how many of each. One step of undo.

    Where the picture ends within the packing there is no bar.
    """
    named, _ = bars.find_named(image, found)
    with draft.one_step("walls found"):
        edits.set_walls(draft, found, named, "walls found")
        barred = validate(draft)
        discs = find_discs(draft, image, barred)
    return len(named), discs


def find_discs(draft: Draft, image: Image, found: ValidationResult) -> int:
    """Write the discs where bars meet to the table of corners; return their number."""
    discs = circles.find_corners(image, found)
    if discs:
        add_discs(draft, found, discs)
    return len(discs)


def add_discs(draft: Draft, found: ValidationResult, discs: Sequence[circles.Circle]) -> None:
    """Write discs in corners of the frame; circles that were detected on them are no rods. One step of undo."""
    with draft.one_step("corners"):
        circles.add_corners(draft, found, discs)
        rods = found.rods
        if rods is None:
            return
        on = np.zeros(len(rods.id), np.bool_)
        for disc in discs:
            on |= np.hypot(rods.x - disc.x, rods.y - disc.y) < disc.radius
        if on.any():
            left = GrainGuess(rods.id[~on], rods.x[~on], rods.y[~on], rods.radius[~on])
            edits.set_rods(draft, "circles on corner discs dropped", left)


def set_found_walls(
    draft: Draft,
    first: Image,
    detection: Detection,
    circles_found: Detection,
    radii: Sequence[float],
    *,
    loaded: bool,
    known: bool,
) -> tuple[Detection, list[str]]:
    """Write the bars that are found around the rods.

    Parameters
    ----------
    draft : Draft
        With these rods.
    first : (H, W)
        The first photograph.
    detection : Detection
        These rods.
    circles_found : Detection
        With those whose centres lie outside of the picture.
    radii : sequence of float
        The known classes [m].
    loaded : bool
        Whether pressures are given, for which there must be walls.
    known : bool
        Whether the rods are given: none is left out.

    Returns
    -------
    tuple
        The rods without circles beyond the bars, and sentences on what was left out.
    """
    notes: list[str] = []
    found = validate(draft)
    named, beyond = bars.find_named(first, found, circles_found)
    if beyond:
        listed = ", ".join(map(repr, beyond))
        notes.append(f"The packing goes on beyond the picture at {listed}: no wall is there.")
    if len(named) < FEWEST_BARS and not loaded:
        notes.append(f"The picture shows a part of the packing: {_impose_outer_rods(draft, found)}")
        return detection, notes
    edits.set_walls(draft, found, named, "walls")
    found = validate(draft)
    cut = {} if found.walls is None else rods_cut_by_walls(first_tracks(found), found.walls.frames(0, 1))
    if cut:
        edits.set_walls(draft, found, [each for each in named if each[0] not in cut], "walls that cut through no rod")
        found = validate(draft)
        notes += [
            f"Wall {name!r} is left out, since it would cut through {state_count(count, 'rod')}."
            for name, count in cut.items()
        ]
    count = detection.count
    detection = detection if known else edits.within_walls(detection, found)
    if detection.count < count:
        edits.set_rods(draft, "circles beyond the bars left out", edits.as_guess(detection), radii)
        found = validate(draft)
        notes.append(f"{state_count(count - detection.count, 'circle')} beyond the bars left out: no rods.")
    find_discs(draft, first, found)
    wrong = validate(draft).steps["walls"].errors
    if wrong and not loaded:  # rods that stand in no frame of four bars, or circles that are no rods
        notes.append(f"The bars that were found do not hold the rods ({wrong[0]}): {_impose_outer_rods(draft, found)}")
    return detection, notes


def replace_unseen_bars(
    draft: Draft, images: Sequence[Image], found: ValidationResult, pressure: Mapping[str, float]
) -> tuple[list[str], list[str]]:
    """Leave out bars that nobody sees, and impose the motion of the outermost rods where none can be followed.

    Parameters
    ----------
    draft : Draft
    images : sequence of (H, W)
        The first photographs, one or two.
    found : ValidationResult
        With the bars that were found.
    pressure : mapping
        Pressures [Pa] by wall: such a wall is there.

    Returns
    -------
    tuple of list of str
        Warnings, and remarks.
    """
    walls, scale, rods = found.walls, found.scale, found.rods
    if walls is None or scale is None or rods is None:
        return [], []
    if (walls.sides != STRAIGHT).any():  # bars follow the discs in their corners
        return [], []
    named = list(zip(walls.name, scale.to_pixels(walls.endpoints[0]), strict=True))
    radius = float(rods.radius.mean()) * scale.mean_size
    seen = np.zeros(len(named), np.bool_)
    if len(images) > 1:
        texture, edge = can_be_followed((images[0], images[1]), walls.endpoints[0], scale, radius)
        if (seen := texture | edge).all():
            names = _listed(named, ~texture)
            return [], [f"Bars without paint are followed by their edges: {names}."] if names else []
    barred = seen | [name in pressure or bars.shows_edge(images[0], line, rods) for name, line in named]
    followed = seen if len(images) > 1 else barred  # of one photograph nothing is followed
    if followed.all():
        return [], []
    if barred.sum() >= FEWEST_BARS and followed[barred].all():
        edits.set_walls(draft, found, [named[w] for w in np.flatnonzero(barred)], "sides without a bar left out")
        open_at = _listed(named, ~barred)
        return [
            f"No bar is seen at {open_at}: the packing is open there. Draw it by rodsight open if there is one."
        ], []
    if len(images) > 1:
        fact = f"Bars {_listed(named, ~seen)} show nothing by which they could be followed to the second photograph"
    else:
        fact = f"No bar is seen at {_listed(named, ~barred)}"
    if pressure:
        return [f"{fact}: give the ends of all bars in every photograph in walls.csv, or [walls] track = false."], []
    instead = _impose_outer_rods(draft, found)
    return [f"{fact}: {instead} If they are at rest, draw them by rodsight open and set [walls] track = false."], []


def _listed(named: Sequence[tuple[str, Array]], rows: NDArray[np.bool_]) -> str:
    """Return the names of some of the walls, quoted."""
    return ", ".join(repr(named[w][0]) for w in np.flatnonzero(rows).tolist())


def _impose_outer_rods(draft: Draft, found: ValidationResult) -> str:
    """Remove the walls, and let the outermost rods be the boundary; return the end of a sentence on it."""
    edits.set_walls(draft, found, [], "no walls")
    draft.set_keys("boundary", {"boundary.grains": "outer"})
    return 'the motion of the outermost rods is imposed instead ([boundary] grains = "outer").'
