"""The reported force field: the mean of members of two kinds, brought into balance.

Two Gauss-Seidel chains of different kinematic number carry inertia and history; five convex programs read the
sliding of intervals before, after and around the frame. Each member keeps a history of its own and counts as much as
noise leaves of the sliding that it reads. Their errors differ in kind, which is why their mean is better than any of
them; averaging more of one kind gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.motion import FrameMotion, Snapshot
from solver.bodies.packing import Packing
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import are_among
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, apply_verdicts
from solver.convex.members import RefinedMotion, Slip, advance_member, read_slip, steady_slip
from solver.convex.program import ConvexSettings, assemble_balance, polish
from solver.detection.displacement import find_reversals, member_intervals
from solver.detection.networks import PairProbability, ProbablePairs
from solver.detection.refinement import RefinedBlock
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.nlgs.chain import ChainSettings, ChainStep, advance_chain, force_scale
from solver.nlgs.warm_start import ForceMemory
from solver.statistics.agreement import relative_change


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
    other: ForceMemory  # the first chain once more, from another start; it tells how much of the start is left
    last: ForceMemory  # convex, interval (k − 1, k)
    ahead: ForceMemory  # convex, (k, k + 1)
    around: ForceMemory  # convex, (k − 1, k + 1)
    wide: ForceMemory  # convex, (k − 2, k + 2)
    steady: ForceMemory  # convex, what (k − 1, k) and (k, k + 1) have in common
    pairs: PairProbability

    @classmethod
    def first(cls) -> EnsembleState:
        memory = ForceMemory.empty()
        return cls(memory, memory, memory, memory, memory, memory, memory, memory, PairProbability.none())


MEMBERS = ("soft", "stiff", "last", "ahead", "around", "wide", "steady")  # two chains, five convex programs


@dataclass(frozen=True, slots=True)
class EnsembleForces:
    """One frame of the ensemble, all on the contacts of `step`."""

    step: ChainStep  # of the first chain
    fn: Array  # (c,) [N] reported
    ft: Array  # (c,) [N]
    probability: Array  # (c,) P(touch) as detected; 0 for a contact that only people saw
    member_fn: Array  # (m, c) [N] first chain, second chain, convex members that had something to read
    member_ft: Array  # (m, c) [N]
    worth: Array  # (m,) weight of each member in the mean, at most 1
    place: NDArray[np.intp]  # (m,) of each member in MEMBERS
    state: EnsembleState
    start_difference: float  # H, NaN where no motion leads to the frame
    remark: str  # what went otherwise than it should, or empty
    forbidden: Contacts  # detected, but not among those of `step`, for people forbade them
    forbidden_probability: Array  # (m,) P(touch) of those, as detected

    @property
    def member_force(self) -> Array:
        """(f_n, f_t) of every one of MEMBERS (c, 7, 2) [N], NaN for those that had nothing to read."""
        force = np.full((self.member_fn.shape[1], len(MEMBERS), 2), np.nan)
        force[:, self.place, 0], force[:, self.place, 1] = self.member_fn.T, self.member_ft.T
        return force

    @property
    def spread_fn(self) -> Array:
        """Standard deviation of f_n among the members (c,) [N]."""
        return _spread(self.member_fn, self.worth)

    @property
    def spread_ft(self) -> Array:
        """Standard deviation of f_t among the members (c,) [N]."""
        return _spread(self.member_ft, self.worth)

    @property
    def disagreement(self) -> float:
        """D: rms spread of f_n over the rms of f_n; 0 where no contact bears force."""
        size = float(np.linalg.norm(self.fn))
        return float(np.linalg.norm(self.spread_fn)) / size if size > 0 else 0.0


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
    refined: RefinedBlock,
    verdicts: Verdicts = NO_VERDICTS,
) -> EnsembleForces:
    """Solve frame k of a sequence with all members.

    motion leads to frame k; snapshot is that of frame k, with stand-ins for lost grains; refined: the block that
    frame k belongs to; verdicts are on frame k.
    """
    walls = packing.walls(snapshot.endpoints)
    detected, touch = refined.contacts_at(snapshot, k, packing.grains, walls, settings.probability.least)
    contacts, before = apply_verdicts(detected, verdicts, packing.grains, snapshot.position, snapshot.present, walls)
    # A pair that people saw touch is certain, whatever its measured gaps say.
    told = np.where(before >= 0, touch[before], 0.0) if len(touch) else np.zeros(contacts.count)
    probability = np.where(are_among(contacts.key, verdicts.forced), 1.0, told)
    forbidden = are_among(detected.key, verdicts.forbidden)
    pairs = PairProbability(contacts.key, probability)
    network = ProbablePairs(state.pairs if motion.spans else pairs, pairs)
    soft = advance_chain(packing, motion, state.soft, chain, network)
    assert chain.kappa is not None
    stiff_chain = replace(chain, kappa=chain.kappa * settings.stiffer, keep="none")
    stiff = advance_chain(packing, motion, state.stiff, stiff_chain, network)
    other, start_difference = state.other, np.nan
    if motion.spans:
        if len(state.soft.key) == 0:  # the first chain starts from zero: this one from uniform forces
            uniform = np.column_stack([np.full(contacts.count, force_scale(packing, chain)), np.zeros(contacts.count)])
            other = other.renew(contacts, uniform, snapshot.present)
        again = advance_chain(packing, motion, other, replace(chain, keep="none"), network)
        start_difference = relative_change(contacts.key, soft.solution.force, contacts.key, again.solution.force)
        other = again.memory

    friction = np.where(contacts.with_wall, packing.material.wall_friction, packing.material.friction)
    wall_total = None
    if not walls.loaded.any():
        wall_total = float(soft.solution.fn[contacts.with_wall].sum())
    balance = assemble_balance(
        contacts, packing.grains, walls, present=snapshot.present, friction=friction,
        force_unit=force_scale(packing, chain), gravity=packing.material.gravity, wall_normal_total=wall_total,
    )  # fmt: skip
    slips = _slips(contacts, packing, walls, snapshots, k, settings, refined)
    former = (state.last, state.ahead, state.around, state.wide, state.steady)
    fields = [soft.solution.force, stiff.solution.force]
    worth, place = [1.0, 1.0], [0, 1]
    memories: list[ForceMemory | None] = []
    remarks: list[str] = []
    for number, (slip, memory) in enumerate(zip(slips, former, strict=True), start=2):
        if slip is None:
            memories.append(None)
            continue
        forces, renewed = advance_member(balance, contacts, snapshot, slip, probability, memory, settings.convex)
        if forces.converged:
            fields.append(np.column_stack([forces.fn, forces.ft]))
            worth.append(slip.worth)
            place.append(number)
        else:
            remarks.append(f"a convex member was left out ({forces.ending})")
        memories.append(renewed)
    members = np.stack(fields)
    mean = np.average(members, axis=0, weights=worth)
    polished = polish(balance, mean[:, 0], mean[:, 1], settings.convex)
    if not polished.converged:
        remarks.append(f"the mean was not polished ({polished.ending})")
    fn, ft = (polished.fn, polished.ft) if polished.converged else (mean[:, 0], mean[:, 1])
    # A member that had nothing to read here goes on from the reported field.
    reported = state.last.renew(contacts, np.column_stack([fn, ft]), snapshot.present)
    chains = (soft.memory, stiff.memory) if motion.spans else (reported, reported)
    last, ahead, around, wide, steady = (reported if memory is None else memory for memory in memories)
    return EnsembleForces(
        soft, fn, ft, told, members[:, :, 0], members[:, :, 1], np.array(worth), np.array(place),
        EnsembleState(*chains, other, last, ahead, around, wide, steady, pairs), start_difference,
        "; ".join(remarks), detected.select(forbidden), touch[forbidden],
    )  # fmt: skip


def _spread(member: Array, worth: Array) -> Array:
    mean = np.average(member, axis=0, weights=worth)
    return np.sqrt(np.average((member - mean) ** 2, axis=0, weights=worth))


def _slips(
    contacts: Contacts,
    packing: Packing,
    walls: Walls,
    snapshots: Sequence[Snapshot],
    k: int,
    settings: EnsembleSettings,
    refined: RefinedBlock,
) -> tuple[Slip | None, ...]:
    """What the convex members read at frame k: the intervals of `member_intervals`, then what outlasts the frame."""

    def slip(interval: tuple[int, int]) -> Slip:
        ends = snapshots[interval[0]], snapshots[interval[1]]
        deviation = refined.slide_deviation(contacts, interval, (ends[0].sigma, ends[1].sigma))
        motion = RefinedMotion((refined.position_at(interval[0]), refined.position_at(interval[1])), deviation)
        return read_slip(contacts, packing.grains, walls, ends, settings.convex, motion)

    slips = [None if interval is None else slip(interval) for interval in _intervals(snapshots, k)]
    before, after = slips[:2]
    return (*slips, None if before is None or after is None else steady_slip(before, after))


def _intervals(snapshots: Sequence[Snapshot], k: int) -> tuple[tuple[int, int] | None, ...]:
    position = np.stack([np.where(s.present[:, None], s.position, np.nan) for s in snapshots])
    return member_intervals(k, find_reversals(np.stack([s.endpoints for s in snapshots]), position))
