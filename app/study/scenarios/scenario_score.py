"""Scores of scenarios: forces, trust, status and intervals of a solved scenario compared with the truth."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ...experiment.boundary import apply_boundary
from ...experiment.experiment import Experiment, load_experiment, read_tracks
from ...experiment.walls import read_walls
from ...inference.corrected_sequence import CorrectedSequence
from ...inference.correction.correct_sequence import correct_sequence
from ...inference.frame_store import MemoryStore
from ...inference.infer_sequence import infer_sequence
from ...inference.inference_settings import material_of, settings_of
from ...inference.inputs import Inputs
from ...inference.solve_frames import InferenceObserver
from ...process.counts import known_or_none, mean_of_known
from ...process.errors import InputError
from ...process.progress import Progress, no_progress
from ...results.results import Results
from ...results.truth import names_of_given, read_truth, true_ids
from ...solver.assessment.evidence import Evidence
from ...solver.assessment.expected_correlation import MEASURES, closed_overlap, rests_on_overlaps
from ...solver.assessment.intervals.scale_sd import scale_terms
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys, match_values
from ...solver.dem.dem_truth import UnbalancedError
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.statistics.agreement import Agreement, compare_forces
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_folder import MadeScenario, make_scenario, make_varied_scenario
from ...synthetic.scenarios.scenario_table import SCENARIOS
from ...tracks import Tracks, WallTracks
from ..baselines import baseline_lists, compare_baselines
from ..truths import NEGLIGIBLE

SETTLED = 3  # first frame of the averages
TRUST_TOLERANCE = 0.03  # excess of trust over r above which it is too high
FITTED = frozenset({0, 1, 3})  # seeds for fitting; all others are for judging


@dataclass(frozen=True, slots=True)
class ScenarioScore:
    """The score of one scenario and seed in plain values for JSON; numbers are None where they do not exist."""

    scenario: ScenarioName
    seed: int
    refused: str  # reason why the program refused the input; empty: accepted
    r: tuple[float | None, ...] = ()  # (f,) correlation of f_n
    scale: float | None = None  # Σ f_n / Σ f_n,true from SETTLED on; None without a scale of forces
    trust: tuple[float | None, ...] = ()  # (f,)
    expected: tuple[float | None, ...] = ()  # (f,) expected correlation
    measures: tuple[tuple[float | None, ...], ...] = ()  # (f, m) of the evidence, see `expected_correlation.MEASURES`
    closed_overlap: tuple[float | None, ...] = ()  # (f,) over the mean diameter
    scales: tuple[float | None, ...] = ()  # (f,) Σ f_n / Σ f_n,true; empty without a scale of forces
    scale_terms: tuple[tuple[float | None, ...], ...] = ()  # (f, t) of its standard deviation, see `scale_sd.TERMS`
    scale_sd: tuple[float | None, ...] = ()  # (f,) as stated
    status: tuple[str, ...] = ()  # (f,)
    overlaps: tuple[bool, ...] = ()  # (f,) whether the forces follow from the overlaps of soft grains
    loaded: bool = True  # see `Packing.is_loaded`
    coverage: tuple[float | None, float | None] = (None, None)  # of f_n by one and by two standard deviations
    r_ours: float | None = None  # on all candidate pairs, mean from SETTLED on, as the next three
    r_static: float | None = None
    r_overlap: float | None = None
    r_uniform: float | None = None
    r_overlap_first: float | None = None  # of frame 0
    cpu: float | None = None  # [s] a frame, correction included

    @property
    def r_late(self) -> float | None:
        return _mean(self.r[SETTLED:])

    @property
    def trust_mean(self) -> float | None:
        return _mean(self.trust)

    def too_trusting(self, *, suspect: bool) -> tuple[int, int]:
        """Count frames with trust above r by more than TRUST_TOLERANCE, and all frames, of suspect or other frames."""
        pairs = [
            (r, trust)
            for r, trust, status in zip(self.r, self.trust, self.status, strict=True)
            if (status == "suspect") == suspect and r is not None and trust is not None
        ]
        return sum(trust > r + TRUST_TOLERANCE for r, trust in pairs), len(pairs)

    @property
    def status_count(self) -> dict[str, int]:
        return dict(Counter(self.status))


@dataclass(frozen=True, slots=True)
class StudyPlan:
    """Inputs common to all scenarios of a study."""

    grains: int
    folder: Path  # of simulated truths and finished scores
    settings: tuple[str, ...] = ()  # KEY=VALUE laid over every experiment
    varied: frozenset[int] = frozenset()  # seeds with which the parameters of a scenario are drawn at random


def make_planned(
    plan: StudyPlan, folder: Path, scenario: ScenarioName, seed: int, progress: Progress = no_progress
) -> MadeScenario:
    """Write a scenario of a plan as an experiment folder. Raises UnbalancedError."""
    make = make_varied_scenario if seed in plan.varied else make_scenario
    return make(folder, scenario, seed, grains=plan.grains, cache=plan.folder / "kept", progress=progress)


def score_scenario(
    plan: StudyPlan, scenario: ScenarioName, seed: int, progress: Progress = no_progress
) -> ScenarioScore:
    """Make a scenario, solve it and compare it with the truth; one that does not rest counts as refused."""
    with TemporaryDirectory() as folder:
        try:
            made = make_planned(plan, Path(folder), scenario, seed, progress)
        except UnbalancedError as error:
            return ScenarioScore(scenario, seed, str(error))
        began = time.process_time()
        try:
            experiment = load_experiment(made.folder, plan.settings)
            solution = solve_scenario(experiment, progress)
        except InputError as error:
            return ScenarioScore(scenario, seed, str(error).replace(f"{made.folder}{os.sep}", ""))
        frames = list(solution.results.frames)
        cpu = (time.process_time() - began) / len(frames)
        true = true_forces(experiment, solution.sequence)
    return replace(
        _compare(scenario, seed, solution.sequence, frames, true, cpu),
        closed_overlap=tuple(_plain(closed_overlap(each)) for each in solution.evidence),
        scale_terms=tuple(tuple(_plain(term) for term in scale_terms(each)) for each in solution.evidence),
        overlaps=tuple(rests_on_overlaps(each) for each in solution.evidence),
        loaded=solution.sequence.packing.is_loaded,
        measures=tuple(tuple(_plain(measure(each)) for measure in MEASURES.values()) for each in solution.evidence),
    )


@dataclass(frozen=True, slots=True)
class ScenarioSolution:
    """A solved scenario: the corrected sequence, its results, and its frames before the friction check."""

    sequence: CorrectedSequence
    results: Results
    unchecked: list[FrameForces]
    evidence: list[Evidence]  # of every frame as it was solved in the sequence


class _KeepSequence(InferenceObserver):
    sequence: CorrectedSequence

    def corrected(self, sequence: CorrectedSequence) -> None:
        self.sequence = sequence


def solve_scenario(experiment: Experiment, progress: Progress) -> ScenarioSolution:
    """Solve an experiment with the settings of a run, without keeping sweeps. Raises InputError."""
    observer, store = _KeepSequence(progress), MemoryStore()
    results = infer_sequence(_inputs(experiment), observer, store)
    results = replace(results, frames=list(results.frames), statistics=list(results.statistics))
    unchecked = [*results.frames[:1], *(each.forces for each in store.frames[1:])]
    evidence = [each.state.evidence for each in store.frames]
    return ScenarioSolution(observer.sequence, results, unchecked, evidence)


def correct_scenario(experiment: Experiment) -> CorrectedSequence:
    """Read and correct an experiment with the settings of a run, without keeping sweeps. Raises InputError."""
    return correct_sequence(_inputs(experiment))


def _inputs(experiment: Experiment) -> Inputs:
    tracks, walls = read_scenario(experiment)
    assert walls is not None
    config = experiment.config
    return Inputs(tracks, walls, material_of(config), settings_of(config).without_sweeps())


def read_scenario(experiment: Experiment) -> tuple[Tracks, WallTracks | None]:
    """Read the tracks, boundary and walls of an experiment, which sensors do not judge. Raises InputError."""
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    tracks = apply_boundary(experiment, tracks, walls)
    return tracks, None if walls is None else replace(walls, force=None)


def true_forces(experiment: Experiment, sequence: CorrectedSequence) -> tuple[tuple[Keys, Array], ...]:
    """Return keys (t,) and forces (t, 2) [N] of every frame, without contacts of rods that are not in the tracks."""
    config, folder, tracks = experiment.config, experiment.folder, sequence.tracks
    assert config.truth is not None
    assert config.truth_tracks is not None
    poses = folder / config.truth_tracks
    count = tracks.frame_count
    truth = read_truth(
        folder / config.truth, names_of_given(poses, tracks, 0), sequence.walls.name, frame_count=count,
        unseen=true_ids(poses),
    )  # fmt: skip
    return truth.outside(tracks.boundary).by_frame(tracks.grain_count + len(sequence.walls.name), count)


def _compare(
    scenario: ScenarioName,
    seed: int,
    sequence: CorrectedSequence,
    frames: Sequence[FrameForces],
    true: Sequence[tuple[Keys, Array]],
    cpu: float,
) -> ScenarioScore:
    sized = SCENARIOS[scenario].scale_known
    agreement = [
        compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true[k])
        for k, frame in enumerate(frames)
    ]
    baselines = baseline_lists(compare_baselines(sequence.packing, sequence.snapshots, frames, true))
    return ScenarioScore(
        scenario, seed, "",
        r=tuple(_plain(each.r_fn) for each in agreement),
        scale=_mean([_plain(each.scale) for each in agreement[SETTLED:]]) if sized else None,
        scales=tuple(_plain(each.scale) for each in agreement) if sized else (),
        trust=tuple(_plain(frame.trust) for frame in frames),
        expected=tuple(_plain(frame.expected_correlation) for frame in frames),
        scale_sd=tuple(_plain(frame.scale_sd) for frame in frames),
        status=tuple(FrameStatus(frame.status).name.lower() for frame in frames),
        coverage=_coverage(frames[SETTLED:], true[SETTLED:], agreement[SETTLED:], sized=sized),
        r_ours=_mean(baselines["r_ours"][SETTLED:]),
        r_static=_mean(baselines["r_static"][SETTLED:]),
        r_overlap=_mean(baselines["r_overlap"][SETTLED:]),
        r_uniform=_mean(baselines["r_uniform"][SETTLED:]),
        r_overlap_first=baselines["r_overlap"][0],
        cpu=cpu,
    )  # fmt: skip


def _coverage(
    frames: Sequence[FrameForces],
    true: Sequence[tuple[Keys, Array]],
    agreement: Sequence[Agreement],
    *,
    sized: bool,
) -> tuple[float | None, float | None]:
    """Return the fractions of true f_n within 1 and 2 standard deviations; without a scale, in the inferred scale."""
    ratio = []
    for frame, (true_key, true_force), each in zip(frames, true, agreement, strict=True):
        bearing = frame.fn > 0
        if not bearing.any():
            continue
        exact = match_values(frame.contacts.key, true_key, true_force[:, 0]) * (1.0 if sized else each.scale)
        compared = np.maximum(frame.fn, exact) > NEGLIGIBLE * frame.fn[bearing].mean()
        ratio.append(np.abs(frame.fn - exact)[compared] / frame.fn_sd[compared])
    if not ratio:
        return None, None
    all_ratios = np.concatenate(ratio)
    return float(np.mean(all_ratios <= 1.0)), float(np.mean(all_ratios <= 2.0))


def _mean(values: Sequence[float | None]) -> float | None:
    return known_or_none(mean_of_known(values))


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
