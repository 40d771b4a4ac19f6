"""Poses that contradict other photographs: of rods that jump, are misplaced, or have exchanged their names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....process.counts import state_count
from ....solver.bodies.grains import Array
from ....solver.bodies.walls import Walls
from ....solver.contacts.contacts import Contacts, detect_contacts, measure_pairs
from ....solver.inferred.exchanged_ids import find_exchanged_ids
from ....solver.inferred.interpolated_poses import NEIGHBOURS, interpolate_poses, neighbour_rows
from ....solver.robust_scale import SD_OVER_MAD
from ....tracks import Tracks, TrackStatus, WallTracks
from ...snapshots import grains_of

JUMP = 6.0  # robust standard deviations of a rod's deviation from its neighbours beyond which it jumps …
NOISE = 6.0  # … and standard deviations of a position
RETURN = 0.5  # a jump that is undone leaves at most this fraction of it
PENETRATION = 0.15  # of the jump: a wrong pose overlaps another body by more of it, a rod that really moved does not
BLAMED = 2.0  # robust standard deviations of the deviation of a rod whose pose is impossible
DEEP = 6.0  # robust standard deviations above the usual overlap, and NOISE of a position: more is impossible
ONE_SIDED = 1.2  # times the least jump, where only photographs on one side show the motion
PASSES = 8  # an outlier hides the one before or after it until it is interpolated
MOST = 0.1  # of the poses of a frame: where more jump, the packing rearranges
MISPLACED = 0.25  # of a radius, and JUMP deviations among the neighbours: a suspect pose so far from theirs is wrong
FEW = 0.02  # of the rods: more repeat their poses in a photograph that is a copy, or whose rods rest
NAMED, LISTED = 6, 4  # rods of one photograph, and photographs, that a sentence lists


def remove_outliers(
    tracks: Tracks, walls: WallTracks | None = None, placed: NDArray[np.bool_] | None = None
) -> tuple[Tracks, str]:
    """Take out poses that are repeated or misplaced, or of rods that jump for one photograph; they are lost there.

    Parameters
    ----------
    tracks : Tracks
    walls : WallTracks, optional
        Rods cannot be beyond them.
    placed : bool array (f, n), optional
        Poses that stay where they are.

    Returns
    -------
    tracks : Tracks
        Without the outliers.
    remark : str
        How many there were; empty where there is none.
    """
    free = True if placed is None else ~placed
    repeated = find_repeated(tracks) & free
    tracks = without_poses(tracks, repeated)
    misplaced = find_misplaced(tracks) & free
    tracks = without_poses(tracks, misplaced)
    outlier = find_outliers(tracks, walls) & free
    tracks = without_poses(tracks, outlier)
    remarks = (
        _describe(repeated, "repeats the one before digit by digit", "repeat the ones before digit by digit"),
        _describe(
            misplaced, "is a suspect match far from its neighbours", "are suspect matches far from their neighbours"
        ),
        _describe(outlier, "jumps against the neighbours", "jump against the neighbours"),
    )
    return tracks, "; ".join(filter(None, remarks))


def _describe(wrong: NDArray[np.bool_], reason_of_one: str, reason_of_many: str) -> str:
    """State how many poses (f, n) count as lost, and why; empty for none."""
    count, frames = int(wrong.sum()), int(wrong.any(axis=1).sum())
    if not count:
        return ""
    reason, counts = (reason_of_one, "it counts") if count == 1 else (reason_of_many, "they count")
    poses, photographs = state_count(count, "pose"), state_count(frames, "photograph")
    return f"{poses} in {photographs} {reason}: {counts} as lost; check these rods"


def restore_exchanged_ids(tracks: Tracks) -> tuple[Tracks, str]:
    """Give every rod the name under which it was seen first, where a tracker has confused names.

    Returns
    -------
    Tracks
    str
        Which rods have the names of which others, and from which photograph on; empty where none has.
    """
    row = find_exchanged_ids(np.where(tracks.present[..., None], tracks.position, np.nan))
    if (row == row[:1]).all():  # nothing to copy
        return tracks, ""
    restored, events = replace(tracks.rearranged(row), given_id=tracks.id[row]), []
    for k in range(1, tracks.frame_count):
        changed = (row[k] != row[k - 1]) & restored.present_in(k)
        if changed.any():
            grains = np.flatnonzero(changed)[:NAMED]
            names = (f"{tracks.id[i]} as {tracks.id[j]}" for i, j in zip(grains, row[k][grains], strict=True))
            events.append(f"{', '.join(names)}{', …' if changed.sum() > NAMED else ''} from photograph {k} on")
    if not events:
        return tracks, ""
    words = "; ".join(events[:LISTED]) + ("; …" if len(events) > LISTED else "")
    return restored, f"rods stand in the table under the names of others, which is undone: {words}"


def without_poses(tracks: Tracks, lost: NDArray[np.bool_]) -> Tracks:
    """The tracks with some poses (f, n) lost; with none of them, themselves."""
    if not lost.any():
        return tracks
    return replace(
        tracks,
        position=np.where(lost[..., None], np.nan, tracks.position),
        rotation=np.where(lost, np.nan, tracks.rotation),
        sigma=np.where(lost, np.nan, tracks.sigma),
        status=np.where(lost, np.uint8(TrackStatus.LOST), tracks.status),
    )


def find_outliers(tracks: Tracks, walls: WallTracks | None = None) -> NDArray[np.bool_]:
    """Find poses that contradict the photographs beside theirs.

    Parameters
    ----------
    tracks : Tracks
    walls : WallTracks, optional

    Returns
    -------
    array (f, n)
        Whether a pose is an outlier.

    Notes
    -----
    The deviation e of a pose is its distance from the mean of the poses before and after, corrected by the median
    deviation of its neighbours from theirs; in the first and last photograph, from the linear continuation. With s the
    robust standard deviation of e over the rods and σ that of a position, it is an outlier if

    - e > max(6 s, 6 σ), the motion before and after cancel to less than e, and it overlaps another rod or a wall by
      0.15 e more than the expected pose does: rods that really jump, as rattlers do, cannot penetrate others; or
    - it overlaps another rod or a wall by 6 robust standard deviations and 6 σ more than rods usually do, and by as
      much more than in the photographs beside it; of the two rods it deviates more, and e > max(2 s, 6 σ). Such a pose
      is impossible, whatever the packing does.

    Of outliers in consecutive photographs that with the greatest deviation is taken first, and interpolated before the
    others are examined again.
    """
    frames, n = tracks.position.shape[:2]
    found = np.zeros((frames, n), np.bool_)
    if frames < 3 or n <= NEIGHBOURS or tracks.boundary is not None:
        return found
    search = _Search(tracks, walls)
    changed: Iterable[int] = range(frames)
    for _ in range(PASSES):
        more = search.examine(changed) & ~found
        rows = np.flatnonzero(more.any(axis=1))
        if not len(rows):
            break
        found |= more
        search.interpolate(found)
        changed = sorted({k for row in rows for k in range(max(row - 2, 0), min(row + 3, frames))})
    return found


def find_repeated(tracks: Tracks) -> NDArray[np.bool_]:
    """Find poses (f, n) that equal those before in every digit, of rods that moved before: trackers repeat lost rods.

    Where more than FEW of the rods do so, the photograph is a copy, or the rods rest and are known without noise; a rod
    that never moves is fixed.
    """
    pose = np.concatenate([tracks.position, np.nan_to_num(tracks.rotation)[..., None]], axis=-1)
    found = np.zeros(tracks.status.shape, np.bool_)
    found[1:] = (pose[1:] == pose[:-1]).all(axis=-1)  # not where there is none
    moved = np.cumsum(tracks.present & ~found, axis=0) > 1
    found &= moved
    found[found.sum(axis=1) > max(FEW * tracks.grain_count, 1.0)] = False
    return found


def find_misplaced(tracks: Tracks) -> NDArray[np.bool_]:
    """Find poses (f, n) that the tracker suspects, far from where neighbours and other photographs put them.

    Notes
    -----
    A match of little certainty may be on another part of the picture; from then on the rod seems to move with its
    neighbours again. Its place is expected from the nearest photographs in which it is certain, and from the motion of
    its neighbours since. Where more than MOST of the poses of a photograph are suspect, as in a blurred one, all stay.
    """
    present = tracks.present
    suspect = present & (tracks.status == TrackStatus.SUSPECT)
    found = np.zeros_like(suspect)
    suspect[suspect.mean(axis=1) > MOST] = False
    if tracks.boundary is not None or not suspect.any():
        return found
    certain = np.where((present & ~suspect)[..., None], tracks.position, np.nan)
    seen = np.isfinite(certain[..., 0])
    for k in np.flatnonzero(suspect.any(axis=1)).tolist():
        rows = np.flatnonzero(suspect[k] & seen.any(axis=0))
        if len(rows) and seen[k].sum() > NEIGHBOURS:
            expected = interpolate_poses(tracks.time, certain, k, rows)
            distance = np.linalg.norm(tracks.position[k, rows] - expected.place, axis=1)
            found[k, rows] = distance > np.maximum(MISPLACED * tracks.radius[rows], JUMP * expected.sd)
    return found


class _Search:
    """Positions with the outliers found so far interpolated, and what the others show."""

    def __init__(self, tracks: Tracks, walls: WallTracks | None) -> None:
        self._tracks, self._walls = tracks, walls
        self._grains = grains_of(tracks)
        self._position = tracks.position.copy()
        self._jump = np.full_like(tracks.position, np.nan)  # from where a rod is expected
        self._suspect = np.zeros(tracks.status.shape, np.bool_)
        self._outlier = np.zeros(tracks.status.shape, np.bool_)  # found so far

        self._deviation = np.full(tracks.status.shape, np.nan)  # [m] sizes of the jumps
        # [m] motions from the photograph before to the one after, less those of the neighbours; NaN in the first, last
        self._moved = np.full(tracks.status.shape, np.nan)

    def examine(self, frames: Iterable[int]) -> NDArray[np.bool_]:
        """Poses (f, n) that are outliers, after a new examination of some frames."""
        frames = list(frames)
        for k in frames:
            self._compare_with_neighbours(k)
        for k in frames:
            self._suspect[k] = self._contradicted(k)
        size = np.where(self._suspect, self._deviation, -1.0)
        greatest = self._suspect.copy()
        greatest[1:] &= size[1:] >= size[:-1]
        greatest[:-1] &= size[:-1] >= size[1:]
        greatest[greatest.mean(axis=1) > MOST] = False
        return greatest

    def interpolate(self, outlier: NDArray[np.bool_]) -> None:
        """Put outliers (f, n) where they are expected by the other photographs and by their neighbours."""
        self._outlier = outlier
        measured = np.where(outlier[..., None], np.nan, self._tracks.position)
        for k in np.flatnonzero(outlier.any(axis=1)).tolist():
            seen = np.isfinite(measured[:, outlier[k], 0]).any(axis=0)
            poses = interpolate_poses(self._tracks.time, measured, k, np.flatnonzero(outlier[k])[seen])
            self._position[k, poses.row] = poses.place

    def _continued(self, k: int) -> Array:
        """Mean of the positions before and after; in the first and last frame their linear continuation (n, 2)."""
        position, last = self._position, len(self._position) - 1
        if k == 0:
            return 2.0 * position[1] - position[2]
        if k == last:
            return 2.0 * position[k - 1] - position[k - 2]
        return 0.5 * (position[k - 1] + position[k + 1])

    def _compare_with_neighbours(self, k: int) -> None:
        """Set the jump of every rod, its size, and the motion past photograph k, less those of its neighbours."""
        position, expected, last = self._position, self._continued(k), len(self._position) - 1
        changes = [position[k] - expected]
        if 0 < k < last:
            changes.append(position[k + 1] - position[k - 1])
        rows, near = np.empty(0, np.int64), np.empty(0, np.int64)
        for change in changes:
            relative, known = np.full_like(change, np.nan), np.flatnonzero(np.isfinite(change[:, 0]))
            if len(known) > NEIGHBOURS:
                if not np.array_equal(known, rows):
                    rows, near = known, neighbour_rows(expected, known, known)
                relative[known] = change[known] - np.median(change[near], axis=1)
            if change is changes[0]:
                self._jump[k], self._deviation[k] = relative, np.linalg.norm(relative, axis=1)
            else:
                self._moved[k] = np.linalg.norm(relative, axis=1)

    def _contradicted(self, k: int) -> NDArray[np.bool_]:
        """Which poses of a frame are outliers (n,)."""
        known = np.isfinite(self._jump[k, :, 0])
        if not known.any():
            return known
        sd, noise = SD_OVER_MAD * float(np.median(self._deviation[k][known])), NOISE * self._tracks.sigma[k]
        bodies = walls_in(self._walls, k)
        return self._returns(k, JUMP * sd, noise, bodies) | self._is_impossible(k, BLAMED * sd, noise, bodies)

    def _returns(self, k: int, least: float, noise: Array, bodies: Walls) -> NDArray[np.bool_]:
        """Which rods jump and return, and overlap others more than where they are expected (n,)."""
        deviation, position, last = self._deviation[k], self._position, len(self._position) - 1
        if k == 0:
            return np.zeros(len(deviation), np.bool_)
        jumps = deviation > np.maximum(ONE_SIDED * least if k == last else least, noise)
        if k < last:
            jumps &= self._moved[k] < 2.0 * RETURN * deviation
        if not jumps.any():
            return jumps
        expected = position[k] - np.where(jumps[:, None], self._jump[k], 0.0)
        here, there = (self._overlapping(each, bodies) for each in (position[k], expected))
        change = _greatest_overlap(here, jumps) - _greatest_overlap(there, jumps)
        return jumps & (change > PENETRATION * deviation)

    def _overlapping(self, position: Array, bodies: Walls) -> Contacts:
        """Pairs that overlap where the rods are at these positions (n, 2) [m]."""
        return detect_contacts(self._grains, position, np.isfinite(position[:, 0]), bodies, 0.0)

    def _is_impossible(self, k: int, least: float, noise: Array, bodies: Walls) -> NDArray[np.bool_]:
        """Which rods overlap others by more than in the photographs beside, and deviate more than these (n,)."""
        position, found = self._position, np.zeros(len(noise), np.bool_)
        near = self._overlapping(position[k], bodies)
        if not near.count:
            return found
        depth = _greatest_overlap(near, found)[np.isfinite(position[k, :, 0])]
        middle = float(np.median(depth))
        spread = SD_OVER_MAD * float(np.median(np.abs(depth - middle)))
        deep = middle + DEEP * spread + float(np.nanmedian(noise))
        near = near.select(near.gap < -deep)
        beside = [each for each in (k - 1, k + 1) if 0 <= each < len(position)]
        if not near.count:
            return found
        others = [self._measured_gaps(near, each) for each in beside]
        new = near.gap < np.fmin.reduce([*others, np.zeros(near.count)]) - deep
        deviation = np.append(np.nan_to_num(self._deviation[k]), -1.0)
        i, j = near.i[new], np.minimum(near.j[new], len(noise))
        worse = np.where(deviation[i] >= deviation[j], i, j)
        found[worse] = True
        return found & (self._deviation[k] > np.maximum(least, noise))

    def _measured_gaps(self, pairs: Contacts, k: int) -> Array:
        """Gaps (c,) [m] of pairs in another frame; NaN where a rod is not measured or is an outlier."""
        measured = np.where(self._outlier[k][:, None], np.nan, self._position[k])
        return measure_pairs(self._grains, measured, walls_in(self._walls, k), pairs.key).gap


def _greatest_overlap(near: Contacts, jumps: NDArray[np.bool_]) -> Array:
    """Greatest overlap (n,) [m] of each rod with a wall or with a rod that does not jump (n,), 0 without one."""
    found, jumping = np.zeros(len(jumps)), np.append(jumps, False)
    i, j, depth = near.i, np.minimum(near.j, len(jumps)), -near.gap
    np.maximum.at(found, i[~jumping[j]], depth[~jumping[j]])
    pair = ~near.with_wall & ~jumping[i]
    np.maximum.at(found, j[pair], depth[pair])
    return found


def walls_in(walls: WallTracks | None, k: int) -> Walls:
    """The walls of a photograph, at rest; none without walls."""
    return Walls.at_rest(np.empty((0, 2, 2))) if walls is None else walls.at_rest(k)
