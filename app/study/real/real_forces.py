"""Inferred forces beside measured ones: photoelastic discs tell theirs twice, and neither time exactly.

What nobody who balances forces can exceed is measured first: how well the two readings of a contact agree, and how near
to them any field in balance comes. Then the run's own forces and those that need no motion are held against them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float

from solver.baselines.still_forces import estimate_still
from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, ContactSource, measure_pairs
from solver.contacts.pairs import Keys, join_keys, recall, split_keys
from solver.convex.program import assemble_balance, polish
from solver.detection.precision import measure_precision
from solver.statistics.agreement import compare_forces, pearson
from solver.statistics.stress import love_weber_stress, principal_stresses

from ...errors import InputError
from ...experiment.reading.tables import read_table
from ...inference.snapshots import make_snapshots
from ...results.results import Results, TruthContacts
from ..baselines import packing_of

WAYS = ("ours", "static", "overlap", "uniform", "ceiling")  # of finding a field; the last knows the truth


@dataclass(frozen=True, slots=True)
class Field:
    """Forces of one frame, on contacts of their own."""

    contacts: Contacts  # (c,)
    force: Float[Array, "c 2"]  # f_n, f_t, in a unit of its own

    @property
    def key(self) -> Keys:
        return self.contacts.key

    def normal_alone(self) -> Field:
        """Without tangential forces, which fringes hardly tell."""
        return Field(self.contacts, self.force * np.array([1.0, 0.0]))


@dataclass(frozen=True, slots=True)
class Agreement:
    """How one field of a frame agrees with the truth; NaN where a number does not exist."""

    r: float  # of f_n over all near pairs and all that either side names
    matched: float  # of f_n over the contacts that truly bear
    pressure: float  # of the grains' pressures
    direction: float  # [°] of its own larger principal stress, 0 … 180


@dataclass(frozen=True, slots=True)
class RealFrame:
    """One frame's forces held against measured ones."""

    frame: int
    ours: Agreement
    static: Agreement
    overlap: Agreement
    uniform: Agreement
    ceiling: Agreement  # of the field in balance that is nearest to the truth
    direction: float  # [°] the truth's own
    sides: float  # correlation of the two readings of a contact; NaN where there is one
    precision: float  # of the contacts that carry force in the run, the share that truly bear
    recall: float  # of those that truly bear, the share that the run lists

    def turned(self, way: str) -> float:
        """By how much a field's principal direction is off [°], −90 … 90."""
        return float((getattr(self, way).direction - self.direction + 90.0) % 180.0 - 90.0)


@dataclass(frozen=True, slots=True)
class RealStudy:
    """A run held against measured forces, frame by frame, and the fields of one frame to be drawn."""

    name: str
    frames: tuple[RealFrame, ...]
    shown: int  # the frame of the fields
    truth: Field
    drawn: dict[str, Field]  # by way
    position: Float[Array, "n 2"]  # [m] of the grains in that frame
    radius: Float[Array, " n"]  # [m]


def study_real(results: Results, truth: TruthContacts, sides: Sequence[float], shown: int | None = None) -> RealStudy:
    """Hold every frame against its measured forces; sides: correlation of both readings in every frame, or NaN.

    shown: the frame to be drawn; by default the middle one.
    """
    packing, snapshots = packing_of(results), make_snapshots(results.tracks, results.walls)
    true = truth.by_frame(results.grains.count + results.walls.count, len(results.frames))
    measured = measure_precision(packing.grains, snapshots)
    shown = len(snapshots) // 2 if shown is None else shown
    if not 0 <= shown < len(snapshots):
        raise InputError("--frame", str(shown), f"is not one of the {len(snapshots)} frames")
    rows: list[RealFrame] = []
    kept: tuple[Field, dict[str, Field]] | None = None
    for k, frame in enumerate(results.frames):
        noise = max(snapshots[k].sigma, 0.0 if measured is None else measured.sigma)
        order = np.argsort(true[k][0])
        key, force = true[k][0][order], true[k][1][order]
        exact = Field(_measure(packing, snapshots[k], key), force)
        still = estimate_still(packing, snapshots, k, noise)
        listed = frame.source != ContactSource.FORBIDDEN_BY_REVIEWER
        ours = Field(frame.contacts.select(listed), np.column_stack([frame.fn, frame.ft])[listed])
        made = {
            "ours": ours,
            "static": Field(still.contacts, still.balanced),
            "overlap": Field(still.contacts, still.overlapping),
            "uniform": Field(still.contacts, still.uniform),
            "ceiling": _nearest_balance(packing, snapshots[k], exact, ours.contacts, still.near),
        }
        rows.append(_compare(k, made, exact, still.near, snapshots[k], len(packing.grains.radius), sides[k]))
        if k == shown:
            kept = exact, made
    assert kept is not None
    return RealStudy(
        results.name, tuple(rows), shown, *kept, snapshots[shown].position, packing.grains.radius
    )  # fmt: skip


def correlate_sides(file: Path, first_frame: int, frame_count: int) -> list[float]:
    """Correlation of the two readings of f_n in every frame; NaN where the table has but one."""
    table = read_table(file, ("frame",), optional=("fn_i", "fn_j"))
    frame = table.integers("frame") - first_frame
    one, two = table.numbers_if_told("fn_i"), table.numbers_if_told("fn_j")
    both = np.isfinite(one) & np.isfinite(two)
    return [pearson(one[here], two[here]) for k in range(frame_count) for here in [both & (frame == k)]]


def as_json(study: RealStudy) -> dict[str, object]:
    """Plain values, None where a number does not exist: a list per frame, and the means."""
    names = [each.name for each in fields(Agreement)]
    ways = {
        way: {name: [_plain(getattr(getattr(row, way), name)) for row in study.frames] for name in names}
        | {"turned": [_plain(row.turned(way)) for row in study.frames]}
        for way in WAYS
    }
    own = {
        name: [_plain(getattr(row, name)) for row in study.frames]
        for name in ("direction", "sides", "precision", "recall")
    }
    mean = {
        way: {name: mean_of([getattr(getattr(row, way), name) for row in study.frames]) for name in names[:3]}
        | {"turned": mean_of([abs(row.turned(way)) for row in study.frames])}
        for way in WAYS
    }
    return {"frame": [row.frame for row in study.frames], **own, **ways, "mean": mean}


def mean_of(values: Sequence[float]) -> float | None:
    """Mean of those that exist; None without any."""
    known = [value for value in values if np.isfinite(value)]
    return round(float(np.mean(known)), 6) if known else None


def _plain(value: float) -> float | None:
    return round(float(value), 6) if np.isfinite(value) else None


def _measure(packing: Packing, snapshot: Snapshot, key: Keys) -> Contacts:
    return measure_pairs(packing.grains, snapshot.position, packing.walls(snapshot.endpoints), key)


def _nearest_balance(packing: Packing, snapshot: Snapshot, exact: Field, listed: Contacts, near: Keys) -> Field:
    """The field in balance inside the Coulomb cone that is nearest to the true normal forces, knowing them.

    On all contacts between grains that are true or listed by the run. Grains that are not held from all round by near
    ones lie at the boundary: what presses on them from there is not known, and they need not be in balance.
    """
    grains, n, bodies = packing.grains, packing.grains.count, exact.contacts.body_count
    key = join_keys(listed.key, exact.key)
    key = key[split_keys(key, bodies)[1] < n]
    contacts = _measure(packing, snapshot, key)
    fn = recall(key, exact.key, exact.force[:, 0], fill=0.0)
    if not fn.any():
        return Field(contacts, np.full((contacts.count, 2), np.nan))
    between = near[split_keys(near, bodies)[1] < n]
    inner = snapshot.present & _enclosed(_measure(packing, snapshot, between), n)
    balance = assemble_balance(
        contacts, grains, Walls.at_rest(np.empty((0, 2, 2))), present=inner,
        friction=packing.material.friction_at(contacts.with_wall), force_unit=float(fn[fn > 0.0].mean()),
        gravity=packing.material.gravity, wall_normal_total=float(fn[contacts.gauge].sum()),
    )  # fmt: skip
    found = polish(balance, fn, np.zeros(contacts.count))
    if not found.converged:
        return Field(contacts, np.full((contacts.count, 2), np.nan))
    return Field(contacts, np.column_stack([found.fn, found.ft]))


def _enclosed(contacts: Contacts, count: int) -> np.ndarray:
    """Grains (n,) that contacts hold from all round: no half plane is without one. Others lie at the boundary."""
    pair = ~contacts.with_wall
    angle = np.arctan2(contacts.normal[:, 1], contacts.normal[:, 0])
    grain = np.concatenate([contacts.i, contacts.j[pair]])
    towards = np.concatenate([angle, angle[pair] + np.pi]) % (2.0 * np.pi)
    order = np.lexsort([towards, grain])
    grain, towards = grain[order], towards[order]
    enclosed = np.zeros(count, np.bool_)
    for row in np.unique(grain):
        own = towards[grain == row]
        gaps = np.diff(np.append(own, own[0] + 2.0 * np.pi))
        enclosed[row] = len(own) > 1 and bool(gaps.max() <= np.pi)
    return enclosed


def _compare(
    k: int, made: dict[str, Field], exact: Field, near: Keys, snapshot: Snapshot, count: int, sides: float
) -> RealFrame:
    pairs = join_keys(near, made["ours"].key, exact.key)
    true = recall(pairs, exact.key, exact.force[:, 0])
    pressure = _pressure(exact, count)
    bearing = exact.force[:, 0] > 0.0
    found = {}
    for way, field in made.items():
        on_true = recall(exact.key[bearing], field.key, field.force[:, 0])
        found[way] = Agreement(
            pearson(recall(pairs, field.key, field.force[:, 0]), true),
            pearson(on_true, exact.force[bearing, 0]),
            pearson(_pressure(field, count), pressure),
            _direction(field, snapshot.position),
        )
    ours = made["ours"]
    carrying = ours.force[:, 0] > 0.0
    agreement = compare_forces(ours.key[carrying], ours.force[carrying], exact.key, exact.force)
    listed = compare_forces(ours.key, ours.force, exact.key, exact.force)
    return RealFrame(
        k, **found, direction=_direction(exact.normal_alone(), snapshot.position), sides=sides,
        precision=agreement.contact_precision, recall=listed.contact_recall,
    )  # fmt: skip


def _pressure(field: Field, count: int) -> Array:
    """Sum of f_n over the contacts of every grain (n,)."""
    total = np.zeros(count)
    pair = ~field.contacts.with_wall
    np.add.at(total, field.contacts.i, field.force[:, 0])
    np.add.at(total, field.contacts.j[pair], field.force[pair, 0])
    return total


def _direction(field: Field, position: Array) -> float:
    """Direction of the larger principal stress [°], 0 … 180, of the contacts between grains; NaN without forces."""
    pair = np.flatnonzero(~field.contacts.with_wall)
    force = field.force[pair]
    if not len(pair) or not np.isfinite(force).all() or not force[:, 0].any():
        return float("nan")
    stress = love_weber_stress(field.contacts.select(pair), force[:, 0], force[:, 1], position, 1.0, 1.0)
    return float(np.rad2deg(principal_stresses(stress)[2]) % 180.0)
