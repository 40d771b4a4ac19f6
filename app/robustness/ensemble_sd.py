"""Standard deviations from an ensemble: the sequence solved again with every uncertain input resampled.

A member has noise of the stated precision added to its positions once more, and another kinematic number, friction and
roughness. S is the rms deviation of the members' forces from the nominal ones, which remain the reported ones: a mean
of members would contain the noise twice. S is combined with the standard deviation s of a run without an ensemble,
which covers the error that resampling cannot show, above all the history that photographs do not carry. A constant
fraction of the mean force in place of s covers less evenly. Where s covers by itself, members may only widen it:
b is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from ..inference.inputs import Inputs
from ..process.progress import Progress, no_progress
from ..results.checkpoint import Checkpoint
from ..solver.bodies.grains import Array
from ..solver.contacts.pairs import Keys, match_values
from ..solver.frame_forces import FrameForces
from .design import Case, vary
from .execution import run_all
from .factors import FACTORS
from .networks import Networks, VariedInputs, infer

# a and b of f_n, and of f_t, by estimator: fitted on simulated truth by `rodsight study uncertainty`.
SD_WEIGHTS = {"ensemble": ((0.3, 1.0), (0.3, 1.0)), "nlgs": ((1.4, 1.18), (1.43, 0.92))}
# Factors that vary in the members beside the noise, with their range. Friction: grains and walls alike.
RANGES: dict[str, tuple[float, float]] = {"friction": (0.9, 1.1), "overlap": (0.5, 2.0), "kappa": (0.5, 2.0)}
SEED = 20  # of the members' draws: the same input gives the same bits


@dataclass(frozen=True, slots=True)
class EnsembleSd:
    """Rms deviation of the members' forces from the nominal ones, on the contacts of one frame."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]


def make_members(count: int) -> list[Case]:
    """Draw the inputs of the members: a Latin hypercube over RANGES, with noise of its own for each."""
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
    """Inputs whose tracks and walls are calibrated and whose radii are tuned: members do neither again."""
    return VariedInputs.of(replace(inputs, settings=inputs.settings.uncorrected()), inputs.tracks.sigma)


def solve_member(inputs: VariedInputs, case: Case) -> Networks:
    """Solve one member. Errors of uncertain centres are constant in the grain and rotate with it."""
    tracks = inputs.tracks
    if tracks.centre_sigma is not None:
        rng = np.random.default_rng([case.seed, len(FACTORS)])
        offset = tracks.centre_sigma[:, None] * rng.standard_normal((tracks.grain_count, 2))
        cos, sin = np.cos(tracks.rotation), np.sin(tracks.rotation)
        rotated = np.stack([cos * offset[:, 0] - sin * offset[:, 1], sin * offset[:, 0] + cos * offset[:, 1]], axis=2)
        inputs = replace(inputs, tracks=replace(tracks, position=tracks.position + rotated))
    return infer(vary(inputs, case))


def solve_members(
    inputs: VariedInputs,
    count: int,
    checkpoint: Checkpoint | None = None,
    *,
    workers: int = 1,
    progress: Progress = no_progress,
) -> list[Networks]:
    """Solve all members except those in the checkpoint; returns all of them."""
    cases = make_members(count)
    stored = min(checkpoint.finished(), count) if checkpoint is not None else 0
    solved: dict[int, Networks] = {}
    if checkpoint is not None:
        solved = {number: checkpoint.load(number, Networks)[0] for number in range(stored)}
    saved = stored
    progress("ensemble", stored, count)
    with closing(run_all(solve_member, inputs, cases[stored:], workers=workers)) as results:
        for number, networks in results:
            solved[stored + number] = networks
            while checkpoint is not None and saved in solved:  # a checkpoint is filled in order
                checkpoint.save(saved, solved[saved])
                saved += 1
            progress("ensemble", len(solved), count)
    return [solved[number] for number in range(count)]


def measure_ensemble_sd(key: Keys, force: Array, members: Sequence[tuple[Keys, Array]]) -> EnsembleSd:
    """Measure the rms deviation of the members' forces from the nominal ones.

    Parameters
    ----------
    key : ndarray, shape (c,)
        Contacts of the nominal run.
    force : ndarray, shape (c, 2)
        Their nominal forces [N].
    members : sequence of (ndarray, shape (m,), ndarray, shape (m, 2))
        Contacts of each member and their forces [N]; a contact that a member lacks has zero force there.
    """
    square = np.zeros_like(force)
    for member_key, member_force in members:
        square += (match_values(key, member_key, member_force) - force) ** 2
    rms = np.sqrt(square / max(len(members), 1))
    return EnsembleSd(rms[:, 0], rms[:, 1])


def combine_sd(ensemble_sd: Array, formula_sd: Array, weights: tuple[float, float]) -> Array:
    """Combine the standard deviations of an ensemble and of a run without one.

    Parameters
    ----------
    ensemble_sd : ndarray, shape (c,)
        S, rms deviation of the members [N].
    formula_sd : ndarray, shape (c,)
        s, standard deviation without an ensemble [N].
    weights : tuple of float
        a and b.

    Returns
    -------
    ndarray, shape (c,)
        σ [N].

    Notes
    -----
    σ² = (a S)² + (b s)².
    """
    return np.hypot(weights[0] * ensemble_sd, weights[1] * formula_sd)


def with_ensemble_sd(frames: Sequence[FrameForces], members: Sequence[Networks], estimator: str) -> list[FrameForces]:
    """Replace the standard deviations of all frames by those with the members; the forces stay."""
    return [
        frame_with_ensemble_sd(frame, [each.at(k) for each in members], estimator) for k, frame in enumerate(frames)
    ]


def frame_with_ensemble_sd(frame: FrameForces, members: Sequence[tuple[Keys, Array]], estimator: str) -> FrameForces:
    """Replace the standard deviations of one frame; members: keys (m,) and forces (m, 2) [N] of each."""
    ensemble = measure_ensemble_sd(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), members)
    normal, tangential = SD_WEIGHTS[estimator]
    fn_sd = combine_sd(ensemble.fn, frame.fn_sd, normal)
    ft_sd = combine_sd(ensemble.ft, frame.ft_sd, tangential)
    return replace(frame, fn_sd=fn_sd, ft_sd=ft_sd)
