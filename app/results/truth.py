"""True contact forces on the rows of a run's results, and how well the run agrees with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array
from solver.contacts.contacts import ContactSource
from solver.statistics.agreement import Agreement, compare_forces

from ..errors import InputError
from ..experiment.reading.input_files import InputFiles
from ..experiment.reading.tables import check_frames, check_unique, read_table
from ..tracks import Tracks
from .results import Results, TruthContacts

TRUTH_COLUMNS = ("frame", "i", "j", "fn", "ft")
CLOSE = 0.5  # of a radius: a grain whose true place is nearer than this is that grain


def read_truth(
    file: Path,
    ids: NDArray[np.int64],
    walls: tuple[str, ...],
    *,
    first_frame: int,
    frame_count: int,
    unseen: NDArray[np.int64] | None = None,
    inputs: InputFiles | None = None,
) -> TruthContacts:
    """Read a table of true contact forces.

    ids (n,): the truth's name of every grain, negative for grains that it does not know. Frames count from
    first_frame; others, and contacts of grains that have no row, are passed over. unseen: names of grains that have
    none, of `true_ids`. inputs: what the file is read by. Raises InputError for a grain or wall that is not known at
    all.
    """
    table = read_table(file, TRUTH_COLUMNS, inputs)
    frame, i = table.integers("frame") - first_frame, table.integers("i")
    body = {int(each): row for row, each in enumerate(ids) if each >= 0}
    wall = {name: len(ids) + row for row, name in enumerate(walls)}
    pair = np.empty((len(table), 2), np.int64)
    for row, text in enumerate(table.text("j")):
        pair[row, 0] = body.get(int(i[row]), -1)
        if text in wall:
            pair[row, 1] = wall[text]
        else:
            try:
                pair[row, 1] = body.get(int(text), -1)
            except ValueError:
                raise table.error(row, "j", "is neither a grain's id nor the name of a wall") from None
    if not np.any(ids < 0):  # every grain has a name, so that an unknown one is a mistake
        for column, values in (("i", pair[:, 0]), ("j", pair[:, 1])):
            unknown = np.flatnonzero(values < 0)
            if unseen is not None:
                known_unseen = set(unseen.tolist())
                unknown = unknown[[int(table.text(column)[row]) not in known_unseen for row in unknown]]
            if len(unknown):
                raise table.error(int(unknown[0]), column, "is not the id of a grain")
    # A pair may be listed from either side: f_n and f_t are the same seen from both.
    low, high = pair.min(axis=1), pair.max(axis=1)
    known = low >= 0
    check_unique(table, "j", frame, np.where(known, low, i), np.where(known, high, -1 - np.arange(len(table))))
    fn, ft = table.numbers("fn"), table.numbers("ft")
    keep = np.flatnonzero(known & (frame >= 0) & (frame < frame_count))
    keep = keep[np.argsort(frame[keep], kind="stable")]
    return TruthContacts(frame[keep], low[keep], high[keep], fn[keep], ft[keep])


def true_ids(file: Path) -> NDArray[np.int64]:
    """The ids of all true grains, those that no photograph showed included; file: table frame,id,x,y,theta."""
    return np.unique(read_table(file, ("id",)).integers("id"))


def names_of_told(file: Path, tracks: Tracks, first_frame: int) -> NDArray[np.int64]:
    """The truth's ids of grains (n,) that were told by their own ids: those of inferred rods are found by their place.

    Told positions may have been corrected by more than a radius, as where a scale is wrong, and are not asked.
    An inferred rod that lies where a told one should has no name, nor has the second of two at one place.
    file: table frame,id,x,y,theta of true poses [m, rad].
    """
    names = tracks.id.copy()
    inferred = np.zeros(tracks.grain_count, np.bool_) if tracks.inferred is None else tracks.inferred
    if not inferred.any():
        return names
    frame, ids, place = _read_poses(file)
    here = frame == first_frame
    unseen = here & ~np.isin(ids, tracks.id[~inferred])
    names[inferred] = -1
    rows = np.flatnonzero(inferred & tracks.present[0])
    if unseen.any() and len(rows):
        nearest = _nearest(place[unseen], tracks, rows)
        named = np.where(nearest >= 0, ids[unseen][nearest], -1)
        _, first = np.unique(named, return_index=True)
        names[rows[first]] = named[first]
    return names


def true_names(file: Path, tracks: Tracks, first_frame: int) -> NDArray[np.int64]:
    """The truth's ids of detected grains (n,), found by their place on the run's first frame; −1 for none.

    file: table frame,id,x,y,theta of true poses [m, rad].
    """
    frame, ids, place = _read_poses(file)
    here = frame == first_frame
    if not here.any():
        raise InputError(file, f"frame {first_frame}", "is not there")
    names = np.full(tracks.grain_count, -1, np.int64)
    present = np.flatnonzero(tracks.present[0])
    nearest = _nearest(place[here], tracks, present)
    names[present] = np.where(nearest >= 0, ids[here][nearest], -1)
    taken = np.sort(names[names >= 0])
    twice = np.flatnonzero(np.diff(taken) == 0)
    if len(twice):
        raise InputError(file, f"id {taken[twice[0]]}", "is the nearest true grain of two detected ones")
    return names


def _read_poses(file: Path) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Frame (m,), id (m,) and place (m, 2) [m] of true poses."""
    table = read_table(file, ("frame", "id", "x", "y", "theta"))
    frame, ids = table.integers("frame"), table.integers("id")
    check_frames(table, frame)
    check_unique(table, "id", frame, ids)
    if ids.min() < 0:
        raise table.error(int(ids.argmin()), "id", "is negative")
    return frame, ids, np.column_stack([table.numbers("x"), table.numbers("y")])


def _nearest(place: Array, tracks: Tracks, rows: NDArray[np.intp]) -> NDArray[np.int64]:
    """Which of some places (m, 2) [m] these rows of grains (r,) have on the first frame; −1: none is near enough."""
    found = KDTree(place).query(tracks.position[0, rows])
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    return np.where(distance < CLOSE * tracks.radius[rows], nearest, -1)


def score(results: Results, truth: TruthContacts) -> list[Agreement]:
    """Agreement with the truth in every frame."""
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
    """Lists per frame, None where a quantity does not exist: the public `accuracy` object."""
    rows = [asdict(each) for each in agreement]
    keys = ("r_fn", "r_ft", "relative_l2", "scale", "contact_precision", "contact_recall")
    return {key: [_or_none(row[key]) for row in rows] for key in keys}


def correlations(agreement: Sequence[Agreement]) -> Array:
    """r(f_n) of every frame (f,)."""
    return np.array([each.r_fn for each in agreement])


def _or_none(value: float) -> float | None:
    return round(value, 6) if np.isfinite(value) else None
