"""Factors change the named input, and designs cover the requested ranges."""

import re
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from rodsight.cli.commands.sensitivity import sensitivity
from rodsight.experiment.experiment import load_experiment
from rodsight.process.errors import InputError
from rodsight.robustness.design import Case, choose_factors, one_at_a_time, plan, space_filling, vary
from rodsight.robustness.factors import FACTORS, ValueKind
from rodsight.robustness.networks import VariedInputs

FILE = Path("experiment.toml")
KNOWN = {each.name: each for each in FACTORS}


def choose(*wanted: str, ranges: dict[str, tuple[float, float]] | None = None, chain: bool = False):
    return choose_factors(wanted, ranges or {}, file=FILE, single_chain=chain)


def varied(inputs: VariedInputs, name: str, value: float) -> VariedInputs:
    return vary(inputs, Case(((name, value),)))


def test_the_help_names_every_factor_and_its_range():
    text = " ".join(str(sensitivity.__doc__).split())
    groups: dict[str, str] = {}
    for names, span in re.findall(r"((?:[\w ,]+?)) \(([^)]*)\)", text.partition("Factors and their ranges: ")[2]):
        groups |= dict.fromkeys(re.findall(r"\w+", names), span)
    for factor in FACTORS:
        span = groups[factor.name]
        unit = 100.0 if factor.kind is ValueKind.RELATIVE_ERROR else 1.0
        numbers = {"second": 2.0, "rearrangements": 1.0, "one": 2.0}  # whole numbers written as words
        found = {numbers.get(word) or float(word) for word in re.findall(r"[\d.]+|second|rearrangements|one", span)}
        assert found == {unit * abs(factor.low), unit * abs(factor.high)}, factor.name


@pytest.mark.thorough
def test_nominal_values_leave_the_inputs_unchanged(nominal):
    assert vary(nominal.inputs, Case(())) is nominal.inputs
    for factor in FACTORS:
        assert varied(nominal.inputs, factor.name, factor.nominal) is nominal.inputs


def test_friction_of_grains_does_not_change_friction_at_walls(nominal):
    material = nominal.inputs.material
    lower = varied(nominal.inputs, "friction", 0.8).material
    assert lower.friction == 0.8 * material.friction
    assert lower.wall_friction == material.wall_friction
    walls = varied(nominal.inputs, "wall_friction", 0.8).material
    assert walls.friction == material.friction
    assert walls.wall_friction == 0.8 * lower.wall_friction


@pytest.mark.parametrize(
    ("name", "key"), [("kappa", "chain.kappa"), ("sweeps", "chain.sweeps"), ("threshold", "threshold_sigmas")]
)
def test_settings_are_multiplied(name, key, nominal):
    value = attrgetter(key)
    before = value(nominal.inputs.settings.sequence)
    assert value(varied(nominal.inputs, name, 2.0).settings.sequence) == 2 * before


def test_twice_the_noise_is_the_same_noise_doubled(nominal):
    def shift(value: float):
        return varied(nominal.inputs, "position_noise", value).tracks.position - nominal.inputs.tracks.position

    assert np.allclose(shift(2.0), 2.0 * shift(1.0), rtol=1e-6, atol=1e-15)
    assert shift(1.0).std() == pytest.approx(1e-5, rel=0.1)  # 400 draws at the stated 10 µm


def test_errors_of_radii_and_scale_have_the_stated_size(nominal):
    tracks = nominal.inputs.tracks
    common = varied(nominal.inputs, "radius_error", 1e-3).tracks.radius / tracks.radius
    assert np.allclose(common, 1.001)
    scattered = varied(nominal.inputs, "radius_scatter", 1e-3).tracks.radius / tracks.radius - 1.0
    assert scattered.std() == pytest.approx(1e-3, rel=0.3)  # 40 draws
    wide = varied(nominal.inputs, "pixel_size", 1e-3).tracks.position
    assert np.allclose(wide[1] - wide[0], 1.001 * (tracks.position[1] - tracks.position[0]))
    assert np.allclose(wide.mean(axis=(0, 1)), tracks.position.mean(axis=(0, 1)))


def test_omitted_photographs_are_omitted_from_all_inputs(nominal):
    settings = nominal.inputs.settings
    sequence = replace(settings.sequence, reset_frames=frozenset({2, 3}))
    inputs = replace(nominal.inputs, settings=replace(settings, sequence=sequence))
    every_other = varied(inputs, "spacing", 2)
    assert every_other.frames.tolist() == [0, 2, 4]
    assert every_other.tracks.time.tolist() == inputs.tracks.time[::2].tolist()
    assert len(every_other.walls.endpoints) == len(every_other.noise) == 3
    assert every_other.settings.sequence.reset_frames == {1}
    later = varied(inputs, "first_frame", 3)
    assert later.frames.tolist() == [3, 4]
    assert later.settings.sequence.reset_frames == {0}


def test_one_at_a_time_gives_every_level_once():
    cases = one_at_a_time(choose(), seed=3)
    assert all(len(case.values) == 1 and case.seed == 3 for case in cases)
    assert len({case.key for case in cases}) == len(cases)
    assert [v for c in cases for n, v in c.values if n == "friction"] == [0.8, 1.2]
    assert [v for c in cases for n, v in c.values if n == "spacing"] == [2.0]


def test_the_threshold_belongs_to_the_single_chain():
    assert "threshold" not in {each.name for each in choose()}
    assert "threshold" in {each.name for each in choose(chain=True)}
    with pytest.raises(InputError, match="no effect on the ensemble"):
        choose("threshold")


def test_a_space_filling_design_fills_the_ranges():
    factors = choose()
    cases = space_filling(factors, 64, seed=0)
    assert len(cases) == 64
    for factor in factors:
        place = np.array([factor.to_unit(dict(case.values)[factor.name]) for case in cases])
        assert place.min() >= 0.0
        assert place.max() <= 1.0
        halves = np.histogram(place, [0.0, 0.5, 1.0 + 1e-9])[0]
        if factor.kind is not ValueKind.COUNT:
            assert halves.tolist() == [32, 32]  # Sobol points halve every axis
    again = space_filling(factors, 64, seed=0)
    assert [case.key for case in again] == [case.key for case in cases]


def test_ranges_come_from_the_experiment_and_the_command_line():
    by_file = choose(ranges={"friction": (0.5, 2.0)})
    assert (by_file[0].low, by_file[0].high) == (0.5, 2.0)
    both = choose("kappa", "friction=0.9:1.1", ranges={"friction": (0.5, 2.0)})
    assert [each.name for each in both] == ["friction", "kappa"]
    assert (both[0].low, both[0].high) == (0.9, 1.1)


@pytest.mark.parametrize(
    ("wanted", "named"),
    [
        ("viscosity", "is not a factor"),
        ("friction=0.8", "NAME=LOW:HIGH"),
        ("friction=a:b", "NAME=LOW:HIGH"),
        ("friction=1.2:0.8", "ascending"),
        ("friction=-1:1", "must be positive"),
        ("friction=1:nan", "finite"),
        ("friction=1:1", "would not vary"),
        ("position_noise=-1:2", "negative"),
        ("pixel_size=0:0.5", "relative error"),
        ("spacing=2:2.5", "whole numbers"),
        ("spacing=0:2", "whole numbers from 1"),
        ("reset=1:3", "whole numbers from 0 to 2"),
    ],
)
def test_an_invalid_range_is_refused(wanted, named):
    with pytest.raises(InputError, match=named) as refused:
        choose(wanted)
    assert wanted in str(refused.value)


def test_an_unknown_factor_of_the_experiment_file_is_refused():
    with pytest.raises(InputError, match=r"experiment.toml: key sensitivity.ranges.viscosity"):
        choose(ranges={"viscosity": (1.0, 2.0)})


def test_samples_must_suffice_and_belong_to_a_design(made_tracks):
    experiment = load_experiment(made_tracks)
    with pytest.raises(InputError, match="at least 6"):
        plan(experiment, "sobol", ("kappa", "friction"), 5, 0)
    assert len(plan(experiment, "sobol", ("kappa", "friction"), 6, 0)[1]) == 6
    with pytest.raises(InputError, match="requires --design sobol"):
        plan(experiment, "oat", (), 5, 0)
