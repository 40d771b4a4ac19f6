"""Options that would have no effect are refused by name."""

from __future__ import annotations

import inspect

import pytest
from rodsight.cli.arguments import refuse_unused
from rodsight.cli.commands.study import study
from rodsight.cli.studies.study_request import APPLIES_TO
from rodsight.process.errors import InputError

from tests.program import rodsight


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "EXPERIMENT", "--idle", "5"), "run: --idle: does not apply without --follow"),
        (("review", "EXPERIMENT", "--complete"), "review: --complete: does not apply without --import-csv"),
        (
            ("review", "EXPERIMENT", "--import-csv", "a.csv", "--export-csv", "b.csv"),
            "review: --export-csv: does not apply with --import-csv",
        ),
        (("share", "--repair", "broken.rrd", "--scale", "0.5"), "share: --scale: does not apply with --repair"),
        (("share", "--repair", "broken.rrd", "--html"), "share: --html: does not apply with --repair"),
        (
            ("sensitivity", "EXPERIMENT", "--budget", "--factors", "friction"),
            "sensitivity: --factors: does not apply with --budget",
        ),
        (
            ("export", "pictures", "EXPERIMENT", "--figure", "rose", "--tab", "Forces"),
            "export: --tab: does not apply with --figure",
        ),
        (
            ("study", "real", "EXPERIMENT", "--seeds", "1"),
            "study: --seeds with real: applies to simulated packings only",
        ),
        (
            ("study", "real", "EXPERIMENT", "--set", "solver.kappa=0.1"),
            "study: --set with real: applies to worlds, trust",
        ),
        (("study", "worlds", "EXPERIMENT"), "study: PATH with worlds: applies to real, perturbation and paper only"),
        (("study", "budget", "--jobs", "2"), "study: --jobs with budget: applies to worlds and trust only"),
        (("study", "worlds", "--fit", "0"), "study: --fit with worlds: applies to trust, numbers and intervals only"),
        (("study", "numbers", "--json"), "study: --json with numbers: applies to worlds, report and real only"),
        (("study", "status", "--estimator", "nlgs"), "study: --estimator with status: applies to accuracy, uncert"),
        (("study", "accuracy", "--ensemble", "8"), "study: --ensemble with accuracy: applies to uncertainty and"),
        (("study", "trust", "--page", "a.html"), "study: --page with trust: applies to report and real only"),
        (("study", "report", "--frame", "0"), "study: --frame with report: applies to real only"),
        (("study", "fringes", "--worlds", "shear"), "study: --worlds with fringes: applies to worlds, trust"),
        (("study", "perturbation", "--varied", "1"), "study: --varied with perturbation: applies to worlds, trust"),
        (("study", "accuracy", "--program", "authors"), "study: --program with accuracy: applies to paper only"),
        (("study", "paper", "EXPERIMENT"), "study: PATH with paper: applies with --program only"),
        (("study", "paper", "--set", "solver.kappa=0.1"), "study: --set with paper: applies with --program only"),
        (("study", "trust", "--varied", "9"), "--varied: 9: is neither one of --seeds nor of --fit"),
    ],
)
def test_an_option_without_effect_is_refused(arguments, words, made_tracks, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert rodsight(*(made_tracks if each == "EXPERIMENT" else each for each in arguments)) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("options", [("--seeds", "1"), ("--grains", "50"), ("--worlds", "shear"), ("--out", "kept")])
def test_options_of_simulated_packings_are_refused_with_an_experiment(options, made_tracks, capsys):
    assert rodsight("study", "perturbation", made_tracks, *options) == 2
    assert f"study: {options[0]} with {made_tracks}: applies to simulated packings only" in capsys.readouterr().err


def test_every_option_of_a_study_has_the_subjects_to_which_it_applies():
    names = {"folder": "PATH", "scenarios": "--worlds", "settings": "--set", "as_json": "--json"}
    options = [each for each in inspect.signature(study).parameters if each not in ("subject", "quiet")]
    assert {names.get(each, f"--{each}") for each in options} == set(APPLIES_TO)


def test_a_zero_counts_as_given():
    with pytest.raises(InputError, match=r"^run: --idle: does not apply without --follow$"):
        refuse_unused("run", {"--idle": 0}, "without --follow")
