"""Compare two force fields on one packing contact by contact: of two runs, or of a run and its truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..process.counts import state_count
from ..solver.bodies.grains import Array
from ..solver.contacts.contacts import Contacts, measure_contacts
from ..solver.contacts.pairs import make_keys
from ..solver.statistics.agreement import Agreement, compare_forces
from ..solver.statistics.packing_area import packing_area
from ..solver.statistics.stress import friction_angle, love_weber_stress, sums_on_walls, wall_ratio_angle
from .results import Results, TruthContacts

CLOSE = 0.5  # radii: two grains nearer than this are the same one


class DifferentPackingError(ValueError):
    """The two runs are not of the same packing."""


@dataclass(frozen=True, slots=True)
class FieldFrame:
    """The forces of one frame, on the rows of the compared run."""

    contacts: Contacts
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    friction_angle: float  # [rad] asin((σ₁−σ₂)/(σ₁+σ₂))
    wall_ratio_angle: float  # [rad] atan(|T|/N) on the loaded plate, NaN without one


@dataclass(frozen=True, slots=True)
class ComparedField:
    """A force field with its name and frames."""

    name: str
    frames: Sequence[FieldFrame]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Both fields on their common bodies and frames."""

    base: Results  # the first run, its common frames alone
    first: ComparedField
    second: ComparedField  # the reference: errors are relative to it
    agreement: Sequence[Agreement]  # per frame
    notes: tuple[str, ...]  # sentences about parts that could not be compared


def compare_runs(
    a: Results, b: Results, *, names: tuple[str, str] = ("A", "B"), starts: tuple[int, int] = (0, 0)
) -> Comparison:
    """Compare two runs of one packing.

    Grains are matched by their ids, or by their positions where ids denote different grains; walls by their names.

    Parameters
    ----------
    a, b
        The runs; b is the reference.
    names
        Names of the runs.
    starts
        Number of the first frame of each run in its experiment: runs over different frames are compared where they
        overlap.

    Raises
    ------
    DifferentPackingError
        The runs have no common frame, or too few grains are at the same positions.
    """
    offset = starts[1] - starts[0]
    first, stop = max(offset, 0), min(a.tracks.frame_count, b.tracks.frame_count + offset)
    if first >= stop:
        raise DifferentPackingError(f"{names[0]} and {names[1]} have no frame in common")
    base = _frames_of(a, first, stop)
    rows, how = _match_grains(a, b, first, first - offset)
    body = np.concatenate([rows, _match_walls(a, b)])
    frames, dropped = [], 0
    for k in range(first, stop):
        forces = b.frames[k - offset]
        field, lost = _frame_on(base, k - first, body[forces.contacts.i], body[forces.contacts.j], forces.fn, forces.ft)
        statistics = b.statistics[k - offset]
        angles = {"friction_angle": statistics.friction_angle, "wall_ratio_angle": statistics.wall_ratio_angle}
        frames.append(replace(field, **angles))
        dropped += lost
    notes = [how] if how else []
    if stop - first < max(a.tracks.frame_count, b.tracks.frame_count):
        notes.append(f"Only {state_count(stop - first, 'frame')} in both runs.")
    if dropped:
        notes.append(
            f"Left out: {state_count(dropped, 'contact')} of {names[1]} with bodies that {names[0]} does not have."
        )
    return _compared(base, ComparedField(names[1], frames), names[0], notes)


def compare_with_truth(results: Results, truth: TruthContacts, *, name: str) -> Comparison:
    """Compare a run with its truth as the reference."""
    bounds = np.searchsorted(truth.frame, np.arange(len(results.frames) + 1))
    frames = []
    for k in range(len(results.frames)):
        rows = slice(bounds[k], bounds[k + 1])
        field, _ = _frame_on(results, k, truth.i[rows], truth.j[rows], truth.fn[rows], truth.ft[rows])
        frames.append(_with_angles(results, k, field))
    return _compared(results, ComparedField("truth", frames), name, [])


def _compared(base: Results, second: ComparedField, name: str, notes: list[str]) -> Comparison:
    first = ComparedField(
        name,
        [
            FieldFrame(f.contacts, f.fn, f.ft, s.friction_angle, s.wall_ratio_angle)
            for f, s in zip(base.frames, base.statistics, strict=True)
        ],
    )
    agreement = [
        compare_forces(x.contacts.key, _forces(x), y.contacts.key, _forces(y))
        for x, y in zip(first.frames, second.frames, strict=True)
    ]
    return Comparison(base, first, second, agreement, tuple(notes))


def _forces(frame: FieldFrame) -> Array:
    return np.nan_to_num(np.column_stack([frame.fn, frame.ft]))


def _frames_of(results: Results, first: int, stop: int) -> Results:
    return replace(
        results,
        tracks=results.tracks.frames(first, stop),
        walls=results.walls.frames(first, stop),
        frames=[replace(forces, frame=k) for k, forces in enumerate(results.frames[first:stop])],
        statistics=results.statistics[first:stop],
    )


def _match_grains(a: Results, b: Results, frame_a: int, frame_b: int) -> tuple[NDArray[np.int64], str]:
    """Return the row in a of every grain of b (n_b,), −1 for none, and a sentence where ids could not be used."""
    place_a, place_b = a.tracks.position[frame_a], b.tracks.position[frame_b]
    order: NDArray[np.int64] = np.argsort(a.tracks.id)
    at: NDArray[np.int64] = np.minimum(np.searchsorted(a.tracks.id[order], b.tracks.id), len(order) - 1)
    rows: NDArray[np.int64] = order[at]
    rows[a.tracks.id[rows] != b.tracks.id] = -1
    both = (rows >= 0) & b.tracks.present[frame_b] & a.tracks.present[frame_a][rows]
    near = np.linalg.norm(place_b[both] - place_a[rows[both]], axis=1) < CLOSE * b.tracks.radius[both]
    if both.sum() > 0.5 * len(rows) and near.mean() > 0.9:
        return rows, ""
    present_a, present_b = np.flatnonzero(a.tracks.present[frame_a]), np.flatnonzero(b.tracks.present[frame_b])
    found = KDTree(place_a[present_a]).query(place_b[present_b])
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    close = distance < CLOSE * b.tracks.radius[present_b]
    if close.mean() < 0.5:
        raise DifferentPackingError(
            f"only {close.sum()} of {len(present_b)} grains are at the same position in both: not the same packing"
        )
    rows = np.full(len(b.tracks.id), -1, np.int64)
    rows[present_b[close]] = present_a[nearest[close]]
    return (
        rows,
        f"Ids denote different grains in the two runs: {state_count(int(close.sum()), 'grain')} matched by their "
        "positions.",
    )


def _match_walls(a: Results, b: Results) -> NDArray[np.int64]:
    """Return the body in a of every wall of b (w_b,), −1 where no wall has its name."""
    body = {name: a.grains.count + row for row, name in enumerate(a.walls.name)}
    return np.array([body.get(name, -1) for name in b.walls.name], np.int64)


def _frame_on(
    base: Results, frame: int, i: NDArray[np.integer], j: NDArray[np.integer], fn: Array, ft: Array
) -> tuple[FieldFrame, int]:
    """Return forces on bodies of the base (−1: missing) as a frame, and the number of forces left out."""
    known = (i >= 0) & (j >= 0)
    low, high = np.minimum(i, j)[known], np.maximum(i, j)[known]
    order = np.argsort(make_keys(low, high, base.grains.count + base.walls.count), kind="stable")
    walls = base.walls.at_rest(frame)
    contacts = measure_contacts(base.grains, base.tracks.position[frame], walls, low[order], high[order])
    fn, ft = np.asarray(fn)[known][order], np.asarray(ft)[known][order]
    return FieldFrame(contacts, fn, ft, np.nan, np.nan), int((~known).sum())


def _with_angles(base: Results, frame: int, field: FieldFrame) -> FieldFrame:
    position, present = base.tracks.position[frame], base.tracks.present[frame]
    drawable = np.flatnonzero(np.isfinite(field.contacts.normal).all(axis=1))
    contacts, fn, ft = field.contacts.select(drawable), field.fn[drawable], field.ft[drawable]
    # Plates have a load of one: only the fact of a load is used.
    walls = base.walls.at_rest(frame, np.where(base.walls.loaded, 1.0, np.nan))
    area = packing_area(walls, position, present, base.tracks.boundary)
    stress = love_weber_stress(contacts, fn, ft, position, area, 1.0)  # a ratio: the length of the rods cancels
    ratio = wall_ratio_angle(walls, sums_on_walls(contacts, fn, ft))
    return replace(field, friction_angle=friction_angle(stress), wall_ratio_angle=ratio)
