"""The reported force field: the mean of five members of two kinds, brought into balance.

Two Gauss-Seidel chains of different kinematic number carry inertia and history; three convex programs read the
sliding of intervals of different length. Each member keeps a history of its own. Their errors differ in kind,
which is why their mean is better than any of them; averaging more of one kind gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from solver.chain import ChainSettings, ChainStep, Packing, advance_chain, force_scale
from solver.contact_probability import ContactProbabilitySettings, probable_contacts, window_of
from solver.contacts import Contacts
from solver.convex import ConvexSettings, assemble_balance, polish
from solver.convex_members import advance_member
from solver.displacement import find_reversals, member_intervals
from solver.grains import Array
from solver.motion import FrameMotion, Snapshot
from solver.network import PairProbability, ProbablePairs
from solver.verdicts import NO_VERDICTS, Verdicts, apply_verdicts
from solver.warm_start import ForceMemory


@dataclass(frozen=True, slots=True)
class EnsembleSettings:
    stiffer: float = 2.0  # kinematic number of the second chain over that of the first
    convex: ConvexSettings = field(default_factory=ConvexSettings)
    probability: ContactProbabilitySettings = field(default_factory=ContactProbabilitySettings)


@dataclass(frozen=True, slots=True)
class EnsembleState:
    """What the members remember of the former frame, and its network."""

    soft: ForceMemory  # the chain whose sweeps are recorded
    stiff: ForceMemory
    last: ForceMemory  # convex, interval (k − 1, k)
    around: ForceMemory  # convex, (k − 1, k + 1)
    wide: ForceMemory  # convex, (k − 2, k + 2)
    pairs: PairProbability

    @classmethod
    def first(cls) -> EnsembleState:
        memory = ForceMemory.empty()
        return cls(memory, memory, memory, memory, memory, PairProbability.none())


@dataclass(frozen=True, slots=True)
class EnsembleForces:
    """One frame of the ensemble, all on the contacts of `step`."""

    step: ChainStep  # of the first chain
    fn: Array  # (c,) [N] reported
    ft: Array  # (c,) [N]
    probability: Array  # (c,)
    member_fn: Array  # (5, c) [N] first chain, second chain, three convex members
    member_ft: Array  # (5, c) [N]
    state: EnsembleState
    remark: str  # what went otherwise than it should, or empty
    forbidden: Contacts  # detected, but not among those of `step`, for people forbade them
    forbidden_probability: Array  # (m,) P(touch) of those, as detected


def solve_ensemble(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    k: int,
    motion: FrameMotion,
    state: EnsembleState,
    chain: ChainSettings,
    settings: EnsembleSettings,
    *,
    snapshot: Snapshot,
    verdicts: Verdicts = NO_VERDICTS,
) -> EnsembleForces:
    """Solve frame k of a sequence with all members.

    motion leads to frame k; snapshot is that of frame k, with stand-ins for lost grains; verdicts are on frame k.
    """
    window = window_of(k, len(snapshots))
    detected, touch = probable_contacts(
        packing.grains, [snapshots[f] for f in window], k - window.start, settings.probability, frame=snapshot
    )
    contacts, before = apply_verdicts(
        detected, verdicts, packing.grains, snapshot.position, snapshot.present, packing.walls(snapshot.endpoints)
    )
    # A pair that people saw touch is certain, whatever its measured gaps say.
    seen = np.isin(contacts.key, verdicts.forced)
    probability = np.where(seen, 1.0, touch[before]) if len(touch) else np.ones(contacts.count)
    forbidden = np.isin(detected.key, verdicts.forbidden)
    pairs = PairProbability(contacts.key, probability)
    network = ProbablePairs(state.pairs if motion.spans else pairs, pairs)
    soft = advance_chain(packing, motion, state.soft, chain, network)
    assert chain.kappa is not None
    stiff_chain = replace(chain, kappa=chain.kappa * settings.stiffer, keep="none")
    stiff = advance_chain(packing, motion, state.stiff, stiff_chain, network)
    walls = packing.walls(snapshot.endpoints)

    friction = np.where(contacts.with_wall, packing.material.wall_friction, packing.material.friction)
    wall_total = None
    if not walls.loaded.any():
        wall_total = float(soft.solution.fn[contacts.with_wall].sum())
    balance = assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present, friction=friction,
        force_unit=force_scale(packing, chain), gravity=packing.material.gravity, wall_normal_total=wall_total,
    )  # fmt: skip
    fields = [soft.solution.force, stiff.solution.force]
    memories: list[ForceMemory] = []
    remarks: list[str] = []
    intervals = _intervals(snapshots, k)
    for (first, last), memory in zip(intervals, (state.last, state.around, state.wide), strict=True):
        forces, renewed = advance_member(
            balance, contacts, packing.grains, walls, snapshot, (snapshots[first], snapshots[last]),
            probability, memory, settings.convex,
        )  # fmt: skip
        if forces.converged:
            fields.append(np.column_stack([forces.fn, forces.ft]))
        else:
            remarks.append(f"a convex member was left out ({forces.ending})")
        memories.append(renewed)
    members = np.stack(fields)
    mean = members.mean(axis=0)
    polished = polish(balance, mean[:, 0], mean[:, 1], settings.convex)
    if not polished.converged:
        remarks.append(f"the mean was not polished ({polished.ending})")
    fn, ft = (polished.fn, polished.ft) if polished.converged else (mean[:, 0], mean[:, 1])
    return EnsembleForces(
        soft, fn, ft, probability, members[:, :, 0], members[:, :, 1],
        EnsembleState(
            soft.memory if motion.spans else ForceMemory.empty(),
            stiff.memory if motion.spans else ForceMemory.empty(),
            memories[0], memories[1], memories[2], pairs,
        ),
        "; ".join(remarks), detected.select(forbidden), touch[forbidden],
    )  # fmt: skip


def _intervals(snapshots: Sequence[Snapshot], k: int) -> tuple[tuple[int, int], ...]:
    position = np.stack([np.where(s.present[:, None], s.position, np.nan) for s in snapshots])
    return member_intervals(k, find_reversals(np.stack([s.endpoints for s in snapshots]), position))
