"""The paper's claims, tested on simulated truth: claim, measurement, verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ..inference.infer_sequence import infer_sequence
from ..inference.inputs import Inputs
from ..process.progress import Progress, no_progress
from ..solver.bodies.grains import Array
from ..solver.contacts.contacts import measure_pairs
from ..solver.contacts.pairs import align
from ..solver.dem.dem_truth import DemTruth
from ..solver.frame_forces import FrameForces
from ..solver.nlgs.chain import ChainSettings
from ..solver.sequence.settings import SequenceSettings
from ..solver.statistics.agreement import pearson
from ..solver.statistics.force_statistics import plateau_ratio, tail_exponent
from ..solver.statistics.packing_area import packing_area
from ..solver.statistics.stress import friction_angle, love_weber_stress, principal_stresses
from .truths import agreement_of, observe, packing_of, simulate, true_forces, window_starts, with_imposed_walls

WINDOW = 14  # photographs of one sequence
SETTLED_WITHIN = 0.01  # below the mean r of the last four frames
SAME_PATTERN = 0.9  # least correlation of f_n under both boundary conditions
NOISE = 1e-5  # [m], the precision the paper states


@dataclass(frozen=True, slots=True)
class ClaimVerdict:
    claim: str
    measured: str
    verdict: str


@dataclass(frozen=True, slots=True)
class _Sequence:
    truth: DemTruth
    start: int
    frames: list[FrameForces]


def study_claims(
    seeds: Sequence[int],
    *,
    grains: int,
    folder: Path,
    console: Console,
    progress: Progress = no_progress,
    window: int = WINDOW,
) -> list[ClaimVerdict]:
    """Test the paper's claims on packings of these seeds and print the verdicts."""
    truths = [simulate(seed, grains=grains, folder=folder, progress=progress) for seed in seeds]
    ours = _solve_all(truths, window, progress, "ensemble")
    paper = _solve_all(truths, window, progress, "paper", _as_the_paper)
    fixed = _solve_all(truths, window, progress, "imposed", with_imposed_walls)
    verdicts = [
        _settling(paper, ours),
        _boundaries(ours, fixed),
        _friction_angles(ours),
        _directions(ours),
        _distribution(ours),
    ]
    table = Table(
        title=f"The paper's claims on {len(truths)} simulated packings of {grains} rods, 10 µm noise", box=None
    )
    for heading in ("claim", "measured", "verdict"):
        table.add_column(heading, overflow="fold")
    for row in verdicts:
        table.add_row(row.claim, row.measured, row.verdict)
    console.print(table)
    return verdicts


def _as_the_paper(inputs: Inputs) -> Inputs:
    """Replace the settings by the paper's: inertia only, one step per interval, stop at ε_f, reset to zero."""
    chain = ChainSettings(kappa=None, substeps=1, spin_up=1, sweeps=5000, force_change=1e-2, keep="none")
    sequence = SequenceSettings(estimator="nlgs", chain=chain, reset_to_zero=True)
    return replace(inputs, settings=replace(inputs.settings, sequence=sequence))


def _solve_all(
    truths: Sequence[DemTruth],
    window: int,
    progress: Progress,
    label: str,
    changed: Callable[[Inputs], Inputs] = lambda inputs: inputs,
) -> list[_Sequence]:
    """Solve a loading and an unloading window of every truth, with changed inputs."""
    found, done = [], 0
    for number, truth in enumerate(truths):
        for start in window_starts(truth, window):
            rng = np.random.default_rng([number, start])
            frames = []
            inputs = changed(observe(truth, range(start, start + window), NOISE, rng))
            for frame in infer_sequence(inputs, diagnosis=()).frames:
                frames.append(frame)
                done += 1
                progress(label, done, 2 * window * len(truths))
            found.append(_Sequence(truth, start, frames))
    return found


def _r(sequences: list[_Sequence]) -> Array:
    return np.array([[agreement_of(f, s.truth, s.start + f.frame).r_fn for f in s.frames] for s in sequences])


def _settled_at(r: Array) -> int:
    """Return the first frame from which the mean over sequences stays near the mean of its last four frames."""
    mean = r.mean(axis=0)
    off = np.flatnonzero(mean < mean[-4:].mean() - SETTLED_WITHIN)
    return int(off[-1]) + 1 if len(off) else 0


def _settling(paper: list[_Sequence], ours: list[_Sequence]) -> ClaimVerdict:
    r_paper, r_ours = _r(paper), _r(ours)
    return ClaimVerdict(
        "settles in about five photographs",
        f"paper's method: r {r_paper[:, 1].mean():.2f} at the first pair, level {r_paper[:, -4:].mean():.2f}, reached "
        f"at frame {_settled_at(r_paper)}; default: {r_ours[:, 1].mean():.3f}, level {r_ours[:, -4:].mean():.3f}, "
        f"frame {_settled_at(r_ours)}",
        "about right for its method" if 3 <= _settled_at(r_paper) <= 8 else "not confirmed",
    )


def _boundaries(loaded: list[_Sequence], imposed: list[_Sequence]) -> ClaimVerdict:
    """Compare patterns only: without a load the factor of a frame is open, and is set to a mean force of one."""
    r = []
    for one, other in zip(loaded, imposed, strict=True):
        for a, b in zip(one.frames[3:], other.frames[3:], strict=True):
            _, fa, fb = align(a.contacts.key, a.fn, b.contacts.key, b.fn)
            r.append(pearson(fa, fb))
    return ClaimVerdict(
        "both boundary conditions agree up to one factor",
        f"pattern: r {np.mean(r):.3f} (least {np.min(r):.3f}); without a load the factor is open in every frame",
        "pattern yes" if np.min(r) > SAME_PATTERN else "no",
    )


def _stresses(sequences: list[_Sequence]) -> tuple[list[Array], list[Array]]:
    inferred, true = [], []
    for s in sequences:
        packing = packing_of(s.truth)
        for forces in s.frames[3:]:
            k = s.start + forces.frame
            walls = packing.walls(s.truth.endpoints[k])
            area = packing_area(walls, s.truth.position[k])
            key, force = true_forces(s.truth, k)
            exact = measure_pairs(packing.grains, s.truth.position[k], walls, key)
            force = force[np.argsort(key)]
            position = s.truth.position[k]
            true.append(love_weber_stress(exact, force[:, 0], force[:, 1], position, area, packing.length))
            inferred.append(love_weber_stress(forces.contacts, forces.fn, forces.ft, position, area, packing.length))
    return inferred, true


def _friction_angles(sequences: list[_Sequence]) -> ClaimVerdict:
    inferred, true = _stresses(sequences)
    error = np.rad2deg([friction_angle(a) - friction_angle(b) for a, b in zip(inferred, true, strict=True)])
    rms = float(np.sqrt(np.mean(error**2)))
    return ClaimVerdict(
        "macroscopic friction angles about the same",
        f"rms error {rms:.2f}° (mean {error.mean():+.2f}°)",
        "yes" if rms < 1.5 else "no",
    )


def _directions(sequences: list[_Sequence]) -> ClaimVerdict:
    inferred, true = _stresses(sequences)
    error = [principal_stresses(a)[2] - principal_stresses(b)[2] for a, b in zip(inferred, true, strict=True)]
    error = np.rad2deg((np.array(error) + np.pi / 2) % np.pi - np.pi / 2)
    rms = float(np.sqrt(np.mean(error**2)))
    return ClaimVerdict(
        "principal directions of the stress agree", f"rms error {rms:.2f}°", "yes" if rms < 3.0 else "no"
    )


def _distribution(sequences: list[_Sequence]) -> ClaimVerdict:
    ours, true = [], []
    for s in sequences:
        for forces in s.frames[3:]:
            fn = forces.fn[forces.fn > 0.01 * forces.fn.mean()]
            exact = true_forces(s.truth, s.start + forces.frame)[1][:, 0]
            exact = exact[exact > 0.01 * exact.mean()]
            ours.append(fn / fn.mean())
            true.append(exact / exact.mean())
    a, b = np.sort(np.concatenate(ours)), np.sort(np.concatenate(true))
    grid = np.linspace(0, 6, 601)
    distance = np.abs(np.searchsorted(a, grid) / len(a) - np.searchsorted(b, grid) / len(b)).max()
    tail, plateau = tail_exponent(a), plateau_ratio(a)
    return ClaimVerdict(
        "P(f_n): 0 to 5 means, exponential tail, plateau of weak forces",
        f"greatest {a[-1]:.1f} means (99.9 %: {np.quantile(a, 0.999):.1f}); tail exponent {tail.value:.2f} "
        f"(true {tail_exponent(b).value:.2f}); plateau {plateau.value:.2f} (true {plateau_ratio(b).value:.2f}); "
        f"distance to the true distribution {distance:.3f}",
        "yes, but wrong forces have the same distribution",
    )
