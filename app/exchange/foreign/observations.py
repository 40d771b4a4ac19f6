"""Observations of another program, one row per grain and photograph, and their conversion to tracks in metres, y up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from ...experiment.reading.tables import Table
from ...process.counts import state_count
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...tracks import Tracks, TrackStatus

MAX_ID = 2**53
AXES = "xyz"  # of other programs
MAX_DEPTH = 0.5  # [mean diameter] of the centres of a layer
RADIUS_VARIATION = 0.02  # relative, of a grain's radius over the frames, above which a remark is made


@dataclass(frozen=True, slots=True)
class Observations:
    """Rows in the units, axes and names of the other program."""

    rows: Table  # source rows, for messages; the column `id`
    id_column: str
    frame: Int[np.ndarray, " m"]
    name: tuple[str, ...]  # (m,) of the grain, as written
    position: Float[Array, "m 2"]  # in its unit of length
    angle: Float[Array, " m"]  # [rad] in its axes; NaN where unknown
    radius: Float[Array, " m"]  # in its unit of length; NaN where unknown
    time: Float[Array, " m"] | None = None  # [s]; None: unknown
    remarks: tuple[str, ...] = ()  # on data that could not be converted, one sentence each
    unwrapped: bool = False  # angles are continuous already

    def with_remark(self, remark: str) -> Observations:
        return replace(self, remarks=(*self.remarks, remark))


def read_axes(columns: Mapping[str, str], program: str) -> tuple[str, str, str]:
    """Return the axes of another program that are x and y here, and the third one. Raises InputError."""
    across, up = (columns.get(role, role) for role in "xy")
    for axis in (across, up):
        if axis not in tuple(AXES):
            raise InputError("--columns", axis, f"is not an axis of {program}: x, y or z")
    return across, up, next(axis for axis in AXES if axis not in (across, up))


def turned_to_observer(rotation: Array, axes: tuple[str, str, str]) -> Array:
    """Return rotations about the third axis as seen here: reversed where it points away from the observer."""
    return -rotation if axes[:2] in (("x", "z"), ("y", "x"), ("z", "y")) else rotation


def layer_remarks(axis: str, depth: Array, radius: Array) -> list[str]:
    """Return a remark if coordinates `depth` (m,) along the omitted axis exceed half a mean diameter, else nothing."""
    extent = float(np.ptp(depth))
    if np.isfinite(radius).any() and extent > MAX_DEPTH * 2.0 * float(np.nanmean(radius)):
        return [f"{axis} extends over {extent:g}: this is not a layer of rods, and {axis} is left out."]
    return []


@dataclass(frozen=True, slots=True)
class Convention:
    """Units and axes of another program."""

    unit: float = 1.0  # [m] of its unit of length
    y_down: bool = False
    height: float | None = None  # y that becomes 0 if y points down, in its unit; None: the highest
    interval: float = 1.0  # [s] between frames whose numbers differ by one, if no time is given
    radius: float | None = None  # of all grains, in its unit, if none is given


@dataclass(frozen=True, slots=True)
class ImportedTracks:
    """Tracks, with the frame numbers and grain names of the other program."""

    tracks: Tracks
    number: Int[np.ndarray, " f"]  # of the frames in the other program
    name: tuple[str, ...]  # (n,) of the grains in the other program
    floor: float  # y of the other program that is 0 here, in its unit
    remarks: tuple[str, ...] = field(default=())

    @property
    def renamed(self) -> bool:
        """Whether grains have other names than in the other program."""
        return any(str(new) != old for new, old in zip(self.tracks.id, self.name, strict=True))


def make_tracks(observed: Observations, convention: Convention, precision: float) -> ImportedTracks:
    """Make tracks of observations.

    Frames are numbered from 0 in their order; ids that are not integers are replaced by integers; jumps of angles by 2π
    are removed; a grain's radius is its median.

    Parameters
    ----------
    observed : Observations
    convention : Convention
    precision : float
        Standard deviation of a position [m].

    Raises
    ------
    InputError
        Naming row and value.
    """
    remarks = list(observed.remarks)
    number, frame = np.unique(observed.frame, return_inverse=True)
    ids, names, row = _name_grains(observed.name)
    f, n = len(number), len(ids)
    _refuse_duplicates(observed, frame, row)
    if f > 1 and n > f and n == len(row):
        wrong = "every id occurs in one frame only: they number the rows; link the positions of the same grains first"
        raise InputError(observed.rows.file, f"column {observed.id_column}", wrong)
    if not np.array_equal(number, np.arange(f)):
        even = f < 2 or len(set(np.diff(number).tolist())) == 1
        remarks.append(
            f"Frames are numbered from 0: they were {number[0]} … {number[-1]}"
            + ("" if even else ", with gaps, which are left out")
            + "."
        )
    position, rotation = np.full((f, n, 2), np.nan), np.full((f, n), np.nan)
    radius = np.full((f, n), np.nan)
    points, angle, floor = observed.position, observed.angle, 0.0
    if convention.y_down:
        floor = float(points[:, 1].max()) if convention.height is None else convention.height
        points = np.column_stack([points[:, 0], floor - points[:, 1]])
        angle = -angle
    position[frame, row] = convention.unit * points
    rotation[frame, row] = angle
    radius[frame, row] = convention.unit * observed.radius
    rotation, jumped = (rotation, 0) if observed.unwrapped else _unwrap(rotation)
    if jumped:
        remarks.append(f"Jumps by 2π were removed from the angles of {state_count(jumped, 'grain')}.")
    known = np.isfinite(rotation).any(axis=0) if n else np.zeros(0, np.bool_)
    if not known.all():
        which = "is" if not known.any() else f"of {state_count(int((~known).sum()), 'grain')} is"
        remarks.append(f"The rotation {which} unknown.")
    present = np.isfinite(position).all(axis=2)
    tracks = Tracks(
        id=ids,
        radius=_one_radius(observed, radius, names, convention, remarks),
        time=_times(observed, frame, number, convention),
        position=position,
        rotation=rotation,
        sigma=np.where(present, precision, np.nan),
        zncc=np.full((f, n), np.nan),
        status=np.where(present, TrackStatus.GIVEN, TrackStatus.LOST).astype(np.uint8),
    )
    if missing := int((~present).sum()):
        remarks.append(f"{state_count(missing, 'pose')} lost: not every grain is in every frame.")
    imported = ImportedTracks(tracks, number, names, floor, tuple(remarks))
    if imported.renamed:
        renamed = f"Ids that are not integers are replaced by 0 … {n - 1}: see ids.csv."
        return replace(imported, remarks=(*remarks, renamed))
    return imported


def _name_grains(written: tuple[str, ...]) -> tuple[NDArray[np.int64], tuple[str, ...], NDArray[np.intp]]:
    """Return ids (n,), names (n,), and the grain (m,) of every row: integers keep their value, others are numbered."""
    names = list(dict.fromkeys(written))
    whole = [_whole(each) for each in names]
    if all(value is not None for value in whole):
        by_value: dict[int, str] = {}
        for value, name in zip(whole, names, strict=True):
            by_value.setdefault(value, name)  # type: ignore[arg-type]
        values = sorted(by_value)
        at = {value: k for k, value in enumerate(values)}
        grain = {name: at[value] for name, value in zip(names, whole, strict=True)}  # type: ignore[index]
        ids = np.array(values, np.int64)
        return ids, tuple(str(value) for value in values), np.array([grain[each] for each in written], np.intp)
    at = {name: k for k, name in enumerate(names)}
    return np.arange(len(names), dtype=np.int64), tuple(names), np.array([at[each] for each in written], np.intp)


def _whole(text: str) -> int | None:
    """Parse an integer, also one written as 3.0; None for anything else."""
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
    return value if abs(value) <= MAX_ID else None


def _refuse_duplicates(observed: Observations, frame: NDArray[np.intp], row: NDArray[np.intp]) -> None:
    pair = np.stack([frame, row], axis=1)
    _, first = np.unique(pair, axis=0, return_index=True)
    if len(first) < len(pair):
        again = int(np.setdiff1d(np.arange(len(pair)), first)[0])
        raise observed.rows.error(again, observed.id_column, f"occurs twice in frame {observed.frame[again]}")


def _unwrap(rotation: Array) -> tuple[Array, int]:
    """Remove jumps by 2π from rotations (f, n) [rad]; also return the number of grains that had jumps."""
    jumped = 0
    rotation = rotation.copy()
    for column in rotation.T:
        known = np.flatnonzero(np.isfinite(column))
        if len(known) < 2:
            continue
        smooth = np.unwrap(column[known])
        jumped += bool(np.any(np.abs(smooth - column[known]) > 1.0))
        column[known] = smooth
    return rotation, jumped


def _one_radius(
    observed: Observations, radius: Array, names: tuple[str, ...], convention: Convention, remarks: list[str]
) -> Array:
    """Return one radius (n,) [m] for every grain from those of its frames (f, n) [m]."""
    known = np.isfinite(radius).any(axis=0)
    if convention.radius is not None:
        radius = np.where(known, radius, convention.unit * convention.radius)
    elif not known.all():
        missing = names[int(np.flatnonzero(~known)[0])]
        grains = state_count(int((~known).sum()), "grain")
        raise InputError(
            observed.rows.file, "", f"gives no radius of {grains} (the first: {missing}): name its "
            "column, radius=… or diameter=…, or give --radius"
        )  # fmt: skip
    median = np.nanmedian(radius, axis=0)
    if len(median) and not median.min() > 0.0:
        bad = int(np.argmin(median))
        raise InputError(observed.rows.file, f"id {names[bad]}", f"has radius {median[bad] / convention.unit:g}")
    variation = np.nanmax(radius, axis=0) - np.nanmin(radius, axis=0)
    if varying := int((variation > RADIUS_VARIATION * median).sum()):
        remarks.append(
            f"The radius of {state_count(varying, 'grain')} varies by more than {RADIUS_VARIATION:.0%}: the median is "
            "used."
        )
    return median


def _times(observed: Observations, frame: NDArray[np.intp], number: NDArray[np.int64], convention: Convention) -> Array:
    if observed.time is None:
        return (number - number[0]) * convention.interval
    time = np.array([np.median(observed.time[frame == k]) for k in range(len(number))])
    late = np.flatnonzero(np.diff(time) <= 0)
    if len(late):
        where = f"frame {number[late[0] + 1]}"
        raise InputError(
            observed.rows.file, where, f"time {time[late[0] + 1]:g} is not after that of the previous frame"
        )
    return time - time[0]
