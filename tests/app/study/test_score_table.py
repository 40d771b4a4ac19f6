"""The table of scenarios: counts, stored scores, resumption and output."""

from __future__ import annotations

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from rodsight.cli.main import main
from rodsight.solver.dem.dem_truth import UnbalancedError
from rodsight.study.scenarios import scenario_score, score_table
from rodsight.study.scenarios.scenario_score import ScenarioScore, StudyPlan, make_planned, score_scenario
from rodsight.study.scenarios.score_table import as_json, print_scores, score_scenarios
from rodsight.synthetic.scenarios.preset_names import ScenarioName
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS

FEW = 40  # rods

SCORE = ScenarioScore(
    "shear", 2, "", r=(0.6, 0.9, None, 0.8, 0.9), scale=1.01, trust=(None, 0.95, 0.88, 0.82, 0.95),
    status=("reset", "suspect", "failed", "settling", "settled"), coverage=(0.7, 0.94), r_ours=0.86, r_static=0.5,
    r_overlap=0.75, r_uniform=None, r_overlap_first=0.7, cpu=0.25,
)  # fmt: skip
REFUSED = ScenarioScore("nearly_jammed", 0, "tracks.csv: column theta: there is no such column")


def test_means_leave_out_first_frames_and_unknown_values() -> None:
    assert SCORE.r_late == pytest.approx(0.85)
    assert SCORE.trust_mean == pytest.approx((0.95 + 0.88 + 0.82 + 0.95) / 4)
    assert REFUSED.r_late is None
    assert REFUSED.trust_mean is None


def test_trust_that_is_too_high_is_counted_separately_for_suspect_frames() -> None:
    """0.95 for r = 0.9 twice: once in a suspect frame, once in a settled one; 0.82 for 0.8 is within the allowance."""
    assert SCORE.too_trusting(suspect=True) == (1, 1)
    assert SCORE.too_trusting(suspect=False) == (1, 2)


def test_the_table_lists_every_scenario_and_the_reason_of_a_refusal() -> None:
    text = StringIO()
    print_scores(Console(file=text, width=score_table.WIDTH), [SCORE, REFUSED])
    printed = text.getvalue()
    row = next(line for line in printed.splitlines() if line.startswith("shear"))
    assert row.split() == [
        "shear", "2", "0.850", "0.600", "0.900", "–", "1.01", "0.90", "1/2", "1/1", "1", "re", "1", "su", "1", "fa",
        "1", "si", "1", "se", "70", "94", "0.860", "0.500", "0.750", "–", "0.25",
    ]  # fmt: skip
    assert "nearly_jammed 0: tracks.csv: column theta" in printed
    assert "Seeds for fitting: 0; for judging: 2." in printed
    assert all(heading in printed for heading in score_table.HEADINGS)


def test_json_holds_the_same_without_nan() -> None:
    stored = json.loads(json.dumps(as_json([SCORE, REFUSED]), allow_nan=False))
    assert (stored["fitted_on"], stored["judged_on"]) == ([0], [2])
    assert stored["worlds"][0]["r_late"] == pytest.approx(0.85)
    assert stored["worlds"][0]["too_trusting_suspect"] == [1, 1]
    assert stored["worlds"][0]["status_count"] == {"reset": 1, "suspect": 1, "failed": 1, "settling": 1, "settled": 1}
    assert stored["worlds"][1]["refused"].startswith("tracks.csv")


def test_finished_scores_are_reused_until_settings_or_size_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    solved: list[tuple[ScenarioName, int]] = []

    def fake(plan: StudyPlan, scenario: ScenarioName, seed: int) -> ScenarioScore:
        solved.append((scenario, seed))
        return replace(SCORE, scenario=scenario, seed=seed)

    monkeypatch.setattr(score_table, "score_scenario", fake)
    plan = StudyPlan(FEW, tmp_path)
    first = score_scenarios(plan, ["shear", "camera"], [2, 1])
    assert [(score.scenario, score.seed) for score in first] == [
        ("shear", 2),
        ("shear", 1),
        ("camera", 2),
        ("camera", 1),
    ]
    steps: list[tuple[int, int]] = []
    again = score_scenarios(plan, ["shear", "unseen"], [1], progress=lambda _, done, total: steps.append((done, total)))
    assert again[0] == first[1]
    assert solved[4:] == [("unseen", 1)]
    assert steps == [(1, 2), (2, 2)]
    score_scenarios(replace(plan, settings=("solver.kappa=0.2",)), ["shear"], [1])
    score_scenarios(replace(plan, grains=FEW + 1), ["shear"], [1])
    score_scenarios(replace(plan, varied=frozenset({1})), ["shear"], [2, 1])  # seed 2 as before
    assert solved[5:] == [("shear", 1), ("shear", 1), ("shear", 1)]


def test_seeds_that_vary_draw_the_parameters_of_their_scenarios(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made: list[str] = []
    for name in ("make_scenario", "make_varied_scenario"):
        monkeypatch.setattr(scenario_score, name, lambda *_, name=name, **__: made.append(name))
    plan = StudyPlan(FEW, tmp_path, varied=frozenset({3}))
    for seed in (2, 3):
        make_planned(plan, tmp_path, "shear", seed)
    assert made == ["make_scenario", "make_varied_scenario"]


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenarios of five photographs."""
    loading = replace(SCENARIOS["unseen"].loading, frames=5)
    monkeypatch.setitem(SCENARIOS, "unseen", replace(SCENARIOS["unseen"], loading=loading))


@pytest.mark.thorough
@pytest.mark.usefixtures("short")
def test_a_scenario_is_solved_and_compared_with_its_whole_truth(tmp_path: Path) -> None:
    score = score_scenario(StudyPlan(FEW, tmp_path), "unseen", 1)
    assert score.refused == ""
    assert len(score.r) == len(score.trust) == len(score.status) == 5
    assert all(r is not None and -1.0 <= r <= 1.0 for r in score.r)
    assert score.scale is not None
    assert score.coverage[0] is not None
    assert score.coverage[1] is not None
    assert 0.0 < score.coverage[0] <= score.coverage[1] <= 1.0
    assert None not in (score.r_ours, score.r_static, score.r_overlap, score.r_uniform, score.cpu)
    refused = score_scenario(StudyPlan(FEW, tmp_path, ("contacts.nonsense=1",)), "unseen", 1)
    assert "nonsense" in refused.refused
    assert not refused.refused.startswith("/")


def test_scenarios_without_a_loaded_plate_have_no_known_scale() -> None:
    unknown = {name for name, scenario in SCENARIOS.items() if not scenario.scale_known}
    cropped = {name for name in SCENARIOS if name.startswith(("outer", "unloaded"))}
    assert unknown == {"isotropic", "isotropic_centres", "nearly_jammed", "periodic", "unknown_load"} | cropped


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("study", "worlds", "--jobs", "0"), "--jobs: 0"),
        (("study", "paper", "--worlds", "shear"), "--worlds with paper"),
        (("study", "trust", "--seeds", "1", "--varied", "1", "62"), "--varied: 62: is neither"),
        (("study", "paper", "--json"), "--json with paper"),
        (("synth", "OUT", "--preset", "camera"), "--preset camera: makes tracks"),
        (("synth", "OUT", "--preset", "camera", "--no-photographs", "--reversal"), "--reversal with preset camera"),
    ],
    ids=" ".join,
)
def test_options_of_other_subjects_are_refused_by_name(arguments, named, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main([*arguments])
    assert ended.value.code == 2
    assert named in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_json_of_the_requested_scenarios(tmp_path, monkeypatch, capsys) -> None:
    requested = []

    def fake(plan: StudyPlan, scenario: ScenarioName, seed: int) -> ScenarioScore:
        requested.append((plan.grains, plan.settings, scenario, seed))
        return replace(SCORE, scenario=scenario, seed=seed)

    monkeypatch.setattr(score_table, "score_scenario", fake)
    arguments = [
        "study",
        "worlds",
        "--seeds",
        "3",
        "--worlds",
        "soft",
        "--out",
        str(tmp_path),
        "--set",
        "solver.kappa=0.2",
    ]
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--json", "--estimator", "nlgs", "--quiet"])
    assert ended.value.code == 0
    assert requested == [(450, ("solver.kappa=0.2", "solver.estimator=nlgs"), "soft", 3)]
    assert json.loads(capsys.readouterr().out)["worlds"][0]["world"] == "soft"


def test_a_packing_that_does_not_rest_takes_no_other_scenario_with_it(tmp_path, monkeypatch) -> None:
    def restless(*_, **__) -> None:
        raise UnbalancedError("the packing of 40 rods did not come to rest: unbalance 0.14")

    monkeypatch.setattr("rodsight.study.scenarios.scenario_score.make_scenario", restless)
    found = score_scenario(StudyPlan(FEW, tmp_path), "shear", 1)
    assert "did not come to rest" in found.refused
