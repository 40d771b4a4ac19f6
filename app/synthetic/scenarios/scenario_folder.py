"""Experiment folders of scenarios, written from truths that are simulated once and cached."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from ...process.atomic import replacing
from ...process.errors import InputError
from ...process.progress import Progress, no_progress
from ...solver.dem import (
    boundaries,
    box_cell,
    contact_law,
    elliptic_section,
    membrane_cell,
    periodic_cell,
    ring_cell,
    shear_cell,
    simulation,
    time_step,
)
from ...solver.dem.dem_truth import DemSettings, DemTruth
from .. import dense_packing, ring_packing
from ..experiment_files import refuse_full_folder
from . import bed_paths, loading_paths, periodic_packing
from .bed_paths import simulate_bed
from .loading_paths import LoadingPath, simulate_loading
from .observed_data import observe_truth, write_observed
from .preset_names import ScenarioName
from .scenario import Scenario
from .scenario_table import SCENARIOS
from .variation import vary_scenario

LEAST_GRAINS = 40  # with fewer, some scenarios have no grain to omit or to roll on
GRAINS = 450  # rods of a scenario: enough for statistics, and simulated within seconds
OBSERVED, DEPARTED = 1, 2  # second word of a seed: noise is the same in all scenarios of one truth


@dataclass(frozen=True, slots=True)
class MadeScenario:
    """An experiment folder that was written, its scenario and its truth."""

    folder: Path
    scenario: Scenario
    truth: DemTruth  # in the experiment's world coordinates


def make_scenario(
    out: Path,
    name: ScenarioName,
    seed: int = 0,
    *,
    grains: int | None = None,
    noise: float | None = None,
    cache: Path | None = None,
    progress: Progress = no_progress,
) -> MadeScenario:
    """Write a scenario as an experiment folder of tracks with its truth; the same arguments give the same bytes.

    Parameters
    ----------
    out : Path
        Folder to write; must be absent or empty.
    name : ScenarioName
    seed : int
    grains : int, optional
        Number of rods; default GRAINS.
    noise : float, optional
        Standard deviation of a position component [m]; default: the scenario's.
    cache : Path, optional
        Folder of simulated truths, read and added to.
    progress : Progress

    Returns
    -------
    MadeScenario

    Raises
    ------
    InputError
        If the folder is not empty or an argument is out of range.
    UnbalancedError
        If the simulation does not come to rest; nothing is written then.
    """
    grains = check_output(out, grains)
    _check_choices(seed, noise)
    scenario = SCENARIOS[name] if noise is None else replace(SCENARIOS[name], noise=noise)
    return _write_scenario(out, name, scenario, seed, grains, cache, progress)


def make_varied_scenario(
    out: Path,
    name: ScenarioName,
    seed: int,
    *,
    grains: int,
    cache: Path | None = None,
    progress: Progress = no_progress,
) -> MadeScenario:
    """Write a scenario whose parameters are drawn at random, see `vary_scenario`; otherwise as `make_scenario`."""
    scenario, factor = vary_scenario(name, seed)
    grains = check_output(out, max(round(factor * grains), LEAST_GRAINS))
    return _write_scenario(out, name, scenario, seed, grains, cache, progress)


def _write_scenario(
    out: Path, name: ScenarioName, scenario: Scenario, seed: int, grains: int, cache: Path | None, progress: Progress
) -> MadeScenario:
    truth = load_or_simulate(scenario.loading, grains, seed, cache, progress)
    loading, rng = scenario.loading, np.random.default_rng([seed, OBSERVED])
    measured = observe_truth(truth, loading.plates, scenario.noise, rng, loading.measured)
    observed = scenario.departure(measured, np.random.default_rng([seed, DEPARTED]))
    out.mkdir(parents=True, exist_ok=True)
    remark = f"Scenario {name}, seed {seed}, {grains} rods: {scenario.meaning}."
    write_observed(out, observed, truth, remark)
    return MadeScenario(out, scenario, truth)


def load_or_simulate(
    loading: LoadingPath, grains: int, seed: int, folder: Path | None, progress: Progress = no_progress
) -> DemTruth:
    """Load the truth of a loading path from the folder, or simulate and store it there; None: simulate."""
    simulate = simulate_bed if loading.bed else simulate_loading
    if folder is None:
        return simulate(loading, grains, seed, progress)
    file = folder / f"truth_{_fingerprint(loading)}_{grains}_{seed}.npz"
    if file.exists():
        return load_truth(file, loading.settings)
    truth = simulate(loading, grains, seed, progress)
    save_truth(file, truth)
    return truth


def save_truth(file: Path, truth: DemTruth) -> None:
    """Store a truth as an npz file, without its settings."""
    named = {each.name: getattr(truth, each.name) for each in fields(DemTruth) if each.name != "settings"}
    arrays = {name: value for name, value in named.items() if value is not None}
    with replacing(file) as part, part.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, **arrays)


def load_truth(file: Path, settings: DemSettings) -> DemTruth:
    """Load a stored truth of these settings."""
    with np.load(file) as stored:
        values = {each.name: stored[each.name] for each in fields(DemTruth) if each.name in stored}
    values["wall_names"] = tuple(str(name) for name in values["wall_names"])
    return DemTruth(**values, settings=settings)


def check_output(out: Path, grains: int | None) -> int:
    """Return the number of grains; raise InputError if there are too few, or if the folder is not empty."""
    refuse_full_folder(out)
    grains = GRAINS if grains is None else grains
    if grains < LEAST_GRAINS:
        raise InputError("synth", f"grains = {grains}", f"expected at least {LEAST_GRAINS}")
    return grains


def _check_choices(seed: int, noise: float | None) -> None:
    if seed < 0:
        raise InputError("synth", f"seed = {seed}", "expected 0 or more")
    if noise is not None and not (math.isfinite(noise) and noise >= 0.0):
        raise InputError("synth", f"noise = {noise}", "expected metres, 0 or more")


def _fingerprint(loading: LoadingPath) -> str:
    """Return a name that changes with the loading path and with the code that simulates it."""
    values = replace(loading, motion=None, sizes=None)  # type: ignore[arg-type]
    digest = hashlib.sha256(f"{values} {loading.sizes.__name__}".encode())
    modules = [
        contact_law,
        elliptic_section,
        boundaries,
        time_step,
        simulation,
        shear_cell,
        dense_packing,
        loading_paths,
    ]
    if loading.periodic:
        modules += [periodic_cell, periodic_packing]
    if loading.bed:
        modules += [box_cell, membrane_cell, ring_cell, ring_packing, bed_paths]
    if loading.ring:
        modules += [ring_cell, ring_packing]
    for module in modules:
        digest.update(Path(str(module.__file__)).read_bytes())
    return f"{loading.motion.__name__}_{digest.hexdigest()[:10]}"
