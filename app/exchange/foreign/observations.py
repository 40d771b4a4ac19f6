"""What another program saw, one row per grain and photograph, and what becomes of it: tracks in metres, y up."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.reading.tables import Table
from ...tracks import Tracks, TrackStatus

GREATEST_ID = 2**53
VARIES = 0.02  # of a grain's radius, from frame to frame, beyond which it is said


@dataclass(frozen=True, slots=True)
class Observations:
    """Rows as the other program counts: in its unit of length, its axes and its names."""

    rows: Table  # where they stand, for complaints; the column `id`
    id_column: str
    frame: Int[np.ndarray, " m"]
    name: tuple[str, ...]  # (m,) of the grain, as it is written
    place: Float[Array, "m 2"]  # in its unit of length
    angle: Float[Array, " m"]  # [rad] in its axes; NaN where unknown
    radius: Float[Array, " m"]  # in its unit of length; NaN where unknown
    time: Float[Array, " m"] | None = None  # [s]; None: unknown
    remarks: tuple[str, ...] = ()  # what could not be carried over, a sentence each
    counted: bool = False  # whole turns are in the angles already: they do not jump

    def with_remark(self, remark: str) -> Observations:
        return replace(self, remarks=(*self.remarks, remark))


@dataclass(frozen=True, slots=True)
class Convention:
    """How another program counts."""

    unit: float = 1.0  # [m] of its unit of length
    y_down: bool = False
    height: float | None = None  # the y that becomes 0, in its unit, where y points down; None: the highest
    interval: float = 1.0  # [s] between frames whose numbers differ by one, where no time is told
    radius: float | None = None  # of all grains, in its unit, where none is told


@dataclass(frozen=True, slots=True)
class Arranged:
    """Tracks, and how to find in them what the other program named otherwise."""

    tracks: Tracks
    number: Int[np.ndarray, " f"]  # of the frames, as the other program counts
    name: tuple[str, ...]  # (n,) of the grains, as the other program writes them
    floor: float  # the other program's y that is 0 here, in its unit
    remarks: tuple[str, ...] = field(default=())

    @property
    def renamed(self) -> bool:
        """Whether grains have other names here than there."""
        return any(str(new) != old for new, old in zip(self.tracks.id, self.name, strict=True))


def arrange(seen: Observations, convention: Convention, precision: float) -> Arranged:
    """Make tracks of observations; precision [m] of a position. Raises InputError naming row and value.

    Frames are numbered from 0 in their order; ids that are no whole numbers become numbers; angles that jump by a
    turn are unwrapped; a grain's radius is its median.
    """
    remarks = list(seen.remarks)
    number, frame = np.unique(seen.frame, return_inverse=True)
    ids, names, row = _name_grains(seen.name)
    f, n = len(number), len(ids)
    _refuse_twice(seen, frame, row)
    if not np.array_equal(number, np.arange(f)):
        even = f < 2 or len(set(np.diff(number).tolist())) == 1
        remarks.append(
            f"Frames are numbered from 0: they were {number[0]} … {number[-1]}"
            + ("" if even else ", with gaps, which are left out")
            + "."
        )
    position, rotation = np.full((f, n, 2), np.nan), np.full((f, n), np.nan)
    radius = np.full((f, n), np.nan)
    place, angle, floor = seen.place, seen.angle, 0.0
    if convention.y_down:
        floor = float(place[:, 1].max()) if convention.height is None else convention.height
        place = np.column_stack([place[:, 0], floor - place[:, 1]])
        angle = -angle
    position[frame, row] = convention.unit * place
    rotation[frame, row] = angle
    radius[frame, row] = convention.unit * seen.radius
    rotation, turned = (rotation, 0) if seen.counted else _unwrap(rotation)
    if turned:
        remarks.append(f"Angles of {turned} grains jumped by turns, and go on without.")
    told = np.isfinite(rotation).any(axis=0) if n else np.zeros(0, np.bool_)
    if not told.all():
        which = "is" if not told.any() else f"of {int((~told).sum())} grains is"
        remarks.append(f"The rotation {which} unknown.")
    present = np.isfinite(position).all(axis=2)
    tracks = Tracks(
        id=ids,
        radius=_one_radius(seen, radius, names, convention, remarks),
        time=_times(seen, frame, number, convention),
        position=position,
        rotation=rotation,
        sigma=np.where(present, precision, np.nan),
        zncc=np.full((f, n), np.nan),
        status=np.where(present, TrackStatus.GIVEN, TrackStatus.LOST).astype(np.uint8),
    )
    if missing := int((~present).sum()):
        remarks.append(f"{missing} poses lost: these grains are missing from some frames.")
    arranged = Arranged(tracks, number, names, floor, tuple(remarks))
    if arranged.renamed:
        also = f"Ids that are no whole numbers have become 0 … {n - 1}: ids.csv says which."
        return Arranged(tracks, number, names, floor, (*remarks, also))
    return arranged


def _name_grains(written: tuple[str, ...]) -> tuple[NDArray[np.int64], tuple[str, ...], NDArray[np.intp]]:
    """Ids (n,), names (n,), and the grain (m,) of every row: whole numbers keep their value, others are counted."""
    names = list(dict.fromkeys(written))
    whole = [_whole(each) for each in names]
    if all(value is not None for value in whole):
        by_value: dict[int, str] = {}
        for value, name in zip(whole, names, strict=True):
            by_value.setdefault(value, name)  # type: ignore[arg-type]
        values = sorted(by_value)
        at = {value: k for k, value in enumerate(values)}
        place = {name: at[value] for name, value in zip(names, whole, strict=True)}  # type: ignore[index]
        ids = np.array(values, np.int64)
        return ids, tuple(str(value) for value in values), np.array([place[each] for each in written], np.intp)
    at = {name: k for k, name in enumerate(names)}
    return np.arange(len(names), dtype=np.int64), tuple(names), np.array([at[each] for each in written], np.intp)


def _whole(text: str) -> int | None:
    """A whole number, also one written as 3.0; None for anything else."""
    try:
        value = int(text)
    except ValueError:
        try:
            number = float(text)
        except ValueError:
            return None
        if not (np.isfinite(number) and number == int(number)):
            return None
        value = int(number)
    return value if abs(value) <= GREATEST_ID else None


def _refuse_twice(seen: Observations, frame: NDArray[np.intp], row: NDArray[np.intp]) -> None:
    pair = np.stack([frame, row], axis=1)
    _, first = np.unique(pair, axis=0, return_index=True)
    if len(first) < len(pair):
        again = int(np.setdiff1d(np.arange(len(pair)), first)[0])
        raise seen.rows.error(again, seen.id_column, f"stands twice in frame {seen.frame[again]}")


def _unwrap(rotation: Array) -> tuple[Array, int]:
    """Rotations (f, n) [rad] without jumps of whole turns between the frames that show a grain; how many had such."""
    turned = 0
    rotation = rotation.copy()
    for column in rotation.T:
        told = np.flatnonzero(np.isfinite(column))
        if len(told) < 2:
            continue
        smooth = np.unwrap(column[told])
        turned += bool(np.any(np.abs(smooth - column[told]) > 1.0))
        column[told] = smooth
    return rotation, turned


def _one_radius(
    seen: Observations, radius: Array, names: tuple[str, ...], convention: Convention, remarks: list[str]
) -> Array:
    """A radius (n,) [m] for every grain, of those (f, n) [m] that its frames tell."""
    told = np.isfinite(radius).any(axis=0)
    if convention.radius is not None:
        radius = np.where(told, radius, convention.unit * convention.radius)
    elif not told.all():
        lacking = names[int(np.flatnonzero(~told)[0])]
        raise InputError(
            seen.rows.file, "", f"tells no radius of {int((~told).sum())} grains (the first: {lacking}): name its "
            "column, radius=… or diameter=…, or give --radius"
        )  # fmt: skip
    one = np.nanmedian(radius, axis=0)
    if len(one) and not one.min() > 0.0:
        bad = int(np.argmin(one))
        raise InputError(seen.rows.file, f"id {names[bad]}", f"has radius {one[bad] / convention.unit:g}")
    spread = np.nanmax(radius, axis=0) - np.nanmin(radius, axis=0)
    if varying := int((spread > VARIES * one).sum()):
        remarks.append(f"The radius of {varying} grains varies from frame to frame by over {VARIES:.0%}: its median.")
    return one


def _times(seen: Observations, frame: NDArray[np.intp], number: NDArray[np.int64], convention: Convention) -> Array:
    if seen.time is None:
        return (number - number[0]) * convention.interval
    time = np.array([np.median(seen.time[frame == k]) for k in range(len(number))])
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        where = f"frame {number[late[0] + 1]}"
        raise InputError(seen.rows.file, where, f"time {time[late[0] + 1]:g} is not after that of the frame before it")
    return time - time[0]
