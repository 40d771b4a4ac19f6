"""How far forces move when next to nothing is changed: a photograph more or less, positions by a tenth of their noise.

What is measured well does not hang on a single photograph. Where it does, a contact is at the edge of being seen, and
all forces around it bend with it.
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

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, make_keys, split_keys
from solver.sequence.frame_forces import FrameForces
from solver.statistics.agreement import compare_forces, relative_change

from ...experiment.experiment import load_experiment, read_tracks
from ...experiment.walls import read_walls
from ...inference.inference import Inputs, correct_sequence, solve_all
from ...inference.settings import material_of, settings_of
from ...progress import Progress, silent
from ...synthetic.worlds.making import make_world
from ...synthetic.worlds.names import WorldName
from ...tracks import Tracks, WallTracks
from .world_score import true_forces

R_TOLERANCE = 0.02  # fall of r in any frame
FORCE_TOLERANCE = 0.25  # relative change of the forces of any frame: about the error that they have anyway
SHARE_OF_NOISE = 0.1
ADDED = -1  # a photograph that was not there

Told = TypeVar("Told", Tracks, WallTracks)
TrueForces = Sequence[tuple[Keys, Array]]  # of every frame: keys (t,) and forces (t, 2) [N]


@dataclass(frozen=True, slots=True)
class Perturbation:
    """The same test, a little otherwise."""

    name: str
    tracks: Tracks
    walls: WallTracks
    frame: tuple[int, ...]  # which frame of the unchanged test each one is, or ADDED


@dataclass(frozen=True, slots=True)
class PerturbationEffect:
    """What a perturbation does to the frames that are there with and without it."""

    name: str
    change: float  # largest relative change of the forces of a frame
    change_frame: int
    mean_change: float
    fall: float  # largest fall of r of a frame; NaN without a truth
    fall_frame: int


def study_perturbations(
    inputs: Inputs, true: TrueForces | None, *, seed: int = 0, progress: Progress = silent
) -> list[PerturbationEffect]:
    """Solve a test as it is and under every perturbation; true: on the pairs of its grains and walls."""
    told = inputs.tracks.grain_count
    plain = _solve(inputs, told)
    cases = perturb(inputs.tracks, inputs.walls, np.random.default_rng(seed))
    effects = []
    for done, case in enumerate(cases):
        progress("perturbations", done, len(cases))
        other = _solve(replace(inputs, tracks=case.tracks, walls=case.walls), told)
        effects.append(compare(case, plain, other, true))
    progress("perturbations", len(cases), len(cases))
    return effects


def perturb_world(
    world: WorldName, seed: int, *, grains: int, folder: Path, settings: Sequence[str] = (), progress: Progress = silent
) -> list[PerturbationEffect]:
    """The same of a simulated world; folder: of truths that were simulated."""
    with TemporaryDirectory() as scratch:
        made = make_world(Path(scratch), world, seed, grains=grains, kept=folder / "kept", progress=progress)
        experiment = load_experiment(made.folder, settings)
        tracks = read_tracks(experiment)
        walls = read_walls(experiment, tracks.frame_count)
        assert walls is not None
        inputs = Inputs(tracks, walls, material_of(experiment.config), settings_of(experiment.config).without_sweeps())
        sequence = correct_sequence(inputs)
        bodies = sequence.packing.grains.count + walls.count
        true = true_forces(experiment, sequence)
        told = [on_told_grains(*each, bodies, walls.count, tracks.grain_count) for each in true]
        return study_perturbations(inputs, told, seed=seed, progress=progress)


def perturb(tracks: Tracks, walls: WallTracks, rng: np.random.Generator) -> list[Perturbation]:
    """Every perturbation of a test of at least four photographs."""
    last, middle = tracks.frame_count - 1, tracks.frame_count // 2
    rows = tuple(range(last + 1))
    shift = SHARE_OF_NOISE * tracks.position_sigma[:, None, None] * rng.standard_normal(tracks.position.shape)
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
    """What a perturbation changed; plain, other: keys (c,) and forces (c, 2) [N] of every frame without and with it."""
    common = [(row, k) for row, k in enumerate(case.frame) if k != ADDED]
    change = np.array([relative_change(*plain[k], *other[row]) for row, k in common])
    fall = np.full(len(common), np.nan)
    if true is not None:
        fall = np.array([
            compare_forces(*plain[k], *true[k]).r_fn - compare_forces(*other[row], *true[k]).r_fn for row, k in common
        ])  # fmt: skip
    at = int(np.argmax(change))
    worst = int(np.nanargmax(fall)) if np.isfinite(fall).any() else 0
    return PerturbationEffect(
        case.name, float(change[at]), common[at][1], float(change.mean()), float(fall[worst]), common[worst][1]
    )


def print_perturbations(console: Console, title: str, effects: Sequence[PerturbationEffect]) -> None:
    """Print one row for every perturbation, the tolerances beside."""
    table = Table(title=title, box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for heading in ("perturbation", "forces change by", "in frame", "mean", "r falls by", "in frame", ""):
        table.add_column(heading, justify="left" if heading in ("perturbation", "") else "right", no_wrap=True)
    for each in effects:
        known = np.isfinite(each.fall)
        steady = each.change <= FORCE_TOLERANCE and not each.fall > R_TOLERANCE
        table.add_row(
            each.name, f"{100.0 * each.change:.1f} %", str(each.change_frame), f"{100.0 * each.mean_change:.1f} %",
            f"{each.fall:.4f}" if known else "–", str(each.fall_frame) if known else "–",
            "steady" if steady else "a cliff",
        )  # fmt: skip
    console.print(table)
    console.print(
        f"Largest change of a frame's forces (relative, tolerated {100.0 * FORCE_TOLERANCE:.0f} %) and largest fall of "
        f"its r (tolerated {R_TOLERANCE}), over the frames that both have.", highlight=False, soft_wrap=True,
    )  # fmt: skip


def on_told_grains(key: Keys, force: Array, bodies: int, walls: int, told: int) -> tuple[Keys, Array]:
    """Keys (c,) and forces (c, 2) on pairs of told grains and walls alone, numbered as if there were no others.

    bodies: grains, inferred ones included, and walls.
    """
    i, j = split_keys(key, bodies)
    wall = j - (bodies - walls)
    kept = (i < told) & ((j < told) | (wall >= 0))
    return make_keys(i[kept], np.where(wall >= 0, told + wall, j)[kept], told + walls), force[kept]


def _solve(inputs: Inputs, told: int) -> list[tuple[Keys, Array]]:
    """Keys and forces of every frame, on the grains that were told."""
    sequence = correct_sequence(inputs)
    bodies, walls = sequence.packing.grains.count + inputs.walls.count, inputs.walls.count

    def forces(frame: FrameForces) -> tuple[Keys, Array]:
        return on_told_grains(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), bodies, walls, told)

    return [forces(solved.forces) for solved in solve_all(sequence)]


def _without(tracks: Tracks, walls: WallTracks, gone: int) -> Perturbation:
    rows = np.delete(np.arange(tracks.frame_count), gone)
    return Perturbation(
        "without one in the middle", _rows(tracks, rows), _wall_rows(walls, rows), tuple(int(k) for k in rows)
    )


def _with_one_more(tracks: Tracks, walls: WallTracks, after: int, rng: np.random.Generator) -> Perturbation:
    """One more photograph midway between two, its noise its own."""
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
    told = [*range(after + 1), ADDED, *range(after + 1, tracks.frame_count)]
    return Perturbation("with one more", more, replace(bars, endpoints=midway(bars.endpoints)), tuple(told))


def _rows(tracks: Tracks, rows: NDArray[np.integer]) -> Tracks:
    return _taken(tracks, rows, ("time", "position", "rotation", "sigma", "zncc", "status",
                                                     "second_zncc", "reference_frame"))  # fmt: skip


def _wall_rows(walls: WallTracks, rows: NDArray[np.integer]) -> WallTracks:
    return _taken(walls, rows, ("endpoints", "force", "sigma"))


def _taken(whole: Told, rows: NDArray[np.integer], names: Sequence[str]) -> Told:
    """Rows of every column that has one for each frame."""
    columns = {name: getattr(whole, name) for name in names}
    return replace(whole, **{name: value[rows] for name, value in columns.items() if value is not None})
