"""A cause is named only where its rival clearly wins."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.inference.diagnosis import diagnose as module
from rodsight.inference.diagnosis import distortion
from rodsight.inference.diagnosis.causes import CAUSES, finding, name_once, uncorrected
from rodsight.inference.diagnosis.diagnose import diagnose
from rodsight.inference.diagnosis.rivals import rivals_of
from rodsight.inference.diagnosis.trial import Trial
from rodsight.inference.inputs import Inputs
from rodsight.solver.bodies.rods import RodMaterial

from ...study.test_predictions import SOUND, WRONG
from .test_direct_tests import box, rolling_tracks

ROOT = Path(__file__).parents[4]
INPUTS = Inputs(rolling_tracks(), box(), RodMaterial())
INPUTS = replace(INPUTS, tracks=replace(INPUTS.tracks, rotation=np.full_like(INPUTS.tracks.rotation, np.nan)))


@pytest.fixture
def scores(monkeypatch):
    """Scores of rivals by their cause over that of the given input, instead of solving them.

    Of errors of one sense; of the other sense under the name "other sense".
    """
    rises: dict[str, float] = {}
    given = Trial((WRONG,), 1).score
    by_input = {}

    def rivals(inputs):
        for each in rivals_of(inputs):
            changed = each.change(inputs)
            by_input[id(changed)] = (changed, each.cause if each.size > 0.0 else "other sense")
            yield replace(each, change=lambda _, changed=changed: changed)

    monkeypatch.setattr(module, "rivals_of", rivals)
    monkeypatch.setattr(module, "_mean_gap", lambda inputs: np.nan)  # gaps exclude none
    monkeypatch.setattr(module, "trial_score", lambda inputs, _: given + rises.get(by_input[id(inputs)][1], 0.0))
    return rises


def causes(trial=WRONG):
    return [each.cause for each in diagnose(INPUTS, Trial((trial,), 1))]


def test_the_clear_winner_is_named_with_effect_and_cure(scores, monkeypatch):
    scores["all_radii"] = 0.8
    monkeypatch.setattr(module, "_mean_gap", lambda inputs: 0.02)
    (found,) = diagnose(INPUTS, Trial((WRONG,), 1))
    assert found.cause == "all_radii"
    assert found.effect == CAUSES["all_radii"].effect
    assert "Cure: measure the radii anew" in found.sentence()


def test_poses_that_a_tracker_repeats_are_named_and_are_no_jumps():
    position = INPUTS.tracks.position.copy()
    position[4:6, 33] = position[3, 33]
    (found,) = diagnose(replace(INPUTS, tracks=replace(INPUTS.tracks, position=position)), None)
    assert found.cause == "outlier_tracks"
    assert "repeat the one before digit by digit" in found.evidence
    assert found.corrected


def test_an_error_that_fits_as_well_in_the_other_sense_is_not_named(scores):
    scores["all_radii"] = 0.8
    assert causes() == ["all_radii"]
    scores["other sense"] = 0.65
    assert causes() == ["not_explained"]


@pytest.mark.thorough
@pytest.mark.parametrize("gap", [0.005, *(pytest.param(each, marks=pytest.mark.slow) for each in (0.0, -0.005))])
def test_wrong_radii_that_the_gaps_of_hard_rods_exclude_are_not_named(scores, monkeypatch, gap):
    scores["all_radii"] = 0.8
    monkeypatch.setattr(module, "_mean_gap", lambda inputs: gap)
    assert causes() == ["not_explained"]
    assert causes(replace(WRONG, information=replace(WRONG.information, soft=True))) == ["all_radii"]
    monkeypatch.setattr(module, "_mean_gap", lambda inputs: np.nan)
    assert causes() == ["all_radii"]


def test_the_mean_gap_of_touching_rods_is_over_a_diameter():
    inputs = replace(INPUTS, tracks=replace(INPUTS.tracks, radius=0.99 * INPUTS.tracks.radius))
    change = module._mean_gap(inputs) - module._mean_gap(INPUTS)
    assert change == pytest.approx(0.01, rel=0.2)


@pytest.mark.thorough
def test_a_stretching_that_the_gaps_of_rods_exclude_is_not_named(scores):
    """A wall that lags fits better in a stretched picture, too; the overlaps of soft grains hide a stretching."""
    scores["stretched_picture"] = 0.8
    assert causes() == ["not_explained"]
    assert causes(replace(WRONG, information=replace(WRONG.information, soft=True))) == ["stretched_picture"]
    as_given = replace(INPUTS, settings=replace(INPUTS.settings, boundary=None))
    for inputs, undisturbed, named in (
        (as_given, False, "stretched_picture"),
        (as_given, True, "not_explained"),  # a run has looked for it
    ):
        (found,) = diagnose(inputs, Trial((WRONG,), 1), undisturbed=undisturbed)
        assert found.cause == named


def test_a_stretching_is_sought_in_gaps_without_walls_too():
    walls = replace(INPUTS.walls, name=(), endpoints=INPUTS.walls.endpoints[:, :0], pressure=INPUTS.walls.pressure[:0])
    cropped = replace(INPUTS, walls=walls, tracks=replace(INPUTS.tracks, radius=INPUTS.tracks.radius.copy()))
    assert distortion.seeks_distortion(cropped, walls, ())
    periodic = replace(walls, cell=np.ones((INPUTS.tracks.frame_count, 2, 2)))
    assert not distortion.seeks_distortion(cropped, periodic, ())
    soft = replace(cropped, material=replace(cropped.material, stiffness=1e5))  # overlaps hide a stretching
    assert not distortion.seeks_distortion(soft, walls, ())
    assert distortion.undistorted(cropped, walls, ())[2] == []
    wide = replace(cropped.tracks, position=cropped.tracks.position * [1.02, 1.0])
    (found,) = distortion.undistorted(replace(cropped, tracks=wide), walls, ())[2]
    assert found.cause == "stretched_picture"


@pytest.mark.parametrize(("stiffness", "corrected"), [(None, True), ("rigid", True), (1e5, False)])
def test_of_the_stretching_of_soft_grains_a_run_removes_a_part_only(monkeypatch, stiffness, corrected):
    found = SimpleNamespace(
        applied=True, value=np.ones(8), radial_change=lambda: False, describe=lambda: ("a stretching was removed",)
    )
    monkeypatch.setattr(distortion, "correct_camera", lambda _, tracks, walls, *__, **___: (tracks, walls, "", found))
    inputs = replace(INPUTS, material=replace(INPUTS.material, stiffness=stiffness))
    (named,) = distortion.undistorted(inputs, inputs.walls, ())[2]
    assert named == finding("stretched_picture", "a stretching was removed", corrected=corrected)


@pytest.mark.thorough
@pytest.mark.parametrize("rises", [
    {"all_radii": 0.5, "stretched_picture": 0.45},
    *(pytest.param(each, marks=pytest.mark.slow) for each in ({"all_radii": 0.15}, {})),
])  # fmt: skip
def test_without_a_clear_winner_nothing_is_blamed(scores, rises):
    scores.update(rises)
    assert causes() == ["not_explained"]
    assert causes(SOUND) == []


def test_data_that_show_little_contradict_nothing(scores):
    still = replace(
        SOUND, loaded=False, agreement=0.5, overlap_agreement=0.5, disagreement=0.9, position_agreement=0.7, interior=25
    )
    hidden = replace(still, information=replace(still.information, noise=5e-5, diameter=0.02, undetermined=0.4))
    trial = Trial((hidden,), 1)
    assert trial.expected[0] < module.UNEXPLAINED
    assert trial.worst.little_known
    assert causes(hidden) == []


def test_noise_that_hides_overlaps_contradicts_nothing():
    apart = replace(SOUND, loaded=False, agreement=0.9, disagreement=0.3, position_agreement=0.5, interior=150)
    for noise, explains in ((5e-6, False), (8e-5, True)):
        information = replace(apart.information, noise=noise, diameter=0.02, undetermined=0.2)
        worst = Trial((replace(apart, information=information),), 1).worst
        assert worst.words.startswith("forces from the positions and from the balance of overlaps agree by 0.50 only")
        assert worst.little_known == explains
        assert worst.words.endswith("noise hides the overlaps") != explains


@pytest.mark.thorough
def test_confused_names_are_named_and_hide_nothing_else():
    tracks = INPUTS.tracks
    row = np.tile(np.arange(tracks.grain_count), (tracks.frame_count, 1))
    row[1:, [3, 4]] = [4, 3]
    confused = replace(INPUTS, tracks=tracks.rearranged(row))
    assert [each.cause for each in diagnose(confused, None)] == ["exchanged_ids"]
    lost = np.arange(tracks.grain_count) % 4 == 2
    poor = replace(
        tracks,
        position=np.where(lost[:, None] & (np.arange(tracks.frame_count) > 0)[:, None, None], np.nan, tracks.position),
    )
    found = diagnose(replace(INPUTS, tracks=poor.rearranged(row)), None)
    assert [each.cause for each in found] == ["exchanged_ids", "missing_poses"]


@pytest.mark.parametrize(("ratio", "named"), [([1.0, 1.1], []), ([1.0, 1.5], ["wall_forces"]), ([np.nan] * 2, [])])
@pytest.mark.parametrize("expected", [0.98, 0.5])
def test_sensors_are_named_where_forces_are_expected_to_be_right(monkeypatch, ratio, named, expected):
    monkeypatch.setattr(module, "diagnose", lambda *_, **__: [])
    monkeypatch.setattr(module, "solve_trial", lambda *_, **__: None)
    results = SimpleNamespace(
        friction_check=None, frames=[SimpleNamespace(expected_correlation=expected)] * 6,
        walls=SimpleNamespace(name=("top", "left")), wall_force_ratio=lambda: np.array(ratio),
    )  # fmt: skip
    found = module.diagnose_solved(INPUTS, results)
    assert [each.cause for each in found] == (named if expected > 0.9 else [])
    assert all("top 1.00, left 1.50" in each.evidence for each in found)


def test_every_rival_has_a_documented_cause_and_changes_the_input():
    rivals = list(rivals_of(INPUTS))
    assert {each.cause for each in rivals} <= set(CAUSES)
    for rival in rivals:
        changed = rival.change(INPUTS)
        same = (
            np.array_equal(changed.tracks.position, INPUTS.tracks.position)
            and np.array_equal(changed.tracks.radius, INPUTS.tracks.radius)
            and np.array_equal(changed.walls.endpoints, INPUTS.walls.endpoints)
            and changed.material == INPUTS.material
        )
        assert not same


def test_the_documentation_lists_every_cause():
    page = (ROOT / "app/docs/trust.md").read_text(encoding="utf-8")
    for name, cause in CAUSES.items():
        assert f"| `{name}` | {cause.effect} | {cause.cure} |" in page


def test_a_cause_that_two_tests_find_is_named_once_with_the_evidence_of_both():
    found = name_once([finding("lens", "a"), finding("friction", "b"), finding("lens", "c")])
    assert [(each.cause, each.evidence) for each in found] == [("lens", "a; c"), ("friction", "b")]
    assert [each.corrected for each in found] == [True, False]
    (left,) = name_once([finding("lens", "a"), finding("lens", "c", corrected=False)])
    assert not left.corrected


def test_forces_suffer_from_causes_that_neither_a_run_corrects_nor_single_frames_show():
    causes = ("lens", "friction", "not_explained", "smoothed_tracks", "inertia", "rotation_sign")
    found = [finding(each, "") for each in causes]
    assert [each.cause for each in uncorrected(found)] == ["friction", "inertia"]
    assert uncorrected([finding("friction", "", corrected=True), finding("lens", "", corrected=False)]) == [
        finding("lens", "", corrected=False)
    ]


def test_sliding_that_only_an_impossible_friction_explains_is_examined(monkeypatch):
    """Photographs in reverse order look like a friction beyond all trials, at which nothing is left of the gap."""
    examined: list[bool] = []
    monkeypatch.setattr(module, "diagnose", lambda *_, sliding, **__: examined.append(sliding) or [])
    for gap in ([0.05, 0.06, 0.07], [0.9, 0.8, 0.07]):
        check = SimpleNamespace(agrees=True, given_gap=float(np.interp(1.0, [0.8, 1.0, 5.0], gap)))
        frames = [SimpleNamespace(expected_correlation=0.97)] * 8
        results = SimpleNamespace(friction_check=check, frames=frames, wall_force_ratio=lambda: np.empty(0))
        module.diagnose_solved(None, results)  # type: ignore[arg-type]
    assert examined == [False, True]


@pytest.mark.parametrize(("expected", "compared"), [
    ([0.6, 0.95, 0.98, 0.98, 0.98, 0.98, 0.98, 0.98], None),  # no motion leads to the first one
    ([0.6, 0.97, 0.98, 0.98, 0.98, 0.8, 0.75, 0.8], 2),
    ([0.6, 0.9], 0),
])  # fmt: skip
def test_rivals_are_compared_where_photographs_after_the_first_are_doubtful(
    monkeypatch: pytest.MonkeyPatch, expected: list[float], compared: int | None
) -> None:
    begun: list[int] = []
    monkeypatch.setattr(module, "solve_trial", lambda *_, first: begun.append(first))
    monkeypatch.setattr(module, "diagnose", lambda *_, **__: [])
    frames = [SimpleNamespace(expected_correlation=each) for each in expected]
    results = SimpleNamespace(friction_check=None, frames=frames, wall_force_ratio=lambda: np.empty(0))
    module.diagnose_solved(None, results)  # type: ignore[arg-type]
    assert begun == ([] if compared is None else [compared])


def test_what_resists_the_sliding_is_sought_in_the_first_photographs_too(monkeypatch):
    sought = []

    def examine(inputs, first):
        sought.append(first)
        return [finding("friction", "")] if first == 0 else []

    monkeypatch.setattr(module, "_examine_sliding", examine)
    (found,) = diagnose(INPUTS, None, first=4)
    assert found.cause == "friction"
    assert sought == [4, 0]
    diagnose(INPUTS, None)
    assert sought == [4, 0, 0]


@pytest.mark.parametrize("undisturbed", [False, True])
def test_what_a_run_has_sought_in_vain_is_not_sought_again(monkeypatch, undisturbed):
    sought = []

    def none_found(tracks, walls):
        sought.append("poses")
        return np.zeros(tracks.status.shape, bool)

    def as_given(material, tracks, walls, failed, *, radii_known):
        sought.append("camera")
        return tracks, walls, "", None

    monkeypatch.setattr(module, "find_impossible_poses", none_found)
    monkeypatch.setattr(distortion, "correct_camera", as_given)
    assert diagnose(INPUTS, None, sliding=False, undisturbed=undisturbed) == []
    assert sought == ([] if undisturbed else ["camera", "poses"])
