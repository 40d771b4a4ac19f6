"""The reported force field: the mean of members of two kinds, brought into balance.

Two Gauss-Seidel chains of different kinematic number carry inertia and history; five convex programs read the
sliding of intervals before, after and around the frame. Each member keeps a history of its own and counts as much as
noise leaves of the sliding that it reads. Their errors differ in kind, which is why their mean is better than any of
them; averaging more of one kind gains nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import are_among
from solver.convex.members import RefinedMotion, SeenSlip, Slip, advance_member, read_slip, steady_slip
from solver.convex.program import Balance, ConvexForces, assemble_balance, polish
from solver.detection.displacement import find_reversals, member_intervals
from solver.detection.networks import PairProbability, ProbablePairs
from solver.nlgs.chain import ChainStep, advance_through, force_scale
from solver.nlgs.interval import Interval
from solver.nlgs.warm_start import ForceMemory
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.demand import NO_DEMAND, ROUNDS, WINS, Demand, find_demand
from solver.sequence.frame_contacts import TouchingPairs, find_touching
from solver.sequence.frame_problem import FrameProblem
from solver.sequence.judging.judgement import SETTLED_DIFFERENCE
from solver.statistics.agreement import relative_change
from solver.statistics.sliding import cone_share
from solver.together import work_together


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
    agreeing: int = 0  # frames running in which H was below its level

    @property
    def start_forgotten(self) -> bool:
        """Whether two starts agreed for so long that the chain from another start tells nothing more."""
        return self.agreeing >= AGREEING_FRAMES

    @classmethod
    def first(cls) -> EnsembleState:
        memory = ForceMemory.empty()
        return cls(memory, memory, memory, memory, memory, memory, memory, memory, PairProbability.none())

    def renewed(self, contacts: Contacts, force: Array, present: NDArray[np.bool_]) -> EnsembleState:
        """The same network, all members going on from these forces (c, 2) [N]."""
        memory = self.last.renew(contacts, force, present)
        return EnsembleState(
            memory, memory, self.other, memory, memory, memory, memory, memory, self.pairs, self.agreeing
        )


AGREEING_FRAMES = 3  # with H below its level: it only falls until the forces are reset
MEMBERS = ("soft", "stiff", "last", "ahead", "around", "wide", "steady")  # two chains, five convex programs
CHAINS = 2  # of the MEMBERS, the first

Task = Callable[[], Any]  # one member: a ChainStep, or forces with what is remembered of them


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
    start_difference: float  # H, NaN where no motion leads to the frame and once the start is forgotten
    remark: str  # what went otherwise than it should, or empty
    forbidden: Contacts  # detected, but not among those of `step`, for people forbade them
    forbidden_probability: Array  # (m,) P(touch) of those, as detected
    demand: Demand  # pairs among those of `step` that were not detected but demanded by the balance
    seen_slip: SeenSlip  # around the frame where that is known, else before it or after

    @property
    def member_force(self) -> Array:
        """(f_n, f_t) of every one of MEMBERS (c, 7, 2) [N], NaN for those that had nothing to read."""
        force = np.full((self.member_fn.shape[1], len(MEMBERS), 2), np.nan)
        force[:, self.place, 0], force[:, self.place, 1] = self.member_fn.T, self.member_ft.T
        return force

    def cone_share(self, friction: Array) -> Array:
        """Shares of the convex members and of the chains whose force is on the Coulomb cone (c, 2); friction (c,)."""
        return cone_share(self.member_fn, self.member_ft, friction, self.place >= CHAINS)

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
        return float(np.linalg.norm(_spread(self.member_fn, self.worth))) / size if size > 0 else 0.0


def solve_ensemble(
    problem: FrameProblem,
    state: EnsembleState,
    positions: FramePosterior | None = None,
    demand: Demand = NO_DEMAND,
) -> EnsembleForces:
    """Solve one frame of a sequence with all members; positions: what they alone say of the frame, if they were asked.

    Pairs that bear force by the positions are offered to the members of the motion, and such as the balance demands;
    demand: those that are known already.
    """
    touching, chains, balance, members = _solve_members(problem, state, positions, demand)
    for _ in range(ROUNDS):
        more = find_demand(problem, touching.contacts, balance, members.convex)
        if more.count == 0:
            break
        demand = demand.joined(more)
        touching, chains, balance, members = _solve_members(problem, state, positions, demand)
    fn, ft, remark = _average(problem, balance, members)
    remark += _tell_demand(touching.contacts, fn, demand)
    # A member that had nothing to read here goes on from the reported field.
    force = np.column_stack([fn, ft])
    reported = state.last.renew(touching.contacts, force, problem.snapshot.present)
    soft, stiff = (chains.soft.memory, chains.stiff.memory) if problem.motion.spans else (reported, reported)
    last, ahead, around, wide, steady = (reported if memory is None else memory for memory in members.memories)
    return EnsembleForces(
        chains.soft, fn, ft, touching.told, members.force[:, :, 0], members.force[:, :, 1], np.array(members.worth),
        np.array(members.place),
        EnsembleState(soft, stiff, chains.other, last, ahead, around, wide, steady, touching.pairs, chains.agreeing),
        chains.start_difference, "; ".join([*members.remarks, *remark]), touching.forbidden,
        touching.forbidden_probability, demand.only(touching.contacts.key), members.seen_slip,
    )  # fmt: skip


def _solve_members(
    problem: FrameProblem, state: EnsembleState, positions: FramePosterior | None, demand: Demand
) -> tuple[TouchingPairs, _Chains, Balance, _Members]:
    """All members on the contacts that were detected, offered and demanded."""
    touching = find_touching(problem, positions, demand)
    starts = _chain_starts(problem, state, touching)
    workers = problem.settings.workers
    if problem.packing.scale_is_known:  # convex members do not wait for the chains
        balance = assemble_frame_balance(problem, touching.contacts)
        slips: list[Slip | None] = []

        def members() -> list[Task]:
            slips.extend(_slips(problem, touching.contacts))
            return _member_tasks(problem, state, touching, balance, slips)

        found = work_together(starts, workers, members)
        steps, convex = found[: len(starts)], found[len(starts) :]
    else:
        steps = work_together(starts, workers)
        balance = assemble_frame_balance(problem, touching.contacts, steps[0])
        slips = list(_slips(problem, touching.contacts))
        convex = work_together(_member_tasks(problem, state, touching, balance, slips), workers)
    chains = _compare_chains(touching.contacts, steps, state)
    return touching, chains, balance, _gather_members(slips, convex, chains)


def _tell_demand(contacts: Contacts, fn: Array, demand: Demand) -> list[str]:
    """How many pairs were demanded, and how many of them bear force."""
    asked = are_among(contacts.key, demand.key)
    if not asked.any():
        return []
    bearing = int((fn[asked] > WINS * fn[fn > 0].mean()).sum()) if (fn > 0).any() else 0
    return [f"the balance demanded {asked.sum()} pairs that were not detected, of which {bearing} bear force"]


@dataclass(frozen=True, slots=True)
class _Chains:
    """What the Gauss-Seidel chains gave."""

    soft: ChainStep
    stiff: ChainStep
    other: ForceMemory  # of the first chain from another start
    start_difference: float  # H
    agreeing: int


@dataclass(frozen=True, slots=True)
class _Members:
    """The fields that count in the mean, and what the convex members remember."""

    force: Array  # (m, c, 2) [N]
    worth: list[float]  # (m,)
    place: list[int]  # (m,) in MEMBERS
    memories: list[ForceMemory | None]  # of the five convex members; None: it had nothing to read
    remarks: list[str]
    seen_slip: SeenSlip

    @property
    def convex(self) -> list[Array]:
        """The fields (c, 2) [N] of the convex members."""
        return [force for force, place in zip(self.force, self.place, strict=True) if place >= CHAINS]


def _chain_starts(problem: FrameProblem, state: EnsembleState, touching: TouchingPairs) -> list[Task]:
    """The two chains, and the first once more from another start where that still tells something."""
    packing, motion, contacts = problem.packing, problem.motion, touching.contacts
    chain = problem.settings.chain
    network = ProbablePairs(state.pairs if motion.spans else touching.pairs, touching.pairs)
    assert chain.kappa is not None
    silent = replace(chain, keep="none")
    starts = [
        (state.soft, chain),
        (state.stiff, replace(silent, kappa=chain.kappa * problem.settings.ensemble.stiffer)),
    ]
    started_again = motion.spans and not state.start_forgotten
    if started_again:
        other = state.other
        if len(state.soft.key) == 0:  # the first chain starts from zero: this one from uniform forces
            uniform = np.column_stack([np.full(contacts.count, force_scale(packing, chain)), np.zeros(contacts.count)])
            other = other.renew(contacts, uniform, problem.snapshot.present)
        starts.append((other, silent))
    interval = Interval(packing, motion, network)
    return [partial(advance_through, interval, memory, told) for memory, told in starts]


def _compare_chains(contacts: Contacts, steps: list[ChainStep], state: EnsembleState) -> _Chains:
    """What the chains gave, and how far two starts of the first differ."""
    soft, stiff, *rest = steps
    if not rest:
        return _Chains(soft, stiff, state.other, np.nan, state.agreeing)
    (again,) = rest
    difference = relative_change(contacts.key, soft.solution.force, contacts.key, again.solution.force)
    agreeing = state.agreeing + 1 if difference <= SETTLED_DIFFERENCE else 0
    return _Chains(soft, stiff, again.memory, difference, agreeing)


def assemble_frame_balance(problem: FrameProblem, contacts: Contacts, soft: ChainStep | None = None) -> Balance:
    """Balance of the frame on these contacts; soft: the first chain, needed where no load tells the scale."""
    packing, walls, wall_total = problem.packing, problem.walls, None
    if not packing.scale_is_known:  # without load and weight forces are known up to a scale: that of the first chain
        assert soft is not None
        wall_total = float(soft.solution.fn[contacts.gauge].sum())
    return assemble_balance(
        contacts, packing.grains, walls, present=problem.snapshot.present,
        friction=packing.material.friction_at(contacts.with_wall),
        force_unit=force_scale(packing, problem.settings.chain), gravity=packing.material.gravity,
        wall_normal_total=wall_total,
    )  # fmt: skip


def _member_tasks(
    problem: FrameProblem, state: EnsembleState, touching: TouchingPairs, balance: Balance, slips: Sequence[Slip | None]
) -> list[Task]:
    """The convex members that have something to read."""
    former = (state.last, state.ahead, state.around, state.wide, state.steady)
    convex = problem.settings.ensemble.convex
    return [
        partial(
            advance_member, balance, touching.contacts, problem.snapshot, slip, touching.probability, memory, convex
        )
        for slip, memory in zip(slips, former, strict=True)
        if slip is not None
    ]


def _gather_members(
    slips: Sequence[Slip | None], convex: Sequence[tuple[ConvexForces, ForceMemory]], chains: _Chains
) -> _Members:
    """All members that came to an end; convex: what those gave that had something to read."""
    fields = [chains.soft.solution.force, chains.stiff.solution.force]
    worth, place = [1.0, 1.0], [0, 1]
    memories: list[ForceMemory | None] = []
    remarks: list[str] = []
    found = iter(convex)
    for number, slip in enumerate(slips, start=CHAINS):
        if slip is None:
            memories.append(None)
            continue
        forces, renewed = next(found)
        if forces.converged:
            fields.append(np.column_stack([forces.fn, forces.ft]))
            worth.append(slip.worth)
            place.append(number)
        else:
            remarks.append(f"a convex member was left out ({forces.ending})")
        memories.append(renewed)
    return _Members(np.stack(fields), worth, place, memories, remarks, _seen_slip(slips))


def _average(problem: FrameProblem, balance: Balance, members: _Members) -> tuple[Array, Array, list[str]]:
    """The mean of the members in balance, f_n and f_t (c,) [N]; and what went otherwise than it should."""
    mean = np.average(members.force, axis=0, weights=members.worth)
    polished = polish(balance, mean[:, 0], mean[:, 1], problem.settings.ensemble.convex)
    if polished.converged:
        return polished.fn, polished.ft, []
    return mean[:, 0], mean[:, 1], [f"the mean was not polished ({polished.ending})"]


def _spread(member: Array, worth: Array) -> Array:
    mean = np.average(member, axis=0, weights=worth)
    return np.sqrt(np.average((member - mean) ** 2, axis=0, weights=worth))


def _slips(problem: FrameProblem, contacts: Contacts) -> tuple[Slip | None, ...]:
    """What the convex members read at frame k: the intervals of `member_intervals`, then what outlasts the frame."""
    snapshots, refined, convex = problem.sequence.snapshots, problem.refined, problem.settings.ensemble.convex
    assert refined is not None

    def slip(interval: tuple[int, int]) -> Slip:
        ends = snapshots[interval[0]], snapshots[interval[1]]
        deviation = refined.slide_deviation(contacts, interval, (ends[0].sigma, ends[1].sigma))
        motion = RefinedMotion((refined.position_at(interval[0]), refined.position_at(interval[1])), deviation)
        return read_slip(contacts, problem.packing.grains, problem.walls, ends, convex, motion)

    slips = [None if interval is None else slip(interval) for interval in _intervals(snapshots, problem.k)]
    before, after = slips[:2]
    return (*slips, None if before is None or after is None else steady_slip(before, after))


def _seen_slip(slips: Sequence[Slip | None]) -> SeenSlip:
    """Of the intervals around the frame, before and after it the first that there is."""
    before, after, around = slips[:3]
    seen = next(slip.seen for slip in (around, before, after) if slip is not None)
    assert seen is not None
    return seen


def _intervals(snapshots: Sequence[Snapshot], k: int) -> tuple[tuple[int, int] | None, ...]:
    position = np.stack([np.where(s.present[:, None], s.position, np.nan) for s in snapshots])
    bounds = np.stack([s.endpoints if s.cell is None else s.cell[None] for s in snapshots])
    return member_intervals(k, find_reversals(bounds, position))
