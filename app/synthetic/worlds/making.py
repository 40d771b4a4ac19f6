"""Making a world: the truth simulated once and kept, the experiment folder written from it."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from solver.dem import kernels, periodic, periodic_kernels, ring, ring_kernels, simulation
from solver.dem.simulation import DemSettings, DemTruth

from ...atomic import replacing
from ...errors import InputError
from ...progress import Progress, silent
from .. import dense_packing, ring_packing
from . import courses, periodic_packing
from .courses import Course, simulate_course
from .names import WorldName
from .table import WORLDS, World
from .told import observe_truth, write_told

LEAST_GRAINS = 40  # with fewer, some worlds have no grain to hide or to roll on
GRAINS = 450  # rods of a world: enough for statistics, and simulated within seconds
OBSERVED, DEPARTED = 1, 2  # second word of a seed: noise is the same in every world of one truth


@dataclass(frozen=True, slots=True)
class MadeWorld:
    """What was written, and what is known about it."""

    folder: Path
    world: World
    truth: DemTruth  # in the experiment's world coordinates


def make_world(
    out: Path,
    name: WorldName,
    seed: int = 0,
    *,
    grains: int | None = None,
    noise: float | None = None,
    kept: Path | None = None,
    progress: Progress = silent,
) -> MadeWorld:
    """Write a world as an experiment folder of tracks with its truth; the same arguments give the same bytes.

    grains: number of rods, GRAINS unless given; noise [m] replaces the world's; kept: folder of truths that were
    simulated before. Raises InputError for a folder that is there and not empty, UnbalancedError when the simulation
    does not come to rest: nothing is written then.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "", "exists already and is not an empty folder")
    grains = GRAINS if grains is None else grains
    _check_choices(seed, grains, noise)
    world = WORLDS[name]
    truth = simulate_kept(world.course, grains, seed, kept, progress)
    careful = observe_truth(
        truth, world.course.plates, world.noise if noise is None else noise, np.random.default_rng([seed, OBSERVED]),
        world.course.measured,
    )  # fmt: skip
    told = world.departure(careful, np.random.default_rng([seed, DEPARTED]))
    out.mkdir(parents=True, exist_ok=True)
    remark = f"World {name}, seed {seed}, {grains} rods: {world.meaning}."
    write_told(out, told, truth, remark)
    return MadeWorld(out, world, truth)


def simulate_kept(course: Course, grains: int, seed: int, folder: Path | None, progress: Progress = silent) -> DemTruth:
    """Simulate a course, or take it from the folder if it was simulated there before."""
    if folder is None:
        return simulate_course(course, grains, seed, progress)
    file = folder / f"truth_{_mark(course)}_{grains}_{seed}.npz"
    if file.exists():
        return load_truth(file, course.settings)
    truth = simulate_course(course, grains, seed, progress)
    save_truth(file, truth)
    return truth


def save_truth(file: Path, truth: DemTruth) -> None:
    """Keep a truth, but for its settings, as an npz file."""
    named = {each.name: getattr(truth, each.name) for each in fields(DemTruth) if each.name != "settings"}
    arrays = {name: value for name, value in named.items() if value is not None}
    with replacing(file) as part, part.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_truth(file: Path, settings: DemSettings) -> DemTruth:
    """Read a truth that was kept, of these settings."""
    with np.load(file) as kept:
        values = {each.name: kept[each.name] for each in fields(DemTruth) if each.name in kept}
    values["wall_names"] = tuple(str(name) for name in values["wall_names"])
    return DemTruth(**values, settings=settings)


def _check_choices(seed: int, grains: int, noise: float | None) -> None:
    if seed < 0:
        raise InputError("synth", f"seed = {seed}", "expected 0 or more")
    if grains < LEAST_GRAINS:
        raise InputError("synth", f"grains = {grains}", f"expected at least {LEAST_GRAINS}")
    if noise is not None and not (math.isfinite(noise) and noise >= 0.0):
        raise InputError("synth", f"noise = {noise}", "expected metres, 0 or more")


def _mark(course: Course) -> str:
    """A name that changes with everything that a course says, and with the code that simulates it."""
    said = replace(course, motion=None, sizes=None)  # type: ignore[arg-type]
    mark = hashlib.sha256(f"{said} {course.sizes.__name__}".encode())
    modules = [kernels, simulation, dense_packing, courses]
    if course.periodic:
        modules += [periodic_kernels, periodic, periodic_packing]
    if course.ring:
        modules += [ring_kernels, ring, ring_packing]
    for module in modules:
        mark.update(Path(str(module.__file__)).read_bytes())
    return f"{course.motion.__name__}_{mark.hexdigest()[:10]}"
