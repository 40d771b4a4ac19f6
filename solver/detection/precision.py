"""How precise the positions are and how far touching surfaces overlap, read from the gaps themselves.

Rods that touch in three photographs in a row have the same gap in all of them, whatever it is: what their gaps scatter
in time is noise of the positions, g₋ − 2g + g₊ having twelve times the variance of a position component. What
is left of their negative gaps once that noise is taken off is overlap: elasticity, roughness and errors of the radii.
A negative mean gap says by itself that a pair touches, so neither needs a threshold that would depend on the answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from solver.bodies.grains import Array, Grains
from solver.bodies.motion import Snapshot
from solver.contacts.contacts import detect_contacts, measure_contacts

REACH = 0.02  # [mean diameter] pairs beyond it cannot touch
FEWEST = 200  # gaps below which nothing is claimed
TRIPLES = 24  # photographs looked at, spread evenly
NORMAL = 1.4826  # standard deviation over median absolute deviation
UNSURE = 0.1  # share of the noise's variance by which it may be off where it is taken away
CONTRADICTION = 1.3  # factor between stated and measured precision from which on the measured one counts


@dataclass(frozen=True, slots=True)
class Precision:
    """What the gaps say."""

    sigma: float  # [m] standard deviation of a position component
    overlap: float  # [m] rms over touching pairs, noise taken off
    count: int  # gaps that it rests on


def measure_precision(grains: Grains, snapshots: Sequence[Snapshot]) -> Precision | None:
    """Measure the precision of positions; None where fewer than FEWEST gaps in a row tell."""
    if len(snapshots) < 3:
        return None
    middles = np.unique(np.linspace(1, len(snapshots) - 2, min(TRIPLES, len(snapshots) - 2)).astype(int))
    gaps = np.concatenate([_gaps_in_a_row(grains, snapshots[k - 1 : k + 2]) for k in middles], axis=1)
    mean = gaps.mean(axis=0)
    gaps, mean = gaps[:, mean <= 0.0], mean[mean <= 0.0]
    if len(mean) < FEWEST:
        return None
    sigma = NORMAL * float(np.median(np.abs(gaps[0] - 2.0 * gaps[1] + gaps[2]))) / np.sqrt(12.0)
    overlap = float(np.sqrt(max(np.mean(mean**2) - 2.0 / 3.0 * sigma**2, 0.0)))
    return Precision(sigma, overlap, len(mean))


def contradiction(found: Precision, stated: float) -> float:
    """Measured over stated standard deviation [m] where the measurement contradicts it, else 1."""
    factor = found.sigma / stated
    return 1.0 if 1.0 / CONTRADICTION <= factor <= CONTRADICTION else factor


def describe_contradiction(found: Precision, factor: float) -> str:
    """What contradicts the stated precision, in words; factor: measured over stated."""
    told = f"{1e6 * found.sigma:.2g} µm from photograph to photograph, {factor:.2g} times the stated precision"
    return f"positions scatter by {told}, as the gaps of touching rods show"


def believed_precision(found: Precision, stated: Sequence[float], overlap: float) -> tuple[float, float]:
    """Factor on the stated standard deviations (f,) [m], and the overlap [m] to go on with.

    overlap [m] is the assumed one. Both stay as they are where the measurement does not contradict them.
    """
    factor = contradiction(found, float(np.median(stated)))
    # What the noise hides of the overlap is not held against the assumption.
    unsure = UNSURE * found.sigma**2
    variance = float(np.clip(overlap**2, found.overlap**2 - unsure, found.overlap**2 + unsure))
    return factor, float(np.sqrt(variance))


def with_precision(snapshots: Sequence[Snapshot], factor: float) -> list[Snapshot]:
    """The snapshots with all standard deviations multiplied."""
    return [replace(each, sigma=factor * each.sigma) for each in snapshots]


def _gaps_in_a_row(grains: Grains, three: Sequence[Snapshot]) -> Array:
    """Gaps (3, c) [m] of near pairs of grains that all three snapshots show."""
    walls = [s.walls for s in three]
    present = three[0].present & three[1].present & three[2].present
    near = detect_contacts(grains, three[1].position, present, walls[1], REACH * 2.0 * float(grains.radius.mean()))
    i, j = near.i[~near.with_wall], near.j[~near.with_wall]
    return np.stack([measure_contacts(grains, s.position, w, i, j).gap for s, w in zip(three, walls, strict=True)])
