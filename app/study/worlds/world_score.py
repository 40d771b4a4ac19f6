"""One world: its experiment folder made, solved as a run would, and everything stated compared with the truth."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, recall
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.agreement import Agreement, compare_forces

from ...errors import InputError
from ...experiment.boundary import bound_tracks
from ...experiment.experiment import Experiment, load_experiment, read_tracks
from ...experiment.walls import read_walls
from ...inference.inference import CorrectedSequence, Inputs, SolvedFrame, correct_sequence, solve_all
from ...inference.settings import material_of, settings_of
from ...progress import Progress, silent
from ...results.truth import names_of_told, read_truth, true_ids
from ...synthetic.worlds.making import make_world
from ...synthetic.worlds.names import WorldName
from ...synthetic.worlds.table import WORLDS
from ...tracks import Tracks, WallTracks
from ..baselines import baseline_lists, compare_baselines

SETTLED = 3  # the frame from which on r counts as that of a sequence under way
ABOVE = 0.03  # by which a trust may exceed r before it counts as too high
WEAK = 1e-3  # of the mean force: contacts below it, inferred and true, have no error worth a bar
FITTED = frozenset({0, 1, 3})  # seeds on which constants may be fitted; all others judge


@dataclass(frozen=True, slots=True)
class WorldScore:
    """What came out of one world and seed; numbers are None where they do not exist. Plain values, for JSON."""

    world: WorldName
    seed: int
    refused: str  # why the program did not take it; empty: it did
    r: tuple[float | None, ...] = ()  # (f,) correlation of f_n
    scale: float | None = None  # Σ f_n / Σ f_n,true from SETTLED on; None where nothing tells the size of forces
    trust: tuple[float | None, ...] = ()  # (f,)
    status: tuple[str, ...] = ()  # (f,)
    coverage: tuple[float | None, float | None] = (None, None)  # of f_n by one and by two standard deviations
    r_ours: float | None = None  # on all near pairs, mean from SETTLED on, as the next three
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
        """Frames whose trust exceeds r by more than ABOVE, and frames, among the suspect ones or among the others."""
        pairs = [
            (r, trust)
            for r, trust, status in zip(self.r, self.trust, self.status, strict=True)
            if (status == "suspect") == suspect and r is not None and trust is not None
        ]
        return sum(trust > r + ABOVE for r, trust in pairs), len(pairs)

    @property
    def status_count(self) -> dict[str, int]:
        return dict(Counter(self.status))


@dataclass(frozen=True, slots=True)
class WorldPlan:
    """What all worlds of a study share."""

    grains: int
    folder: Path  # of truths that were simulated, and of finished scores
    settings: tuple[str, ...] = ()  # KEY=VALUE laid over every experiment


def score_world(plan: WorldPlan, world: WorldName, seed: int, progress: Progress = silent) -> WorldScore:
    """Make a world, solve it and compare. Raises UnbalancedError where it cannot be simulated."""
    with TemporaryDirectory() as folder:
        made = make_world(Path(folder), world, seed, grains=plan.grains, kept=plan.folder / "kept", progress=progress)
        began = time.process_time()
        try:
            experiment = load_experiment(made.folder, plan.settings)
            sequence, solved = solve_world(experiment, progress)
            frames = sequence.check_friction([each.forces for each in solved])[0]
        except InputError as error:
            return WorldScore(world, seed, str(error).replace(f"{made.folder}{os.sep}", ""))
        cpu = (time.process_time() - began) / len(frames)
        true = true_forces(experiment, sequence)
    return _compare(world, seed, sequence, frames, true, cpu)


def solve_world(experiment: Experiment, progress: Progress) -> tuple[CorrectedSequence, list[SolvedFrame]]:
    """Solve an experiment as a run would, its sweeps not kept. Raises InputError."""
    sequence = correct_world(experiment)
    return sequence, solve_all(sequence, lambda done: progress("solving", done, sequence.tracks.frame_count))


def correct_world(experiment: Experiment) -> CorrectedSequence:
    """Read and correct an experiment as a run would, its sweeps not kept. Raises InputError."""
    tracks, walls = read_world(experiment)
    assert walls is not None
    config = experiment.config
    return correct_sequence(Inputs(tracks, walls, material_of(config), settings_of(config).without_sweeps()))


def read_world(experiment: Experiment) -> tuple[Tracks, WallTracks | None]:
    """What an experiment tells of rods, boundary and walls. Raises InputError."""
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    return bound_tracks(experiment, tracks, walls), walls


def true_forces(experiment: Experiment, sequence: CorrectedSequence) -> tuple[tuple[Keys, Array], ...]:
    """Keys (t,) and forces (t, 2) [N] of every frame; contacts of rods that nobody has are passed over."""
    config, folder, tracks = experiment.config, experiment.folder, sequence.tracks
    assert config.truth is not None
    assert config.truth_tracks is not None
    poses = folder / config.truth_tracks
    count = tracks.frame_count
    truth = read_truth(
        folder / config.truth, names_of_told(poses, tracks, 0), sequence.walls.name, first_frame=0, frame_count=count,
        unseen=true_ids(poses),
    )  # fmt: skip
    return truth.outside(tracks.boundary).by_frame(tracks.grain_count + len(sequence.walls.name), count)


def _compare(
    world: WorldName,
    seed: int,
    sequence: CorrectedSequence,
    frames: Sequence[FrameForces],
    true: Sequence[tuple[Keys, Array]],
    cpu: float,
) -> WorldScore:
    sized = WORLDS[world].scale_known
    agreement = [
        compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *true[k])
        for k, frame in enumerate(frames)
    ]
    baselines = baseline_lists(compare_baselines(sequence.packing, sequence.snapshots, frames, true))
    return WorldScore(
        world, seed, "",
        r=tuple(_plain(each.r_fn) for each in agreement),
        scale=_mean([_plain(each.scale) for each in agreement[SETTLED:]]) if sized else None,
        trust=tuple(_plain(frame.trust) for frame in frames),
        status=tuple(FrameStatus(frame.status).name.lower() for frame in frames),
        coverage=_coverage(frames[SETTLED:], true[SETTLED:], agreement[SETTLED:], sized=sized),
        **{name: _mean(values[SETTLED:]) for name, values in baselines.items()},
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
    """Share of true f_n within one and two standard deviations; where no size is known, truth is brought to ours."""
    ratio = []
    for frame, (true_key, true_force), each in zip(frames, true, agreement, strict=True):
        bearing = frame.fn > 0
        if not bearing.any():
            continue
        exact = recall(frame.contacts.key, true_key, true_force[:, 0]) * (1.0 if sized else each.scale)
        told = np.maximum(frame.fn, exact) > WEAK * frame.fn[bearing].mean()
        ratio.append(np.abs(frame.fn - exact)[told] / frame.fn_sd[told])
    if not ratio:
        return None, None
    all_ratios = np.concatenate(ratio)
    return float(np.mean(all_ratios <= 1.0)), float(np.mean(all_ratios <= 2.0))


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
