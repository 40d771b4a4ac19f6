"""Inferred forces compared with photoelastic measurements, which give every contact two noisy readings.

The upper limits of any agreement are measured first: the correlation of the two readings of a contact, and the
agreement of the equilibrium field nearest to them. The run's forces and motion-free baselines are compared with these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ...exchange.foreign.pegs import COPY_DIGITS
from ...experiment.reading.tables import read_table
from ...inference.snapshots import make_snapshots
from ...process.counts import mean_of_known
from ...process.errors import InputError
from ...process.frame_range import FrameRange
from ...results.results import Results, TruthContacts
from ...solver.baselines.motion_free import estimate_motion_free
from ...solver.bodies.grains import Array
from ...solver.bodies.motion import Snapshot
from ...solver.bodies.packing import Packing
from ...solver.bodies.walls import Walls
from ...solver.contacts.contacts import Contacts, ContactSource, measure_pairs
from ...solver.contacts.pairs import Keys, join_keys, match_values, split_keys
from ...solver.convex.program import LoadScale, assemble_balance, project_onto_equilibrium
from ...solver.detection.precision import measure_precision
from ...solver.statistics.agreement import compare_forces, pearson
from ...solver.statistics.balance import sum_on_grains
from ...solver.statistics.stress import love_weber_stress, principal_stresses
from ..baselines import packing_of

EXCESS = 0.03  # of the trust over r that is an error of the trust
LEAST_FRAMES = 3  # for a correlation over time
SOURCES = ("ours", "static", "overlap", "uniform", "ceiling")  # of force fields; the last one uses the truth


@dataclass(frozen=True, slots=True)
class FrameField:
    """Forces of one frame with their contacts."""

    contacts: Contacts  # (c,)
    force: Float[Array, "c 2"]  # f_n, f_t in any unit

    @property
    def key(self) -> Keys:
        return self.contacts.key

    def normal_only(self) -> FrameField:
        """Return the field without tangential forces, which fringes hardly determine."""
        return FrameField(self.contacts, self.force * np.array([1.0, 0.0]))


@dataclass(frozen=True, slots=True)
class FieldAgreement:
    """Agreement of one field of a frame with the truth; NaN where a number does not exist."""

    r: float  # of f_n over all candidate pairs and all contacts of either side
    matched: float  # of f_n over the true contacts with force
    pressure: float  # of the grains' pressures
    direction: float  # [°] of the larger principal stress, 0 … 180
    total: float  # sum of f_n between grains [N], or in any unit that all frames share


@dataclass(frozen=True, slots=True)
class RealFrame:
    """Agreement of all fields of one frame with the measured forces."""

    frame: int
    ours: FieldAgreement
    static: FieldAgreement
    overlap: FieldAgreement
    uniform: FieldAgreement
    ceiling: FieldAgreement  # of the equilibrium field that is nearest to the truth
    direction: float  # [°] of the truth
    total: float  # of the truth
    trust: float  # of the run; NaN: not computed
    sides: float  # correlation of the two readings of a contact; NaN with one reading
    precision: float  # fraction of the contacts with force in the run that truly carry force
    recall: float  # fraction of the true contacts with force that the run lists
    covered: tuple[float, float]  # fractions of the true f_n within one and two standard deviations; NaN without these
    direction_sd: float  # [°] standard deviation of the principal direction as the run states it; NaN: none

    def direction_error(self, source: str) -> float:
        """Return the error of a field's principal direction [°], −90 … 90."""
        return float((getattr(self, source).direction - self.direction + 90.0) % 180.0 - 90.0)


@dataclass(frozen=True, slots=True)
class RealStudy:
    """A run compared with measured forces frame by frame, and the fields of one frame for drawing."""

    name: str
    frames: tuple[RealFrame, ...]
    shown: int  # the frame of the fields
    truth: FrameField
    drawn: dict[str, FrameField]  # by source
    position: Float[Array, "n 2"]  # [m] of the grains in that frame
    radius: Float[Array, " n"]  # [m]

    def total_correlation(self, source: str) -> float:
        """Return the correlation over the frames of a field's total force with the true one; NaN of few frames."""
        pairs = np.array([(getattr(row, source).total, row.total) for row in self.frames])
        pairs = pairs[np.isfinite(pairs).all(axis=1)]
        return pearson(*pairs.T) if len(pairs) >= LEAST_FRAMES else float("nan")

    def direction_coverage(self) -> tuple[float, float, float]:
        """Return the mean standard deviation of the direction [°], and how often one and two cover the truth."""
        rows = [row for row in self.frames if np.isfinite(row.direction_sd + row.direction_error("ours"))]
        if not rows:
            return float("nan"), float("nan"), float("nan")
        sd = np.array([row.direction_sd for row in rows])
        error = np.abs([row.direction_error("ours") for row in rows])
        return float(sd.mean()), float((error < sd).mean()), float((error < 2.0 * sd).mean())

    def count_excess(self) -> tuple[int, int]:
        """Count the frames whose trust exceeds r of the run by more than EXCESS, and the frames with a trust."""
        known = [row for row in self.frames if np.isfinite(row.trust) and np.isfinite(row.ours.r)]
        return sum(row.trust > row.ours.r + EXCESS for row in known), len(known)


def study_real(results: Results, truth: TruthContacts, sides: Sequence[float], shown: int | None = None) -> RealStudy:
    """Compare every frame with its measured forces.

    Parameters
    ----------
    results : Results
    truth : TruthContacts
    sides : sequence of float
        Correlation of the two readings in every frame, or NaN.
    shown : int, optional
        Frame to draw; default: the middle one.

    Raises
    ------
    InputError
        If there is no frame `shown`.
    """
    packing, snapshots = packing_of(results), make_snapshots(results.tracks, results.walls)
    true = truth.by_frame(results.grains.count + results.walls.count, len(results.frames))
    measured = measure_precision(packing.grains, snapshots)
    shown = len(snapshots) // 2 if shown is None else shown
    if not 0 <= shown < len(snapshots):
        raise InputError("--frame", str(shown), f"is not one of the {len(snapshots)} frames")
    rows: list[RealFrame] = []
    drawn: tuple[FrameField, dict[str, FrameField]] | None = None
    for k, frame in enumerate(results.frames):
        noise = max(snapshots[k].sigma, 0.0 if measured is None else measured.sigma)
        order = np.argsort(true[k][0])
        key, force = true[k][0][order], true[k][1][order]
        exact = FrameField(_measure(packing, snapshots[k], key), force)
        baseline = estimate_motion_free(packing, snapshots, k, noise)
        listed = frame.source != ContactSource.FORBIDDEN_BY_REVIEWER
        ours = FrameField(frame.contacts.select(listed), np.column_stack([frame.fn, frame.ft])[listed])
        found = {
            "ours": ours,
            "static": FrameField(baseline.contacts, baseline.balanced),
            "overlap": FrameField(baseline.contacts, baseline.overlapping),
            "uniform": FrameField(baseline.contacts, baseline.uniform),
            "ceiling": _nearest_equilibrium(packing, snapshots[k], exact, ours.contacts, baseline.candidates),
        }
        covered = _coverage(ours, None if frame.fn_sd is None else frame.fn_sd[listed], exact)
        known = frame.trust, sides[k], covered, float(np.rad2deg(results.statistics[k].principal_direction_sd))
        rows.append(_compare(k, found, exact, baseline.candidates, snapshots[k], known))
        if k == shown:
            drawn = exact, found
    assert drawn is not None
    return RealStudy(
        results.name, tuple(rows), shown, *drawn, snapshots[shown].position, packing.grains.radius
    )  # fmt: skip


def correlate_sides(file: Path, frames: FrameRange, frame_count: int) -> list[float]:
    """Correlate the two readings of f_n in every frame; NaN where the table has one, or twice the same."""
    table = read_table(file, ("frame",), optional=("fn_i", "fn_j"))
    frame = table.integers("frame")
    first, second = table.optional_numbers("fn_i"), table.optional_numbers("fn_j")
    both = np.isfinite(first) & np.isfinite(second)
    if np.allclose(first[both], second[both], rtol=COPY_DIGITS, atol=0.0):  # copies are no second reading
        both[:] = False
    return [
        pearson(first[here], second[here]) for k in range(frame_count) for here in [both & (frame == frames.number(k))]
    ]


def as_json(study: RealStudy) -> dict[str, object]:
    """Return plain values, None where a number does not exist: a list per frame, and the means."""
    names = [each.name for each in fields(FieldAgreement)]
    by_source = {
        source: {name: [_plain(getattr(getattr(row, source), name)) for row in study.frames] for name in names}
        | {"turned": [_plain(row.direction_error(source)) for row in study.frames]}
        for source in SOURCES
    }
    truth = {
        name: [_plain(getattr(row, name)) for row in study.frames]
        for name in ("direction", "direction_sd", "total", "trust", "sides", "precision", "recall")
    }
    mean = {
        source: {name: mean_of([getattr(getattr(row, source), name) for row in study.frames]) for name in names[:3]}
        | {"turned": mean_of([abs(row.direction_error(source)) for row in study.frames])}
        | {"total_correlation": _plain(study.total_correlation(source))}
        for source in SOURCES
    }
    covered = {
        name: mean_of([row.covered[k] for row in study.frames]) for k, name in enumerate(("within_1_sd", "within_2_sd"))
    }
    excess = dict(zip(("frames_above_r", "frames_with_trust"), study.count_excess(), strict=True))
    return {"frame": [row.frame for row in study.frames], **truth, **by_source, "mean": mean, **covered, **excess}


def mean_of(values: Sequence[float]) -> float | None:
    """Return the mean of the finite values; None without any."""
    return _plain(mean_of_known(values))


def _plain(value: float) -> float | None:
    return round(float(value), 6) if np.isfinite(value) else None


def _measure(packing: Packing, snapshot: Snapshot, key: Keys) -> Contacts:
    return measure_pairs(packing.grains, snapshot.position, packing.walls(snapshot.endpoints), key)


def _nearest_equilibrium(
    packing: Packing, snapshot: Snapshot, exact: FrameField, listed: Contacts, near: Keys
) -> FrameField:
    """Compute the equilibrium field inside the Coulomb cone that is nearest to the true normal forces.

    It has all contacts between grains that are true or listed by the run. Grains that their neighbours do not enclose
    lie at the boundary, whose forces are unknown, and need not be in equilibrium.
    """
    grains, n, bodies = packing.grains, packing.grains.count, exact.contacts.body_count
    key = join_keys(listed.key, exact.key)
    key = key[split_keys(key, bodies)[1] < n]
    contacts = _measure(packing, snapshot, key)
    fn = match_values(key, exact.key, exact.force[:, 0], fill=0.0)
    if not fn.any():
        return FrameField(contacts, np.full((contacts.count, 2), np.nan))
    between = near[split_keys(near, bodies)[1] < n]
    inner = snapshot.present & _enclosed(_measure(packing, snapshot, between), n)
    balance = assemble_balance(
        contacts, grains, Walls.at_rest(np.empty((0, 2, 2))), present=inner,
        friction=packing.material.friction_at(contacts.with_wall),
        scale=LoadScale(float(fn[fn > 0.0].mean()), packing.material.gravity, float(fn[contacts.gauge].sum())),
    )  # fmt: skip
    found = project_onto_equilibrium(balance, fn, np.zeros(contacts.count))
    if not found.converged:
        return FrameField(contacts, np.full((contacts.count, 2), np.nan))
    return FrameField(contacts, np.column_stack([found.fn, found.ft]))


def _enclosed(contacts: Contacts, count: int) -> np.ndarray:
    """Mark the grains (n,) with contacts in every half plane; the others lie at the boundary."""
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
    k: int,
    candidates: dict[str, FrameField],
    exact: FrameField,
    near: Keys,
    snapshot: Snapshot,
    known: tuple[float, float, tuple[float, float], float],
) -> RealFrame:
    """Compare fields with the truth; known: trust, correlation of both readings, coverage, sd of the direction."""
    trust, sides, covered, direction_sd = known
    pairs = join_keys(near, candidates["ours"].key, exact.key)
    true = match_values(pairs, exact.key, exact.force[:, 0])
    pressure = _pressure(exact)
    bearing = exact.force[:, 0] > 0.0
    found = {}
    for source, field in candidates.items():
        on_true = match_values(exact.key[bearing], field.key, field.force[:, 0])
        found[source] = FieldAgreement(
            pearson(match_values(pairs, field.key, field.force[:, 0]), true),
            pearson(on_true, exact.force[bearing, 0]),
            pearson(_pressure(field), pressure),
            _direction(field, snapshot.position),
            _total(field),
        )
    ours = candidates["ours"]
    carrying = ours.force[:, 0] > 0.0
    agreement = compare_forces(ours.key[carrying], ours.force[carrying], exact.key, exact.force)
    listed = compare_forces(ours.key, ours.force, exact.key, exact.force)
    return RealFrame(
        k, **found, direction=_direction(exact.normal_only(), snapshot.position), total=_total(exact), trust=trust,
        sides=sides, precision=agreement.contact_precision, recall=listed.contact_recall, covered=covered,
        direction_sd=direction_sd,
    )  # fmt: skip


def _coverage(ours: FrameField, fn_sd: Array | None, exact: FrameField) -> tuple[float, float]:
    """Return the fractions of true normal forces within one and two standard deviations of the inferred ones.

    The true forces are in a unit of their own: they are divided by the factor that fits the inferred ones best.
    """
    if fn_sd is None:
        return float("nan"), float("nan")
    fn, true = ours.force[:, 0], match_values(ours.key, exact.key, exact.force[:, 0])
    used = ~ours.contacts.with_wall & np.isfinite(fn_sd) & (fn_sd > 0.0)
    factor = float(fn[used] @ true[used]) / max(float(fn[used] @ fn[used]), 1e-300)
    if not used.any() or not factor > 0.0:
        return float("nan"), float("nan")
    off = np.abs(true[used] / factor - fn[used]) / fn_sd[used]
    return float((off < 1.0).mean()), float((off < 2.0).mean())


def _total(field: FrameField) -> float:
    return float(field.force[~field.contacts.with_wall, 0].sum())


def _pressure(field: FrameField) -> Array:
    """Sum f_n over the contacts of every grain (n,)."""
    return sum_on_grains(field.contacts, field.force[:, 0])


def _direction(field: FrameField, position: Array) -> float:
    """Return the direction of the larger principal stress [°], 0 … 180, of contacts between grains; NaN without any."""
    pair = np.flatnonzero(~field.contacts.with_wall)
    force = field.force[pair]
    if not len(pair) or not np.isfinite(force).all() or not force[:, 0].any():
        return float("nan")
    stress = love_weber_stress(field.contacts.select(pair), force[:, 0], force[:, 1], position, 1.0, 1.0)
    return float(np.rad2deg(principal_stresses(stress)[2]) % 180.0)
