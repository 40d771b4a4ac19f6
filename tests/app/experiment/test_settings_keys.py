"""Every key of experiment.toml has a description and one default, and is refused by name where it has no effect."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rodsight.cli.main import main
from rodsight.experiment.config.experiment_file import ExperimentFile, as_toml, load_config
from rodsight.experiment.config.keys import find_key, list_keys, list_sections, nearest_key
from rodsight.experiment.config.settings_page import FIRST_LINE, settings_page
from rodsight.experiment.config.unused_keys import refuse_unused_keys, unused_keys
from rodsight.inference.inference_settings import InferenceSettings, material_of, settings_of
from rodsight.process.errors import InputError
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.tracking.detection.detect import DetectionSettings
from rodsight.tracking.settings import TrackingSettings

DOCS = Path(__file__).parents[3] / "app" / "docs"
FILE = Path("experiment.toml")
TRACKS = {"positions": "tracks.csv", "grains": "grains.csv", "times": "times.csv"}


def experiment(**sections: Any) -> ExperimentFile:
    return ExperimentFile.model_validate({"name": "test", "tracks": TRACKS, **sections})


def rodsight(*arguments: object) -> int:
    with pytest.raises(SystemExit) as stop:
        main([str(each) for each in arguments])
    return int(stop.value.code or 0)


@pytest.mark.parametrize("key", list_keys(ExperimentFile), ids=lambda key: key.name)
def test_every_key_has_a_description(key):
    assert len(key.meaning) > 15
    assert key.meaning.endswith(".")
    assert key.kind
    assert key.summary in key.meaning or key.unit


def test_every_section_has_a_description():
    assert all(section.meaning for section in list_sections(ExperimentFile))


def test_no_settings_give_the_defaults_of_a_library_call():
    assert settings_of(experiment()) == InferenceSettings()
    assert material_of(experiment()) == RodMaterial()


def test_the_tracker_and_its_section_have_the_same_defaults():
    section = experiment().tracking
    assert section.search_window == TrackingSettings().search_window
    assert section.radius_range == DetectionSettings().radius_range


def test_the_settings_page_is_up_to_date():
    page = (DOCS / "settings.md").read_text(encoding="utf-8")
    assert page.splitlines()[0] == FIRST_LINE
    assert page == settings_page(), FIRST_LINE


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("solver.kapa", "solver.kappa"),
        ("kapa", "solver.kappa"),
        ("materiel", "material"),
        ("contacts.kappa", "solver.kappa"),
        ("walls.upper left.presure", "walls.upper left.pressure"),
        ("wholly.unlike", None),
        ("material.mu", None),  # not its own section
    ],
)
def test_a_key_that_is_not_known_has_a_nearest_one(wrong, meant):
    assert nearest_key(ExperimentFile, wrong) == meant


def test_a_file_of_results_is_no_experiment(tmp_path):
    (tmp_path / "results.h5").write_bytes(b"\x89HDF\r\n")
    with pytest.raises(InputError, match=r"results\.h5: is no text: name the folder of an experiment"):
        load_config(tmp_path / "results.h5")


def test_keys_are_found_for_a_wall_and_an_index_of_a_list():
    assert find_key(ExperimentFile, "walls.top.pressure") == find_key(ExperimentFile, "walls.NAME.pressure")
    assert find_key(ExperimentFile, "solver.reset_frames.0") == find_key(ExperimentFile, "solver.reset_frames")
    assert find_key(ExperimentFile, "solver.kapa") is None


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("solver.kapa=1", "key solver.kapa: is not known (value 1): did you mean solver.kappa?"),
        ("material.mu=0.2", "key material.mu: is not known (value 0.2): there are density, length, friction, "),
        ("solver.kappa=-1", "(Kinematic number: weight of the measured motion relative to the contact forces)"),
        ("material.gravity=[0.0]", "Gravity in the plane"),
        (
            'walls.top.pressure="much"',
            "(Pressure that loads this wall between its neighbours, where rods can touch it; absent: its measured "
            "velocity is imposed [Pa])",
        ),
    ],
)
def test_an_error_quotes_the_description_of_the_key(setting, expected, tracked, capsys):
    assert rodsight("check", tracked, "--set", setting) == 2
    message = capsys.readouterr().err
    assert expected in message
    assert message.count("\n") == 1


UNUSED = {
    "contacts.threshold": ({"contacts": {"threshold": 1e-5}}, "ensemble"),
    "contacts.threshold_sigmas": ({"contacts": {"threshold_sigmas": 6.0}}, "ensemble"),  # equal to the default
    "solver.keep_members": ({"solver": {"estimator": "nlgs", "keep_members": True}}, "nlgs"),
    "solver.kept_frames": ({"solver": {"kept_frames": [3]}}, "reset"),
    "solver.kappa": ({"solver": {"preset": "paper", "kappa": 0.1}}, "paper"),
    "solver.substeps": ({"solver": {"preset": "paper", "substeps": 2}}, "paper"),
    "solver.spin_up": ({"solver": {"preset": "paper", "spin_up": 2}}, "paper"),
    "solver.precision": ({"solver": {"preset": "paper", "precision": "measured"}}, "paper"),
    "solver.reset": ({"solver": {"preset": "paper", "reset": "never"}}, "paper"),
    "solver.estimator": ({"solver": {"preset": "paper", "estimator": "ensemble"}}, "paper"),
}


@pytest.mark.parametrize("name", UNUSED)
def test_a_key_without_effect_is_refused_by_name(name):
    sections, why = UNUSED[name]
    with pytest.raises(InputError, match=rf"key {name} = ") as raised:
        refuse_unused_keys(experiment(**sections), FILE)
    assert why in str(raised.value)


def test_one_threshold_replaces_the_other():
    both = {"threshold": 1e-5, "threshold_sigmas": 5.0}
    with pytest.raises(InputError, match=r"beside contacts\.threshold"):
        refuse_unused_keys(experiment(contacts=both, solver={"estimator": "nlgs"}), FILE)


@pytest.mark.parametrize("name", UNUSED)
def test_a_key_without_effect_changes_no_setting(name):
    sections, _ = UNUSED[name]
    section, key = name.split(".")
    without = {each: {k: v for k, v in keys.items() if (each, k) != (section, key)} for each, keys in sections.items()}
    given, default = settings_of(experiment(**sections)), settings_of(experiment(**without))
    if name == "solver.substeps":  # the preset computes its number of sweeps from them
        return
    if name.startswith("solver.ke") or name.startswith("contacts"):  # stored, but not used
        assert given.sequence.chain == default.sequence.chain
        return
    assert given == default


@pytest.mark.parametrize("solver", [{}, {"estimator": "nlgs"}, {"preset": "paper"}, {"reset": "rearrangement"}])
def test_defaults_are_always_accepted(solver):
    refuse_unused_keys(experiment(solver=solver), FILE)


@pytest.mark.parametrize(
    "solver",
    [
        {"preset": "paper", "estimator": "nlgs", "reset": "rearrangement", "precision": "stated", "sweeps": 5},
        {"reset": "rearrangement", "kept_frames": [1]},
        {"keep_members": True, "relaxation": 1.2, "force_change": 1e-3},
    ],
)
def test_keys_that_are_used_are_accepted(solver):
    refuse_unused_keys(experiment(solver=solver), FILE)


def test_the_command_refuses_them_before_anything_is_computed(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    for command in ("check", "run"):
        arguments = ("--out", out, "--quiet") if command == "run" else ("--quiet",)
        assert rodsight(command, tracked, *arguments, "--set", "contacts.threshold_sigmas=5") == 2
        message = capsys.readouterr().err
        assert "key contacts.threshold_sigmas = 5.0: has no effect on the ensemble" in message
        assert message.count("\n") == 1
    assert not out.exists()


NAMES = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1, max_size=12)
NUMBERS = st.floats(1e-12, 1e12)


@given(
    text=NAMES, walls=st.dictionaries(NAMES, st.none() | st.floats(1e-3, 1e11), max_size=4),
    ranges=st.dictionaries(NAMES, st.tuples(NUMBERS, NUMBERS), max_size=2), friction=st.floats(1e-12, 2.0),
)  # fmt: skip
def test_the_resolved_configuration_reads_back_to_the_same(text, walls, ranges, friction):
    plates = {name: {} if pressure is None else {"pressure": pressure} for name, pressure in walls.items()}
    config = experiment(
        walls={"file": text, "plates": plates},
        sensitivity={"ranges": ranges},
        material={"friction": friction},
        truth=text,
    )
    assert ExperimentFile.model_validate(tomllib.loads(as_toml(config))) == config


@pytest.mark.parametrize("wall", ["top", "upper left", "links.oben", "öffnung", 'with "quotes"', "file", "plates", ""])
@pytest.mark.parametrize("estimator", ["ensemble", "nlgs"])
def test_odd_names_of_walls_read_back(wall, estimator):
    config = experiment(walls={"file": "w.csv", "plates": {wall: {"pressure": 5e4}}}, solver={"estimator": estimator})
    assert ExperimentFile.model_validate(tomllib.loads(as_toml(config))) == config


def test_walls_are_written_in_the_form_of_an_experiment_file():
    config = experiment(walls={"file": "w.csv", "plates": {"top": {"pressure": 5e4}}})
    assert "[walls.top]\npressure = 50000.0" in as_toml(config)


def test_the_resolved_configuration_is_a_valid_experiment_file(tmp_path):
    for solver in ({}, {"estimator": "nlgs"}, {"preset": "paper"}):
        file = tmp_path / "experiment.toml"
        file.write_text(as_toml(experiment(solver=solver)), encoding="utf-8")
        config = load_config(file)
        refuse_unused_keys(config, file)
        assert settings_of(config) == settings_of(experiment(solver=solver))


def test_keys_without_effect_are_known_for_every_estimator():
    assert set(unused_keys(experiment())) == {"contacts.threshold", "contacts.threshold_sigmas", "solver.kept_frames"}
    assert set(unused_keys(experiment(solver={"estimator": "nlgs"}))) == {
        "solver.keep_members", "solver.positions", "solver.kept_frames"
    }  # fmt: skip


def test_the_command_lists_settings_and_explains_one(capsys):
    assert rodsight("settings", "solver") == 0
    assert "Kinematic number" in capsys.readouterr().out
    assert rodsight("settings", "walls.top.pressure") == 0
    assert "number ≥ 0.001, ≤ 1e+11 [Pa], absent by default" in capsys.readouterr().out
    assert rodsight("settings") == 0
    output = capsys.readouterr().out
    assert all(key.name.rpartition(".")[2] in output for key in list_keys(ExperimentFile))
    assert rodsight("settings", "--markdown") == 0
    assert capsys.readouterr().out == settings_page()
    assert rodsight("settings", "solver.kapa") == 2
    assert "did you mean solver.kappa?" in capsys.readouterr().err
