"""Errors of the radii, from all frames together: one error per radius, shared, while forces and centres change.

In a single frame an error of a radius hides behind those of the centres. Neighbours change, forces move about, and
what stays is the radius. How far radii scatter is estimated before: exact ones must not be made worse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.posterior.sampler.chain import Chain, centres_of, laws_of, pairs_of, run_chain
from solver.posterior.sampler.records import Centres, Pairs
from solver.posterior.sequence_evidence import SequenceEvidence, gather_evidence
from solver.posterior.settings import PosteriorSettings

FRAMES = 12  # looked at together, spread evenly
WORTH = 0.5  # scatter of the radii over that of the centres, or over the noise, below which nothing is to be gained
SHARPNESS = 0.3  # bearing width over the noise: wider than for forces, so that radii can move
ANNEALING = 600
KEPT = 400
HONEST = 3.0  # true over sampled standard deviation: a chain that moves one thing at a time sees too little of it


@dataclass(frozen=True, slots=True)
class RadiusPosterior:
    """Errors found in the radii. Add the correction to what was told."""

    correction: Float[Array, " n"]  # [m] from told to true radius, on average over the draws
    deviation: Float[Array, " n"]  # [m] standard deviation of what is left
    prior_deviation: float  # [m] how far radii scatter, as the gaps say; 0: they are exact as far as can be told
    shared: bool  # the correction contains one that follows from gaps that stand apart or share an error; their other
    # errors, over the picture, are still in the gaps: give a `shared_error` when evidence is gathered again


def radii_scatter(packing: Packing, snapshots: Sequence[Snapshot]) -> bool:
    """Whether radii scatter by more than the errors of centres and the noise hide."""
    try:
        return _worth_it(gather_evidence(packing, snapshots))
    except ValueError:  # no two bodies are near
        return False


def estimate_radii(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    rng: np.random.Generator,
    settings: PosteriorSettings | None = None,
    *,
    shared_error: float = 0.0,
) -> RadiusPosterior:
    """Find the errors of the radii from the positions of a sequence.

    shared_error [m]: as for `gather_evidence`. Errors: ValueError if no two bodies are near.
    """
    rows = np.unique(np.linspace(0, len(snapshots) - 1, min(FRAMES, len(snapshots))).astype(int))
    evidence = gather_evidence(packing, snapshots, settings, shared_error=shared_error)
    shared, sd = evidence.radius_correction, evidence.radius_deviation
    if not _worth_it(evidence):
        return RadiusPosterior(shared, np.full(len(shared), sd), sd, evidence.corrected)
    chain = _run_joint_chain(evidence, rows, rng)
    diameter = 2.0 * float(packing.grains.radius.mean())
    mean, square = chain.error[: len(shared), 2], chain.error[: len(shared), 3]
    sampled = np.sqrt(np.maximum(square - mean**2, 0.0)) * diameter
    # The guess was cautious, for gaps that an error widens pass for open; the draws have seen the errors themselves.
    sd = max(sd, diameter * float(np.sqrt(square.mean())))
    deviation = np.minimum(HONEST * sampled, sd)
    return RadiusPosterior(shared + diameter * mean, deviation, sd, evidence.corrected)


def _worth_it(evidence: SequenceEvidence) -> bool:
    return evidence.radius_deviation > WORTH * max(float(np.median(evidence.centre_deviation)), evidence.noise.sigma)


def _run_joint_chain(evidence: SequenceEvidence, rows: np.ndarray, rng: np.random.Generator) -> Chain:
    measured = replace(evidence, gap=evidence.unsmoothed)
    frames = [measured.of_frame(int(k)) for k in rows]
    diameter = frames[0].diameter
    width = SHARPNESS * evidence.noise.sigma / diameter
    settings = replace(evidence.settings, width=width, annealing=ANNEALING, kept=KEPT)
    expected = float(sum(each.prior.sum() for each in frames))
    laws = laws_of(settings, expected, scale_known=frames[0].known.fix_the_scale)
    pairs, centres = stack_frames([pairs_of(each) for each in frames], [centres_of(each) for each in frames])
    return run_chain(pairs, centres, laws, settings, rng)


def stack_frames(pairs: Sequence[Pairs], centres: Sequence[Centres]) -> tuple[Pairs, Centres]:
    """Lay frames one after the other, each with grains and known sums of its own; radii they share."""
    grains = np.cumsum([0] + [len(each.lever) for each in centres])
    groups = np.cumsum([0] + [len(each.group_load) for each in centres])
    counts = np.cumsum([0] + [len(each.i) for each in pairs])
    links = np.cumsum([0] + [len(each.row) for each in centres])
    moved_pairs = [
        each._replace(
            i=each.i + grains[k],
            j=np.where(each.j >= 0, each.j + grains[k], -1),
            group=np.where(each.group >= 0, each.group + groups[k], -1),
        )
        for k, each in enumerate(pairs)
    ]
    moved_centres = [
        each._replace(row=each.row + counts[k], start=each.start[:-1] + links[k]) for k, each in enumerate(centres)
    ]
    stacked = Centres(*(np.concatenate(field) for field in zip(*moved_centres, strict=True)))
    return (
        Pairs(*(np.concatenate(field) for field in zip(*moved_pairs, strict=True))),
        stacked._replace(start=np.append(stacked.start, links[-1]), radius_deviation=centres[0].radius_deviation),
    )
