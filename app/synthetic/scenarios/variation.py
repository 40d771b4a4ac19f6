"""Scenarios whose parameters are drawn at random: a fit reads more than one value of each.

A kind of input keeps its meaning. Its step, stiffness, friction, sizes, noise, preparation and number of rods differ
from seed to seed.
"""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np

from ...solver.dem.dem_truth import DemSettings
from ..dense_packing import choose_radii, choose_two_radii, choose_wide_radii
from .preset_names import ScenarioName
from .scenario import Scenario
from .scenario_table import SCENARIOS

VARIED = 3  # second word of a seed, beside those of `scenario_folder`
STEPS = 0.4, 2.5  # factors of the step …
STIFFER = 0.5, 10.0  # … of the stiffness of contacts whose overlaps do not matter …
AS_STIFF = 0.6, 1.7  # … and of those whose overlaps are forces, or whose weight is their load
NOISE, GREATEST_NOISE = (0.3, 4.0), 6e-5  # factors of the noise, and its limit [m] unless the scenario has more
FRICTIONS, WALL_FRICTIONS = (0.15, 0.5), (0.05, 0.5)
SHEARED = 0.5, 4.0  # initial shear [°] of packings that are sheared before the first photograph
RODS = 0.6, 1.4  # factors of the number of rods
STIFFEST, SOFT = 1e9, 1e7  # [N/m]
SAME_AT_WALLS, LOOSE, OTHER_SIZES = 0.6, 0.25, 0.5  # probabilities
# They state a coefficient that is right or wrong by a given amount.
STATED_FRICTION = frozenset({"mu_low", "mu_high", "mu_01", "mu_05", "outer_mu_05", "unloaded_mu_01"})


def vary_scenario(name: ScenarioName, seed: int) -> tuple[Scenario, float]:
    """Draw the parameters of a scenario.

    Parameters
    ----------
    name : ScenarioName
    seed : int
        The same arguments draw the same parameters.

    Returns
    -------
    Scenario
    float
        Factor of the number of rods.
    """
    rng = np.random.default_rng([seed, VARIED, zlib.crc32(name.encode())])
    scenario = SCENARIOS[name]
    loading = scenario.loading
    settings = _vary_material(loading.settings, rng, friction=name not in STATED_FRICTION)
    plain = not (loading.ring or loading.bed or loading.periodic or loading.open_top)
    loading = replace(
        loading,
        step=loading.step * _draw(rng, STEPS),
        settings=settings,
        initial_shear=rng.uniform(*SHEARED) if loading.initial_shear > 0.0 else 0.0,
        loose=loading.loose or bool(plain and rng.random() < LOOSE),
    )
    if loading.sizes is choose_radii and scenario.group != "wrong input" and rng.random() < OTHER_SIZES:
        loading = replace(loading, sizes=(choose_two_radii, choose_wide_radii)[rng.integers(2)])
    noise = min(scenario.noise * _draw(rng, NOISE), max(scenario.noise, GREATEST_NOISE))
    return replace(scenario, loading=loading, noise=noise), _draw(rng, RODS)


def _vary_material(settings: DemSettings, rng: np.random.Generator, *, friction: bool) -> DemSettings:
    """Draw stiffness and, if requested, friction; smooth walls stay smooth."""
    loaded_by_weight = any(settings.gravity)
    factors = AS_STIFF if loaded_by_weight or settings.normal_stiffness < SOFT else STIFFER
    stiffness = min(settings.normal_stiffness * _draw(rng, factors), max(settings.normal_stiffness, STIFFEST))
    of_rods, of_walls = rng.uniform(*FRICTIONS), rng.uniform(*WALL_FRICTIONS)
    same = rng.random() < SAME_AT_WALLS
    found = replace(settings, normal_stiffness=stiffness)
    if not friction:
        return found
    if settings.wall_friction != settings.friction:
        return replace(found, friction=of_rods)
    return replace(found, friction=of_rods, wall_friction=of_rods if same else of_walls)


def _draw(rng: np.random.Generator, between: tuple[float, float]) -> float:
    """Draw a number whose logarithm is uniform."""
    low, high = np.log(between)
    return float(np.exp(rng.uniform(low, high)))
