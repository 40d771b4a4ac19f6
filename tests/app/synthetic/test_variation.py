"""Varied scenarios keep their meaning, and differ from seed to seed."""

from __future__ import annotations

from typing import get_args

import numba
import numpy as np
import pytest
from rodsight.synthetic.dense_packing import choose_radii
from rodsight.synthetic.scenarios.preset_names import ScenarioName
from rodsight.synthetic.scenarios.scenario_folder import LEAST_GRAINS, make_scenario, make_varied_scenario
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS
from rodsight.synthetic.scenarios.variation import (
    AS_STIFF,
    FRICTIONS,
    GREATEST_NOISE,
    NOISE,
    RODS,
    SHEARED,
    SOFT,
    STATED_FRICTION,
    STEPS,
    STIFFER,
    STIFFEST,
    WALL_FRICTIONS,
    vary_scenario,
)

SEEDS = range(20)


def test_a_seed_draws_the_same_parameters_again_and_another_one_others():
    assert vary_scenario("sheared", 5) == vary_scenario("sheared", 5)
    drawn = [vary_scenario("sheared", seed)[0] for seed in SEEDS]
    for of in (
        lambda each: each.loading.step,
        lambda each: each.loading.settings.normal_stiffness,
        lambda each: each.loading.settings.friction,
        lambda each: each.loading.initial_shear,
        lambda each: each.noise,
    ):
        assert len({of(each) for each in drawn}) == len(SEEDS)
    assert len({each.loading.sizes for each in drawn}) == 3
    assert {each.loading.loose for each in drawn} == {False, True}


@pytest.mark.parametrize("name", get_args(ScenarioName))
def test_parameters_are_within_their_ranges_and_the_kind_keeps_its_meaning(name: ScenarioName):
    kind = SCENARIOS[name]
    given = kind.loading
    for seed in SEEDS:
        found, rods = vary_scenario(name, seed)
        loading, settings = found.loading, found.loading.settings
        assert (found.departure, found.group, found.meaning) == (kind.departure, kind.group, kind.meaning)
        assert RODS[0] <= rods <= RODS[1]
        assert STEPS[0] * given.step <= loading.step <= STEPS[1] * given.step
        assert (loading.initial_shear > 0.0) == (given.initial_shear > 0.0)
        assert loading.initial_shear == 0.0 or SHEARED[0] <= loading.initial_shear <= SHEARED[1]
        assert NOISE[0] * kind.noise <= found.noise <= max(GREATEST_NOISE, kind.noise)
        soft = given.settings.normal_stiffness < SOFT
        low, high = AS_STIFF if soft else STIFFER
        stiffer = settings.normal_stiffness / given.settings.normal_stiffness
        assert low <= stiffer <= high
        assert settings.normal_stiffness <= STIFFEST
        if name in STATED_FRICTION:
            assert (settings.friction, settings.wall_friction) == (
                given.settings.friction,
                given.settings.wall_friction,
            )
        else:
            assert FRICTIONS[0] <= settings.friction <= FRICTIONS[1]
            walls = given.settings.wall_friction
            least, most = WALL_FRICTIONS if walls == given.settings.friction else (walls, walls)
            assert least <= settings.wall_friction <= most
        if given.sizes is not choose_radii or kind.group == "wrong input":
            assert loading.sizes is given.sizes
        if given.ring or given.bed or given.periodic or given.open_top:
            assert loading.loose == given.loose


@pytest.mark.thorough
@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
def test_a_varied_folder_has_the_drawn_number_of_rods_and_friction(tmp_path):
    made = make_varied_scenario(tmp_path / "varied", "shear", 4, grains=LEAST_GRAINS)
    drawn, factor = vary_scenario("shear", 4)
    assert len(made.truth.radius) == max(round(factor * LEAST_GRAINS), LEAST_GRAINS)
    assert made.scenario == drawn
    assert f"{drawn.loading.settings.friction}"[:6] in (tmp_path / "varied/experiment.toml").read_text()
    plain = make_scenario(tmp_path / "plain", "shear", 4, grains=LEAST_GRAINS)
    assert not np.isclose(plain.truth.settings.friction, drawn.loading.settings.friction)
