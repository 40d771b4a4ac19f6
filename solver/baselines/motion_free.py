"""Force fields estimated from the geometry of one photograph, without motion: baselines for all estimators.

All pairs whose gap is within the noise count as contacts. Three fields are computed on them: the same force on every
contact; the forces in equilibrium inside the Coulomb cone that are nearest to the uniform field; and those nearest to
forces in proportion to the overlaps, averaged over a few photographs. An estimator that uses the motion should never be
worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts, detect_contacts, measure_contacts
from ..contacts.pairs import Keys
from ..convex.program import Balance, LoadScale, assemble_balance, project_onto_equilibrium

GAP_SIGMAS = 3.0  # greatest measured gap of a touching pair, in standard deviations of a gap
AVERAGED = 2  # photographs before and after the frame over which overlaps are averaged
CANDIDATE_GAP = 0.06  # [mean diameters] greatest gap of candidate pairs, on which fields are compared
ISOSTATIC = 1.5  # fewest contacts per grain of a stable packing of frictional rods, without walls


@dataclass(frozen=True, slots=True)
class MotionFreeForces:
    """Force fields of one frame on the same contacts; their scale is meaningful only under a load or weight."""

    contacts: Contacts  # (c,)
    candidates: Keys  # (m,) pairs within CANDIDATE_GAP
    balanced: Array  # (c, 2) f_n, f_t [N] in equilibrium, nearest to the uniform field; NaN without convergence
    overlapping: (
        Array  # (c, 2) [N] in equilibrium, nearest to forces in proportion to the overlaps; NaN without convergence
    )
    uniform: Array  # (c, 2) [N] the same force on every contact


def estimate_motion_free(packing: Packing, snapshots: Sequence[Snapshot], k: int, noise: float) -> MotionFreeForces:
    """Estimate the motion-free force fields of frame k.

    Parameters
    ----------
    k : int
        Frame of the sequence.
    noise : float
        Standard deviation of a position component [m].
    """
    ready = _prepare(packing, snapshots, k, noise)
    uniform = np.column_stack([np.full(ready.contacts.count, ready.unit), np.zeros(ready.contacts.count)])
    return MotionFreeForces(
        ready.contacts, ready.candidates, _project(ready.balance, uniform), _project(ready.balance, ready.overlapping),
        uniform,
    )  # fmt: skip


def overlap_balance(
    packing: Packing, snapshots: Sequence[Snapshot], k: int, noise: float
) -> tuple[Contacts, Float[Array, "c 2"]]:
    """Forces of frame k in equilibrium that are nearest to forces in proportion to the overlaps.

    Parameters as of `estimate_motion_free`.

    Returns
    -------
    Contacts
        Pairs whose gap is within the noise (c,).
    ndarray, shape (c, 2)
        f_n, f_t [N]; NaN without convergence.
    """
    ready = _prepare(packing, snapshots, k, noise)
    return ready.contacts, _project(ready.balance, ready.overlapping)


@dataclass(frozen=True, slots=True)
class _Prepared:
    contacts: Contacts
    candidates: Keys
    unit: float  # [N]
    overlapping: Array  # (c, 2) [N] in proportion to the overlaps
    balance: Balance


def _prepare(packing: Packing, snapshots: Sequence[Snapshot], k: int, noise: float) -> _Prepared:
    snapshot = snapshots[k]
    walls, grains = packing.walls_of(snapshot), packing.grains
    candidates = detect_contacts(
        grains, snapshot.position, snapshot.present, walls, CANDIDATE_GAP * 2.0 * float(grains.radius.mean())
    )  # fmt: skip
    touching = touching_gap(candidates.gap, int(snapshot.present.sum()))
    contacts = candidates.select(candidates.gap < touching + GAP_SIGMAS * np.sqrt(2.0) * noise)
    unit = _typical_force(packing, walls, snapshot)
    overlap = np.maximum(touching - _mean_gap(packing, snapshots, k, contacts), 0.0)
    mean = float(overlap.mean()) if contacts.count else 0.0
    normal = np.full(contacts.count, unit) if mean == 0.0 else unit * overlap / mean
    balance = _assemble(packing, walls, snapshot, contacts, unit)
    return _Prepared(contacts, candidates.key, unit, np.column_stack([normal, np.zeros(contacts.count)]), balance)


def touching_gap(gap: Array, grains: int) -> float:
    """Estimate the measured gap [m] of touching pairs from all gaps (m,) [m]; it is 0 unless radii are too small.

    Notes
    -----
    Median of the ISOSTATIC · grains smallest gaps, at least 0: a stable packing has at least that many contacts.
    """
    count = min(round(ISOSTATIC * grains), len(gap))
    return max(float(np.median(np.partition(gap, count - 1)[:count])), 0.0) if count else 0.0


def _mean_gap(packing: Packing, snapshots: Sequence[Snapshot], k: int, contacts: Contacts) -> Array:
    """Gaps (c,) [m], averaged over the photographs around frame k that show both bodies."""
    gaps = []
    for each in snapshots[max(0, k - AVERAGED) : k + AVERAGED + 1]:
        position = np.where(each.present[:, None], each.position, np.nan)
        walls = each.walls
        gaps.append(measure_contacts(packing.grains, position, walls, contacts.i, contacts.j).gap)
    return np.nanmean(np.stack(gaps), axis=0)


def _typical_force(packing: Packing, walls: Walls, snapshot: Snapshot) -> float:
    """Typical force [N] from the load of the plates, else from the weight at half height, else 1."""
    diameter = 2.0 * float(packing.grains.radius.mean())
    if walls.loaded.any():
        return float((walls.load[walls.loaded] / walls.face[walls.loaded]).mean()) * diameter
    weight = np.linalg.norm(packing.weight[snapshot.present], axis=1)
    return 0.5 * float(np.sqrt(len(weight)) * weight.mean()) if weight.any() else 1.0


def _assemble(packing: Packing, walls: Walls, snapshot: Snapshot, contacts: Contacts, unit: float) -> Balance:
    material = packing.material
    total = None if packing.scale_is_known else unit * int(contacts.gauge.sum())
    return assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present,
        friction=material.friction_at(contacts.with_wall), scale=LoadScale(unit, material.gravity, total),
    )  # fmt: skip


def _project(balance: Balance, centre: Array) -> Array:
    """Project a field (c, 2) [N] onto equilibrium; NaN without convergence."""
    found = project_onto_equilibrium(balance, centre[:, 0], centre[:, 1])
    return np.column_stack([found.fn, found.ft]) if found.converged else np.full_like(centre, np.nan)
