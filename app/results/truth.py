"""True contact forces on the rows of a run's results, and the agreement of the run with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..experiment.reading.tables import Table, check_frames, check_unique, read_table
from ..process.errors import InputError
from ..process.frame_range import ALL_FRAMES, FrameRange
from ..solver.bodies.grains import Array
from ..solver.contacts.contacts import ContactSource
from ..solver.statistics.agreement import Agreement, compare_forces
from ..tracks import Tracks
from .results import Results, TruthContacts

TRUTH_COLUMNS = ("frame", "i", "j", "fn", "ft")
CLOSE = 0.5  # radii: largest distance between a grain and its true position


def read_truth(
    file: Path | Table,
    ids: NDArray[np.int64],
    walls: tuple[str, ...] | None,
    *,
    frame_count: int,
    frames: FrameRange = ALL_FRAMES,
    unseen: NDArray[np.int64] | None = None,
) -> TruthContacts:
    """Read a table of true contact forces.

    Other frames, and contacts of grains without a row in the results, are ignored.

    Parameters
    ----------
    file
        Table frame,i,j,fn,ft, or its file.
    ids
        Id of every grain in the truth (n,), or in every frame of the truth (f, n); negative for grains that the truth
        does not have.
    walls
        Names of the walls; None: there are neither walls nor another boundary, and contacts with walls are ignored.
    frame_count
        Number of frames to read.
    frames
        Photographs of the results; the returned frames are rows of the results.
    unseen
        Ids of `true_ids`, which the table may contain although no grain of the results has them.

    Raises
    ------
    InputError
        A grain or wall is unknown, or frames count from one.
    """
    table = file if isinstance(file, Table) else read_table(file, TRUTH_COLUMNS)
    number, i = table.integers("frame") - frames.start, table.integers("i")
    if frames == ALL_FRAMES and len(number) and number.min() > 0 and number.max() >= frame_count:
        raise table.error(
            int(number.argmax()), "frame", f"is no photograph: frames count from 0 to {frame_count - 1}, and these "
            f"from {number.min()}",
        )  # fmt: skip
    frame = np.where(number % frames.step == 0, number // frames.step, -1)
    wall = {name: ids.shape[-1] + row for row, name in enumerate(walls or ())}
    at_wall = np.zeros(len(table), np.bool_)  # of an experiment without walls
    bodies = [{int(each): row for row, each in enumerate(names) if each >= 0} for names in np.atleast_2d(ids)]
    body_at = [bodies[k if 0 <= k < len(bodies) else 0] for k in frame.tolist()]
    pair = np.empty((len(table), 2), np.int64)
    pair[:, 0] = [body.get(each, -1) for body, each in zip(body_at, i.tolist(), strict=True)]
    for row, text in enumerate(table.text("j")):
        found = wall.get(text)
        if found is None:
            try:
                found = body_at[row].get(int(text), -1)
            except ValueError:
                at_wall[row], found = walls is None, -1
                if walls is not None:
                    given = "" if walls else ": no walls are given"
                    problem = f"is neither a grain's id nor the name of a wall{given}"
                    raise table.error(row, "j", problem) from None
        pair[row, 1] = found
    if not np.any(ids < 0):  # every grain has an id in the truth, so that an unknown id is a mistake
        for column, values in (("i", pair[:, 0]), ("j", pair[:, 1])):
            unknown = np.flatnonzero((values < 0) & ~(at_wall & (column == "j")))
            if unseen is not None:
                known_unseen = set(unseen.tolist())
                unknown = unknown[[int(table.text(column)[row]) not in known_unseen for row in unknown]]
            if len(unknown):
                raise table.error(int(unknown[0]), column, "is not the id of a grain")
    # A pair may be listed in either order: f_n and f_t are the same in both.
    low, high = pair.min(axis=1), pair.max(axis=1)
    known = low >= 0
    own = np.flatnonzero(known & (low == high))
    if len(own):
        raise table.error(int(own[0]), "j", "is the grain itself")
    check_unique(table, "j", number, np.where(known, low, i), np.where(known, high, -1 - np.arange(len(table))))
    fn, ft = table.numbers("fn"), table.numbers("ft")
    keep = np.flatnonzero(known & (frame >= 0) & (frame < frame_count))
    keep = keep[np.argsort(frame[keep], kind="stable")]
    return TruthContacts(frame[keep], low[keep], high[keep], fn[keep], ft[keep])


def names_in_table(tracks: Tracks) -> NDArray[np.int64]:
    """Return the ids of grains in the given table: (n,), or (f, n) where a tracker has confused names there.

    A truth without a table of true poses has these names.
    """
    return tracks.id if tracks.given_id is None else tracks.given_id


def true_ids(file: Path) -> NDArray[np.int64]:
    """Return the ids of all true grains, including those that no photograph shows; file: table frame,id,x,y,theta."""
    return np.unique(read_table(file, ("id",)).integers("id"))


def names_of_given(file: Path, tracks: Tracks, first_frame: int) -> NDArray[np.int64]:
    """Return the true ids of grains given with ids (n,); inferred rods get the id at their position, −1 for none.

    The positions of given grains are not used, because a correction of the scale may have moved them by more than a
    radius. An inferred rod at the position of a given one gets no id, nor does the second of two at one position.
    file: table frame,id,x,y,theta of true poses [m, rad].
    """
    names = tracks.id.copy()
    inferred = np.zeros(tracks.grain_count, np.bool_) if tracks.inferred is None else tracks.inferred
    if not inferred.any():
        return names
    frame, ids, point = _read_poses(file)
    here = frame == first_frame
    unseen = here & ~np.isin(ids, tracks.id[~inferred])
    names[inferred] = -1
    rows = np.flatnonzero(inferred & tracks.present[0])
    if unseen.any() and len(rows):
        nearest = _nearest(point[unseen], tracks, rows)
        named = np.where(nearest >= 0, ids[unseen][nearest], -1)
        _, first = np.unique(named, return_index=True)
        names[rows[first]] = named[first]
    return names


def true_names(file: Path, tracks: Tracks, first_frame: int) -> NDArray[np.int64]:
    """Return the true ids of detected grains (n,), found by their positions on the run's first frame; −1 for none.

    file: table frame,id,x,y,theta of true poses [m, rad].
    """
    frame, ids, point = _read_poses(file)
    here = frame == first_frame
    if not here.any():
        raise InputError(file, f"frame {first_frame}", "is missing")
    names = np.full(tracks.grain_count, -1, np.int64)
    present = np.flatnonzero(tracks.present[0])
    nearest = _nearest(point[here], tracks, present)
    names[present] = np.where(nearest >= 0, ids[here][nearest], -1)
    taken = np.sort(names[names >= 0])
    twice = np.flatnonzero(np.diff(taken) == 0)
    if len(twice):
        raise InputError(file, f"id {taken[twice[0]]}", "is the nearest true grain of two detected ones")
    return names


def _read_poses(file: Path) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the frame (m,), id (m,) and position (m, 2) [m] of true poses."""
    table = read_table(file, ("frame", "id", "x", "y", "theta"))
    frame, ids = table.integers("frame"), table.integers("id")
    check_frames(table, frame)
    check_unique(table, "id", frame, ids)
    if ids.min() < 0:
        raise table.error(int(ids.argmin()), "id", "is negative")
    return frame, ids, np.column_stack([table.numbers("x"), table.numbers("y")])


def _nearest(point: Array, tracks: Tracks, rows: NDArray[np.intp]) -> NDArray[np.int64]:
    """Return the index of the point (m, 2) [m] nearest to each grain row (r,) on the first frame; −1: none is close."""
    found = KDTree(point).query(tracks.position[0, rows])
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    return np.where(distance < CLOSE * tracks.radius[rows], nearest, -1)


def score(results: Results, truth: TruthContacts) -> list[Agreement]:
    """Return the agreement with the truth in every frame."""
    true = truth.by_frame(results.grains.count + results.walls.count, len(results.frames))
    return [
        compare_forces(
            frame.contacts.key[(listed := frame.source != ContactSource.FORBIDDEN_BY_REVIEWER)],
            np.column_stack([frame.fn, frame.ft])[listed],
            *true[k],
        )
        for k, frame in enumerate(results.frames)
    ]


def accuracy(agreement: Sequence[Agreement]) -> dict[str, list[float | None]]:
    """Return the public `accuracy` object: lists per frame, with None where a quantity does not exist."""
    rows = [asdict(each) for each in agreement]
    keys = ("r_fn", "r_ft", "relative_l2", "scale", "contact_precision", "contact_recall")
    return {key: [_or_none(row[key]) for row in rows] for key in keys}


def correlations(agreement: Sequence[Agreement]) -> Array:
    """Return r(f_n) of every frame (f,)."""
    return np.array([each.r_fn for each in agreement])


def _or_none(value: float) -> float | None:
    return round(value, 6) if np.isfinite(value) else None
