"""Sensitivity of forces to small changes of input: one photograph more or less, positions by a tenth of their noise.

Well determined forces do not depend on a single photograph. A large change shows a contact at the edge of detection,
which changes all forces around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from ...experiment.experiment import load_experiment, read_tracks
from ...experiment.walls import read_walls
from ...inference.correction.correct_sequence import correct_sequence
from ...inference.infer_sequence import infer_sequence
from ...inference.inference_settings import material_of, settings_of
from ...inference.inputs import Inputs
from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys, make_keys, split_keys
from ...solver.frame_forces import FrameForces
from ...solver.statistics.agreement import compare_forces, relative_change
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_folder import make_scenario
from ...tracks import Tracks, WallTracks
from .scenario_score import true_forces

R_TOLERANCE = 0.02  # decrease of r in any frame
FORCE_TOLERANCE = 0.25  # relative change of the forces of any frame, about equal to their error
NOISE_FRACTION = 0.1
ADDED = -1  # index of an added photograph

FrameTable = TypeVar("FrameTable", Tracks, WallTracks)
TrueForces = Sequence[tuple[Keys, Array]]  # of every frame: keys (t,) and forces (t, 2) [N]


@dataclass(frozen=True, slots=True)
class Perturbation:
    """A test with a small change."""

    name: str
    tracks: Tracks
    walls: WallTracks
    frame: tuple[int, ...]  # frame of the unchanged test for each frame, or ADDED


@dataclass(frozen=True, slots=True)
class PerturbationEffect:
    """Effect of a perturbation on the frames that exist with and without it."""

    name: str
    change: float  # largest relative change of the forces of a frame
    change_frame: int
    mean_change: float
    decrease: float  # largest decrease of r of a frame; NaN without a truth
    decrease_frame: int


def study_perturbations(
    inputs: Inputs, true: TrueForces | None, *, seed: int = 0, progress: Progress = no_progress
) -> list[PerturbationEffect]:
    """Solve a test unchanged and with every perturbation; true: forces on the pairs of its grains and walls."""
    count = inputs.tracks.grain_count
    plain = _solve(inputs, count)
    cases = perturb(inputs.tracks, inputs.walls, np.random.default_rng(seed))
    effects = []
    for done, case in enumerate(cases):
        progress("perturbations", done, len(cases))
        other = _solve(replace(inputs, tracks=case.tracks, walls=case.walls), count)
        effects.append(compare(case, plain, other, true))
    progress("perturbations", len(cases), len(cases))
    return effects


def perturb_scenario(
    scenario: ScenarioName,
    seed: int,
    *,
    grains: int,
    folder: Path,
    settings: Sequence[str] = (),
    progress: Progress = no_progress,
) -> list[PerturbationEffect]:
    """Study the perturbations of a simulated scenario; folder: cache of simulated truths."""
    with TemporaryDirectory() as scratch:
        made = make_scenario(Path(scratch), scenario, seed, grains=grains, cache=folder / "kept", progress=progress)
        experiment = load_experiment(made.folder, settings)
        tracks = read_tracks(experiment)
        walls = read_walls(experiment, tracks.frame_count)
        assert walls is not None
        inputs = Inputs(tracks, walls, material_of(experiment.config), settings_of(experiment.config).without_sweeps())
        sequence = correct_sequence(inputs)
        bodies = sequence.packing.grains.count + walls.count
        true = true_forces(experiment, sequence)
        known = [on_given_grains(*each, bodies, walls.count, tracks.grain_count) for each in true]
        return study_perturbations(inputs, known, seed=seed, progress=progress)


def perturb(tracks: Tracks, walls: WallTracks, rng: np.random.Generator) -> list[Perturbation]:
    """Return all perturbations of a test of at least four photographs."""
    last, middle = tracks.frame_count - 1, tracks.frame_count // 2
    rows = tuple(range(last + 1))
    shift = NOISE_FRACTION * tracks.position_sigma[:, None, None] * rng.standard_normal(tracks.position.shape)
    return [
        Perturbation("without the last photograph", tracks.frames(0, last), walls.frames(0, last), rows[:-1]),
        Perturbation("without the first", tracks.frames(1, last + 1), walls.frames(1, last + 1), rows[1:]),
        _without(tracks, walls, middle),
        _with_one_more(tracks, walls, middle, rng),
        Perturbation("moved by a tenth of the noise", replace(tracks, position=tracks.position + shift), walls, rows),
    ]


def compare(
    case: Perturbation, plain: list[tuple[Keys, Array]], other: list[tuple[Keys, Array]], true: TrueForces | None
) -> PerturbationEffect:
    """Compare forces without and with a perturbation; plain, other: keys (c,) and forces (c, 2) [N] of every frame."""
    common = [(row, k) for row, k in enumerate(case.frame) if k != ADDED]
    change = np.array([relative_change(*plain[k], *other[row]) for row, k in common])
    decrease = np.full(len(common), np.nan)
    if true is not None:
        decrease = np.array([
            compare_forces(*plain[k], *true[k]).r_fn - compare_forces(*other[row], *true[k]).r_fn for row, k in common
        ])  # fmt: skip
    at = int(np.argmax(change))
    worst = int(np.nanargmax(decrease)) if np.isfinite(decrease).any() else 0
    return PerturbationEffect(
        case.name, float(change[at]), common[at][1], float(change.mean()), float(decrease[worst]), common[worst][1]
    )


def print_perturbations(console: Console, title: str, effects: Sequence[PerturbationEffect]) -> None:
    """Print one row for every perturbation, with the tolerances below."""
    table = Table(title=title, box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for heading in ("perturbation", "forces change by", "in frame", "mean", "r decreases by", "in frame", ""):
        table.add_column(heading, justify="left" if heading in ("perturbation", "") else "right", no_wrap=True)
    for each in effects:
        known = np.isfinite(each.decrease)
        within = each.change <= FORCE_TOLERANCE and not each.decrease > R_TOLERANCE
        table.add_row(
            each.name, f"{100.0 * each.change:.1f} %", str(each.change_frame), f"{100.0 * each.mean_change:.1f} %",
            f"{each.decrease:.4f}" if known else "–", str(each.decrease_frame) if known else "–",
            "within" if within else "exceeded",
        )  # fmt: skip
    console.print(table)
    console.print(
        f"Largest relative change of a frame's forces (tolerance {100.0 * FORCE_TOLERANCE:.0f} %) and largest decrease "
        f"of its r (tolerance {R_TOLERANCE}), over the common frames.", highlight=False, soft_wrap=True,
    )  # fmt: skip


def on_given_grains(key: Keys, force: Array, bodies: int, walls: int, given: int) -> tuple[Keys, Array]:
    """Select the contacts of given grains and walls and number them without inferred grains.

    Parameters
    ----------
    key, force : ndarray
        (c,) and (c, 2) [N], numbered with inferred grains.
    bodies : int
        Grains, including inferred ones, and walls.
    walls : int
    given : int
        Grains that are not inferred; they come first.
    """
    i, j = split_keys(key, bodies)
    wall = j - (bodies - walls)
    kept = (i < given) & ((j < given) | (wall >= 0))
    return make_keys(i[kept], np.where(wall >= 0, given + wall, j)[kept], given + walls), force[kept]


def _solve(inputs: Inputs, given: int) -> list[tuple[Keys, Array]]:
    """Return keys and forces of every frame on the given grains."""
    results = infer_sequence(inputs, diagnosis=())
    bodies, walls = results.grains.count + inputs.walls.count, inputs.walls.count

    def forces(frame: FrameForces) -> tuple[Keys, Array]:
        return on_given_grains(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), bodies, walls, given)

    return [forces(frame) for frame in results.frames]


def _without(tracks: Tracks, walls: WallTracks, gone: int) -> Perturbation:
    rows = np.delete(np.arange(tracks.frame_count), gone)
    return Perturbation(
        "without one in the middle", _rows(tracks, rows), _wall_rows(walls, rows), tuple(int(k) for k in rows)
    )


def _with_one_more(tracks: Tracks, walls: WallTracks, after: int, rng: np.random.Generator) -> Perturbation:
    """Insert a photograph midway between two, with independent noise."""
    rows = np.insert(np.arange(tracks.frame_count), after + 1, after)
    new, old = after + 1, after + 2
    more, bars = _rows(tracks, rows), _wall_rows(walls, rows)

    def midway(values: Array) -> Array:
        values = values.copy()
        values[new] = 0.5 * (values[after] + values[old])
        return values

    # The mean of two photographs has half the variance of one.
    noise = np.sqrt(0.5) * tracks.position_sigma[after] * rng.standard_normal(more.position.shape[1:])
    position = midway(more.position)
    position[new] += noise
    more = replace(more, time=midway(more.time), position=position, rotation=midway(more.rotation))
    frames = [*range(after + 1), ADDED, *range(after + 1, tracks.frame_count)]
    return Perturbation("with one more", more, replace(bars, endpoints=midway(bars.endpoints)), tuple(frames))


def _rows(tracks: Tracks, rows: NDArray[np.integer]) -> Tracks:
    return _select(tracks, rows, ("time", "position", "rotation", "sigma", "zncc", "status",
                                                     "second_zncc", "reference_frame"))  # fmt: skip


def _wall_rows(walls: WallTracks, rows: NDArray[np.integer]) -> WallTracks:
    return _select(walls, rows, ("endpoints", "force", "sigma"))


def _select(table: FrameTable, rows: NDArray[np.integer], names: Sequence[str]) -> FrameTable:
    """Select rows of the named columns, which have one row per frame."""
    columns = {name: getattr(table, name) for name in names}
    return replace(table, **{name: value[rows] for name, value in columns.items() if value is not None})
