"""Ensemble estimate of a frame: the weighted mean of members of two kinds, projected onto equilibrium.

Two Gauss-Seidel chains of different kinematic number carry inertia and history; five convex programmes read the
sliding of intervals before, after and around the frame. Each member keeps a history of its own, and its weight falls
with the noise of the sliding that it reads. The errors of the two kinds differ, so their mean is better than either;
averaging more members of one kind gains nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..assessment.status import SETTLED_DIFFERENCE
from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..contacts.pairs import are_among
from ..convex.dual_prices import ROUNDS
from ..convex.ensemble_members import NormalisedSlip, RefinedMotion, Slip, advance_convex_member, read_slip, steady_slip
from ..convex.friction_estimate import relative_power_gap
from ..convex.program import Balance, ConvexForces, LoadScale, assemble_balance, project_onto_equilibrium
from ..detection.contact_networks import PairProbability, ProbabilityNetwork
from ..detection.displacement import member_intervals
from ..frame_forces import MEMBERS
from ..nlgs.chain import ChainStep, advance_chain_through, force_scale
from ..nlgs.force_memory import ForceMemory
from ..nlgs.interval import Interval
from ..parallel import parallel_map
from ..posterior.frame_posterior import FramePosterior
from ..statistics.agreement import relative_change
from ..statistics.sliding import cone_fraction
from .frame_contacts import TouchingPairs, find_touching
from .frame_problem import FrameProblem
from .missing_contacts import BEARING_FRACTION, NO_MISSING, MissingContacts, find_missing_contacts


@dataclass(frozen=True, slots=True)
class EnsembleState:
    """Forces of all members on the previous frame, and its network."""

    soft: ForceMemory  # the chain whose sweeps are recorded
    stiff: ForceMemory
    other: ForceMemory  # the first chain from another start; the difference measures the influence of the start
    last: ForceMemory  # convex, interval (k − 1, k)
    ahead: ForceMemory  # convex, (k, k + 1)
    around: ForceMemory  # convex, (k − 1, k + 1)
    wide: ForceMemory  # convex, (k − 2, k + 2)
    steady: ForceMemory  # convex, sliding common to (k − 1, k) and (k, k + 1)
    pairs: PairProbability
    agreeing: int = 0  # consecutive frames in which H was below its level
    moved: bool = False  # whether chains have advanced through an interval since they started without forces

    @property
    def start_forgotten(self) -> bool:
        """Whether two starts have agreed for so many frames that the chain from another start can be dropped."""
        return self.agreeing >= AGREEING_FRAMES

    @classmethod
    def first(cls) -> EnsembleState:
        memory = ForceMemory.empty()
        return cls(memory, memory, memory, memory, memory, memory, memory, memory, PairProbability.none())

    def updated(self, contacts: Contacts, force: Array, present: NDArray[np.bool_]) -> EnsembleState:
        """The same network with all members continued from these forces (c, 2) [N]."""
        memory = self.last.renew(contacts, force, present)
        return EnsembleState(
            memory, memory, self.other, memory, memory, memory, memory, memory, self.pairs, self.agreeing, self.moved
        )


AGREEING_FRAMES = 3  # with H below its level: it only falls until the forces are reset
CHAINS = 2  # of the MEMBERS, the first
# Mean force of a chain over the force scale, below which the program could not distinguish its sum from zero.
LEAST_CHAIN = 0.02
# Free grains up to which the sweeps of the settings carry a load through a packing that had no forces. A load spreads
# from row to row like heat: the sweeps that it takes grow with the square of the rows, the number of grains.
REACHED_GRAINS = 1200

Task = Callable[[], Any]  # one member: a ChainStep, or forces with their memory


@dataclass(frozen=True, slots=True)
class EnsembleForces:
    """One frame of the ensemble, all on the contacts of `step`."""

    step: ChainStep  # of the first chain
    fn: Array  # (c,) [N] reported
    ft: Array  # (c,) [N]
    probability: Array  # (c,) P(touch) as detected; 0 for a contact that only a reviewer added
    member_fn: Array  # (m, c) [N] first chain, second chain, convex members that had something to read
    member_ft: Array  # (m, c) [N]
    weight: Array  # (m,) weight of each member in the mean, at most 1
    place: NDArray[np.intp]  # (m,) index of each member in MEMBERS
    state: EnsembleState
    start_difference: float  # H; NaN where no motion leads to the frame and once the start is forgotten
    remark: str  # deviations from the regular procedure; empty: none
    forbidden: Contacts  # detected, but excluded by a reviewer
    forbidden_probability: Array  # (m,) P(touch) of those, as detected
    missing: MissingContacts  # pairs among those of `step` that were not detected but shown by the balance
    seen_slip: NormalisedSlip  # around the frame where that is known, else before it or after
    power_gap: float  # mean of the convex members against the sliding that each reads; NaN where nothing slides
    balance: Balance

    @property
    def member_force(self) -> Array:
        """(f_n, f_t) of every one of MEMBERS (c, 7, 2) [N], NaN for those that had nothing to read."""
        force = np.full((self.member_fn.shape[1], len(MEMBERS), 2), np.nan)
        force[:, self.place, 0], force[:, self.place, 1] = self.member_fn.T, self.member_ft.T
        return force

    def cone_fraction(self, friction: Array) -> Array:
        """Fractions of the convex members and of the chains with a force on the Coulomb cone (c, 2); friction (c,)."""
        return cone_fraction(self.member_fn, self.member_ft, friction, self.place >= CHAINS)

    @property
    def fn_sd(self) -> Array:
        """Standard deviation of f_n among the members (c,) [N]."""
        return _weighted_sd(self.member_fn, self.weight)

    @property
    def ft_sd(self) -> Array:
        """Standard deviation of f_t among the members (c,) [N]."""
        return _weighted_sd(self.member_ft, self.weight)

    @property
    def disagreement(self) -> float:
        """D: rms standard deviation of f_n over the rms of f_n; 0 where no contact bears force."""
        size = float(np.linalg.norm(self.fn))
        return float(np.linalg.norm(_weighted_sd(self.member_fn, self.weight))) / size if size > 0 else 0.0

    @property
    def scale_disagreement(self) -> float:
        """Standard deviation of the sums of f_n among the members over that of the field; 0 where none bears force."""
        total = float(self.fn.sum())
        return float(_weighted_sd(self.member_fn.sum(axis=1)[:, None], self.weight)[0]) / total if total > 0 else 0.0


def solve_ensemble(
    problem: FrameProblem,
    state: EnsembleState,
    positions: FramePosterior | None = None,
) -> EnsembleForces:
    """Solve one frame of a sequence with all members; missing contacts are searched for in up to ROUNDS rounds.

    Parameters
    ----------
    problem : FrameProblem
    state : EnsembleState
        Of the previous frame.
    positions : FramePosterior, optional
        Position-only estimate, whose bearing pairs are offered to the members.
    """
    missing = NO_MISSING
    touching, chains, balance, members = _solve_members(problem, state, positions, missing)
    for _ in range(ROUNDS):
        more = find_missing_contacts(problem, touching.contacts, balance, members.convex)
        if more.count == 0:
            break
        missing = missing.joined(more)
        touching, chains, balance, members = _solve_members(problem, state, positions, missing)
    fn, ft, remark = _average(problem, balance, members)
    remark += _describe_missing(touching.contacts, fn, missing)
    # A member without an interval to read continues from the reported field.
    force = np.column_stack([fn, ft])
    reported = state.last.renew(touching.contacts, force, problem.snapshot.present)
    soft, stiff = (chains.soft.memory, chains.stiff.memory) if problem.motion.ends_here else (reported, reported)
    last, ahead, around, wide, steady = (reported if memory is None else memory for memory in members.memories)
    return EnsembleForces(
        chains.soft, fn, ft, touching.detected, members.force[:, :, 0], members.force[:, :, 1],
        np.array(members.weight), np.array(members.place),
        EnsembleState(
            soft, stiff, chains.other, last, ahead, around, wide, steady, touching.pairs, chains.agreeing,
            state.moved or problem.motion.ends_here,
        ),
        chains.start_difference, "; ".join([*members.remarks, *remark]), touching.forbidden,
        touching.forbidden_probability, missing.only(touching.contacts.key), members.seen_slip, members.power_gap,
        balance,
    )  # fmt: skip


def _solve_members(
    problem: FrameProblem, state: EnsembleState, positions: FramePosterior | None, missing: MissingContacts
) -> tuple[TouchingPairs, _Chains, Balance, _Members]:
    """Solve all members on the contacts that were detected, offered and found missing."""
    touching = find_touching(problem, positions, missing)
    starts = _chain_starts(problem, state, touching)
    workers = problem.settings.workers
    if problem.packing.scale_is_known:  # convex members do not wait for the chains
        balance = assemble_frame_balance(problem, touching.contacts)
        slips: list[Slip | None] = []

        def members() -> list[Task]:
            slips.extend(_slips(problem, touching.contacts))
            return _member_tasks(problem, state, touching, balance, slips)

        found = parallel_map(starts, workers, members)
        steps, convex = found[: len(starts)], found[len(starts) :]
    else:
        steps = parallel_map(starts, workers)
        balance = assemble_frame_balance(problem, touching.contacts, steps[0].solution.fn)
        slips = list(_slips(problem, touching.contacts))
        convex = parallel_map(_member_tasks(problem, state, touching, balance, slips), workers)
    chains = _compare_chains(touching.contacts, steps, state)
    return touching, chains, balance, _gather_members(slips, convex, chains, balance.friction)


def _describe_missing(contacts: Contacts, fn: Array, missing: MissingContacts) -> list[str]:
    """State how many missing contacts were added, and how many of them carry force."""
    added = are_among(contacts.key, missing.key)
    if not added.any():
        return []
    bearing = int((fn[added] > BEARING_FRACTION * fn[fn > 0].mean()).sum()) if (fn > 0).any() else 0
    count = int(added.sum())
    pairs = "1 contact that was" if count == 1 else f"{count} contacts that were"
    return [f"equilibrium needs {pairs} not detected, of which {bearing} {'bears' if bearing == 1 else 'bear'} force"]


@dataclass(frozen=True, slots=True)
class _Chains:
    """Results of the Gauss-Seidel chains."""

    soft: ChainStep
    stiff: ChainStep
    other: ForceMemory  # of the first chain from another start
    start_difference: float  # H
    agreeing: int


@dataclass(frozen=True, slots=True)
class _Members:
    """Fields that enter the mean, and the memories of the convex members."""

    force: Array  # (m, c, 2) [N]
    weight: list[float]  # (m,)
    place: list[int]  # (m,) index in MEMBERS
    memories: list[ForceMemory | None]  # of the five convex members; None: no interval to read
    remarks: list[str]
    seen_slip: NormalisedSlip
    power_gap: float  # mean of the convex members

    @property
    def convex(self) -> list[Array]:
        """The fields (c, 2) [N] of the convex members."""
        return [force for force, place in zip(self.force, self.place, strict=True) if place >= CHAINS]


def _chain_starts(problem: FrameProblem, state: EnsembleState, touching: TouchingPairs) -> list[Task]:
    """The two chains, and the first once more from another start unless the start is forgotten."""
    packing, motion, contacts = problem.packing, problem.motion, touching.contacts
    chain = problem.settings.chain
    if not state.moved:
        reached = max(int((problem.snapshot.present & packing.grains.free).sum()) / REACHED_GRAINS, 1.0)
        chain = replace(chain, sweeps=round(reached * chain.sweeps))
    network = ProbabilityNetwork(state.pairs if motion.ends_here else touching.pairs, touching.pairs)
    assert chain.kappa is not None
    unrecorded = replace(chain, keep="none")
    starts = [
        (state.soft, chain),
        (state.stiff, replace(unrecorded, kappa=chain.kappa * problem.settings.ensemble.stiffer)),
    ]
    compares_starts = motion.ends_here and not state.start_forgotten
    if compares_starts:
        other = state.other
        if len(state.soft.key) == 0:  # the first chain starts from zero: this one from uniform forces
            uniform = np.column_stack([np.full(contacts.count, force_scale(packing, chain)), np.zeros(contacts.count)])
            other = other.renew(contacts, uniform, problem.snapshot.present)
        starts.append((other, unrecorded))
    interval = Interval(packing, motion, network)
    return [partial(advance_chain_through, interval, memory, settings) for memory, settings in starts]


def _compare_chains(contacts: Contacts, steps: list[ChainStep], state: EnsembleState) -> _Chains:
    """Collect the chains' results, and how far two starts of the first differ."""
    soft, stiff, *rest = steps
    if not rest:
        return _Chains(soft, stiff, state.other, np.nan, state.agreeing)
    (other,) = rest
    difference = relative_change(contacts.key, soft.solution.force, contacts.key, other.solution.force)
    agreeing = state.agreeing + 1 if difference <= SETTLED_DIFFERENCE else 0
    return _Chains(soft, stiff, other.memory, difference, agreeing)


def assemble_frame_balance(problem: FrameProblem, contacts: Contacts, fn: Array | None = None) -> Balance:
    """Balance of the frame on these contacts (c); fn (c,): of the first chain, needed where no load sets the scale."""
    packing, walls, wall_total = problem.packing, problem.walls, None
    unit = force_scale(packing, problem.settings.chain)
    if not packing.scale_is_known:  # without load and weight forces are known up to a scale: that of the first chain
        assert fn is not None
        wall_total, count = float(fn[contacts.gauge].sum()), int(contacts.gauge.sum())
        if wall_total < LEAST_CHAIN * unit * count:  # at rest it bears nothing, and no program is as exact as that
            wall_total = unit * count
    return assemble_balance(
        contacts, packing.grains, walls, present=problem.snapshot.present,
        friction=packing.material.friction_at(contacts.with_wall),
        scale=LoadScale(unit, packing.material.gravity, wall_total),
    )  # fmt: skip


def _member_tasks(
    problem: FrameProblem, state: EnsembleState, touching: TouchingPairs, balance: Balance, slips: Sequence[Slip | None]
) -> list[Task]:
    """The convex members that have an interval to read."""
    former = (state.last, state.ahead, state.around, state.wide, state.steady)
    convex = problem.settings.ensemble.convex
    return [
        partial(
            advance_convex_member,
            balance,
            touching.contacts,
            problem.snapshot,
            slip,
            touching.probability,
            memory,
            convex,
        )
        for slip, memory in zip(slips, former, strict=True)
        if slip is not None
    ]


def _gather_members(
    slips: Sequence[Slip | None],
    convex: Sequence[tuple[ConvexForces, ForceMemory]],
    chains: _Chains,
    friction: Array,
) -> _Members:
    """Collect all members that converged; convex: results of those with an interval to read; friction (c,)."""
    fields = [chains.soft.solution.force, chains.stiff.solution.force]
    weight, place = [1.0, 1.0], [0, 1]
    memories: list[ForceMemory | None] = []
    remarks: list[str] = []
    gaps: list[float] = []
    found = iter(convex)
    for number, slip in enumerate(slips, start=CHAINS):
        if slip is None:
            memories.append(None)
            continue
        forces, updated = next(found)
        if forces.converged:
            fields.append(np.column_stack([forces.fn, forces.ft]))
            weight.append(slip.weight)
            place.append(number)
            gaps.append(relative_power_gap(slip.value, friction, forces.fn, forces.ft))
        else:
            remarks.append(f"a convex member was left out ({forces.termination})")
        memories.append(updated)
    known = [each for each in gaps if np.isfinite(each)]
    gap = float(np.mean(known)) if known else np.nan
    return _Members(np.stack(fields), weight, place, memories, remarks, _seen_slip(slips), gap)


def _average(problem: FrameProblem, balance: Balance, members: _Members) -> tuple[Array, Array, list[str]]:
    """Weighted mean of the members projected onto equilibrium, f_n and f_t (c,) [N]; and remarks."""
    mean = np.average(members.force, axis=0, weights=members.weight)
    projected = project_onto_equilibrium(balance, mean[:, 0], mean[:, 1], problem.settings.ensemble.convex)
    if projected.converged:
        return projected.fn, projected.ft, []
    return mean[:, 0], mean[:, 1], [f"the mean was not projected onto equilibrium ({projected.termination})"]


def _weighted_sd(member: Array, weight: Array) -> Array:
    mean = np.average(member, axis=0, weights=weight)
    return np.sqrt(np.average((member - mean) ** 2, axis=0, weights=weight))


def _slips(problem: FrameProblem, contacts: Contacts) -> tuple[Slip | None, ...]:
    """Slips that the convex members read at frame k: by interval, then the one common to both neighbours."""
    snapshots, refined, convex = problem.sequence.snapshots, problem.refined, problem.settings.ensemble.convex
    assert refined is not None

    def slip(interval: tuple[int, int]) -> Slip:
        ends = snapshots[interval[0]], snapshots[interval[1]]
        slide_sd = refined.sliding_sd(contacts, interval, (ends[0].sigma, ends[1].sigma))
        motion = RefinedMotion((refined.position_at(interval[0]), refined.position_at(interval[1])), slide_sd)
        return read_slip(contacts, problem.packing.grains, problem.walls, ends, convex, motion)

    slips = [None if interval is None else slip(interval) for interval in _intervals(problem)]
    before, after = slips[:2]
    return (*slips, None if before is None or after is None else steady_slip(before, after))


def _seen_slip(slips: Sequence[Slip | None]) -> NormalisedSlip:
    """Slip of the first available interval: around the frame, before it, after it."""
    before, after, around = slips[:3]
    seen = next(slip.normalised for slip in (around, before, after) if slip is not None)
    assert seen is not None
    return seen


def _intervals(problem: FrameProblem) -> tuple[tuple[int, int] | None, ...]:
    assert problem.sequence.reversed_at is not None
    return member_intervals(problem.k, problem.sequence.reversed_at, problem.settings.used_span)
