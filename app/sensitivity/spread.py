"""Error bars from an ensemble: the sequence solved again with everything resampled that is not known exactly.

A member sees the positions with noise of the stated precision added once more, and another kinematic number,
friction and surface; S is the spread of the members' forces around the nominal ones, which stay the reported ones:
a mean of members would count the noise twice. σ² = (a S)² + (b s)², s the standard deviation that a run states without
them: it knows what resampling cannot show, above all the history that photographs do not carry. A constant share of the
mean force in its place covers less evenly. Where s covers by itself, members may only widen it: b is 1. The constants
were fitted on simulated truth (`rodsight study uncertainty` prints them anew).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, recall
from solver.sequence.frame_forces import FrameForces

from ..inference.inference import Inputs
from ..progress import Progress, silent
from ..results.checkpoint import Checkpoint
from .design import Case, vary
from .execution import run_all
from .factors import FACTORS
from .networks import Networks, VariedInputs, infer

# a and b of f_n, and of f_t
DEVIATION = {"ensemble": ((0.3, 1.0), (0.3, 1.0)), "nlgs": ((1.4, 1.18), (1.43, 0.92))}
# What a member varies beside the noise, between which factors of what was given. Friction: grains and walls alike.
RANGES: dict[str, tuple[float, float]] = {"friction": (0.9, 1.1), "overlap": (0.5, 2.0), "kappa": (0.5, 2.0)}
SEED = 20  # of the members' draws: the same input gives the same bits


@dataclass(frozen=True, slots=True)
class Spread:
    """Root mean square distance of the members' forces from the nominal ones, on the contacts of one frame."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]


def make_members(count: int) -> list[Case]:
    """What each of `count` members changes: a Latin hypercube over RANGES, noise drawn anew for each."""
    from scipy.stats import qmc  # half a second of imports that no other command needs

    unit = qmc.LatinHypercube(len(RANGES), rng=np.random.default_rng(SEED)).random(count)
    order = [each.name for each in FACTORS]
    cases = []
    for number, row in enumerate(unit):
        values = {"position_noise": 1.0, "rotation_noise": 1.0}
        for part, (name, (low, high)) in zip(row.tolist(), RANGES.items(), strict=True):
            values[name] = float(low * (high / low) ** part)
        values["wall_friction"] = values["friction"]
        cases.append(Case(tuple(sorted(values.items(), key=lambda item: order.index(item[0]))), seed=SEED + number))
    return cases


def calibrated_inputs(inputs: Inputs) -> VariedInputs:
    """Inputs whose tracks and walls are calibrated and whose radii are tuned: members start from them as they are."""
    return VariedInputs.of(replace(inputs, settings=inputs.settings.uncorrected()), inputs.tracks.sigma)


def solve_member(inputs: VariedInputs, case: Case) -> Networks:
    """Solve one member. Centres that are not known exactly are off by an error that turns with the grain."""
    tracks = inputs.tracks
    if tracks.centre_sigma is not None:
        rng = np.random.default_rng([case.seed, len(FACTORS)])
        offset = tracks.centre_sigma[:, None] * rng.standard_normal((tracks.grain_count, 2))
        cos, sin = np.cos(tracks.rotation), np.sin(tracks.rotation)
        turned = np.stack([cos * offset[:, 0] - sin * offset[:, 1], sin * offset[:, 0] + cos * offset[:, 1]], axis=2)
        inputs = replace(inputs, tracks=replace(tracks, position=tracks.position + turned))
    return infer(vary(inputs, case))


def solve_members(
    inputs: VariedInputs,
    count: int,
    checkpoint: Checkpoint | None = None,
    *,
    workers: int = 1,
    progress: Progress = silent,
) -> list[Networks]:
    """All members; those kept in the checkpoint are not solved again."""
    cases = make_members(count)
    kept = min(checkpoint.finished(), count) if checkpoint is not None else 0
    found: dict[int, Networks] = {}
    if checkpoint is not None:
        found = {number: checkpoint.load(number, Networks)[0] for number in range(kept)}
    saved = kept
    progress("ensemble", kept, count)
    with closing(run_all(solve_member, inputs, cases[kept:], workers=workers)) as results:
        for number, networks in results:
            found[kept + number] = networks
            while checkpoint is not None and saved in found:  # a checkpoint is filled from its first on
                checkpoint.save(saved, found[saved])
                saved += 1
            progress("ensemble", len(found), count)
    return [found[number] for number in range(count)]


def spread_around(key: Keys, force: Array, members: Sequence[tuple[Keys, Array]]) -> Spread:
    """Spread of the members around nominal forces (c, 2) [N] on contacts named by key (c,); absent is zero.

    members: keys (m,) and forces (m, 2) [N] of each.
    """
    square = np.zeros_like(force)
    for other_key, other in members:
        square += (recall(key, other_key, other) - force) ** 2
    rms = np.sqrt(square / max(len(members), 1))
    return Spread(rms[:, 0], rms[:, 1])


def deviation(spread: Array, free: Array, constants: tuple[float, float]) -> Array:
    """σ (c,) [N] from the spread (c,) [N] and the free formula's σ (c,) [N]; constants: a and b."""
    return np.hypot(constants[0] * spread, constants[1] * free)


def with_spread(frames: Sequence[FrameForces], members: Sequence[Networks], estimator: str) -> list[FrameForces]:
    """The same forces with the standard deviations that the members give, in place of the free formula's."""
    return [frame_with_spread(frame, [each.at(k) for each in members], estimator) for k, frame in enumerate(frames)]


def frame_with_spread(frame: FrameForces, members: Sequence[tuple[Keys, Array]], estimator: str) -> FrameForces:
    """Likewise of one frame; members: keys (m,) and forces (m, 2) [N] of each."""
    spread = spread_around(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), members)
    normal, tangent = DEVIATION[estimator]
    fn_sd = deviation(spread.fn, frame.fn_sd, normal)
    ft_sd = deviation(spread.ft, frame.ft_sd, tangent)
    return replace(frame, fn_sd=fn_sd, ft_sd=ft_sd)
