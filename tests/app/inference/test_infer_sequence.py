"""Every caller infers forces by the same function."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.inference import infer_sequence as inference
from rodsight.inference import solve_frames as solving
from rodsight.inference.correction import correct_sequence as correct_module
from rodsight.inference.diagnosis.causes import finding
from rodsight.inference.diagnosis.smoothed_tracks import EXPECTED_OF_SMOOTHED, SMOOTHED, TRUST_OF_SMOOTHED
from rodsight.inference.frame_store import MemoryStore
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.inputs import Inputs
from rodsight.inference.solve_frames import InferenceObserver
from rodsight.results.results import Results
from rodsight.robustness.design import Case
from rodsight.robustness.factors import FIRST_COMPARED
from rodsight.robustness.study import Nominal, measure_case
from rodsight.solver.assessment.expected_correlation import contradict
from rodsight.solver.assessment.penalties import TRUST_OF_FEW, TRUST_WITHOUT_LOAD
from rodsight.solver.bodies.wall_shapes import OUT
from rodsight.solver.contacts.contacts import ContactSource
from rodsight.solver.contacts.pairs import align
from rodsight.solver.frame_forces import FrameForces, FrameStatus
from rodsight.solver.statistics.agreement import pearson
from rodsight.study.scenarios.scenario_score import true_forces
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

from tests.app.inference.diagnosis.test_smoothed_tracks import moving_average
from tests.app.inference.scenarios import SequenceKeeper, read_inputs

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")

FRAMES = 8
UNCHANGED = 0.999  # factor on κ without a measurable effect


@pytest.fixture(scope="module")
def contradicted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Inputs, Results]:
    """Inputs whose friction is specified too low, which the motion contradicts, and their results."""
    folder = make_scenario(tmp_path_factory.mktemp("scenario"), "mu_low", 6, grains=100).folder
    inputs = read_inputs(load_experiment(folder, ()))
    inputs = replace(inputs, tracks=inputs.tracks.frames(0, FRAMES), walls=inputs.walls.frames(0, FRAMES))
    return inputs, infer_sequence(inputs)


@pytest.mark.slow
def test_a_variation_without_effect_has_the_trust_of_the_run(contradicted):
    inputs, results = contradicted
    assert results.friction_check is not None
    assert not results.friction_check.agrees
    nominal = Nominal.of(inputs, results, None)
    effect = measure_case(nominal, Case((("kappa", UNCHANGED),)))
    late = nominal.networks.trust[FIRST_COMPARED:]
    assert effect.r_fn > 0.9999
    assert effect.trust == pytest.approx(float(late.mean()), abs=0.005)


@pytest.mark.slow
def test_the_friction_check_widens_the_intervals_of_every_frame(contradicted):
    inputs, results = contradicted
    unchecked = infer_sequence(inputs, complete=False)
    for before, after in zip(unchecked.frames[1:], results.frames[1:], strict=True):
        assert after.trust == before.trust <= after.expected_correlation  # the frame's own evidence decides
        assert "the motion fits a friction of" in after.trust_penalties
        assert (after.fn_sd >= before.fn_sd).all()


@pytest.mark.thorough
def test_a_named_cause_that_a_run_does_not_correct_lowers_the_trust_of_every_frame(contradicted):
    inputs, plain = contradicted
    found = finding("friction", "rods slide as with a friction of 0.25")
    results = infer_sequence(inputs, diagnosis=[found])
    corrected = infer_sequence(inputs, diagnosis=[replace(found, corrected=True)])
    assert plain.diagnosis == ()  # of fewer than a hundred rods
    assert results.diagnosis == (found,)
    assert corrected.diagnosis[0].corrected
    for k, frame in enumerate(results.frames):
        before = plain.frames[k]
        assert frame.trust == contradict(before.trust) < before.trust
        assert frame.expected_correlation == contradict(before.expected_correlation) < before.expected_correlation
        assert frame.trust_penalties.startswith(f"friction: {found.cure}")
        np.testing.assert_array_equal(frame.fn, before.fn)
        assert corrected.frames[k].trust == before.trust


@pytest.mark.thorough
def test_the_trust_of_a_packing_without_a_load_is_limited(contradicted):
    inputs, plain = contradicted
    results = infer_sequence(inputs, diagnosis=[finding("load_missing", "open at the top")])
    assert max(contradict(each.trust) for each in plain.frames) > TRUST_WITHOUT_LOAD
    assert max(each.trust for each in results.frames) <= TRUST_WITHOUT_LOAD
    assert results.frames[2].trust_penalties.startswith("load missing: give the weight")


@pytest.mark.slow
def test_every_frame_of_smoothed_tracks_is_trusted_less(contradicted):
    inputs, as_measured = contradicted
    assert max(each.trust for each in as_measured.frames) > TRUST_OF_SMOOTHED + 0.2
    tracks = replace(inputs.tracks, position=moving_average(inputs.tracks.position, 5))
    walls = replace(inputs.walls, endpoints=moving_average(inputs.walls.endpoints, 5))
    results = infer_sequence(replace(inputs, tracks=tracks, walls=walls))
    assert all(each.trust <= TRUST_OF_SMOOTHED for each in results.frames)
    assert all(each.expected_correlation <= EXPECTED_OF_SMOOTHED for each in results.frames)
    assert SMOOTHED in results.frames[4].trust_penalties


@pytest.mark.thorough
def test_statistics_have_intervals_in_all_frames_to_which_a_motion_leads(contradicted):
    _, results = contradicted
    assert np.isfinite(results.frames[0].trust)
    assert np.isnan(results.statistics[0].friction_angle_sd)
    assert all(each.friction_angle_sd > 0.0 for each in results.statistics[1:])


@pytest.mark.thorough
def test_every_contact_states_the_coefficient_that_was_used(contradicted):
    inputs, _ = contradicted
    as_stated = replace(inputs.settings, resistance=False)  # the sliding contradicts it
    smooth = replace(inputs, material=replace(inputs.material, wall_friction=0.05), settings=as_stated)
    results = infer_sequence(smooth, complete=False)
    for k, frame in enumerate(results.frames):
        expected = np.where(frame.contacts.with_wall, 0.05, inputs.material.friction)
        np.testing.assert_array_equal(frame.friction, expected)
        np.testing.assert_array_equal(results.contact_friction(k), expected)
        assert (np.abs(frame.ft) <= expected * frame.fn * (1 + 1e-6) + 1e-9).all()


def test_an_interrupted_sequence_continues_bit_for_bit(contradicted):
    inputs, results = contradicted
    whole = MemoryStore()
    infer_sequence(inputs, store=whole)
    resumed = infer_sequence(inputs, store=MemoryStore(whole.frames[:5]))
    for one, other in zip(results.frames, resumed.frames, strict=True):
        np.testing.assert_array_equal(one.fn, other.fn)
        assert one.trust == other.trust


@pytest.mark.slow
def test_an_interrupted_sequence_of_close_photographs_continues_bit_for_bit(contradicted, monkeypatch):
    inputs, neighbours = contradicted
    monkeypatch.setattr(correct_module, "choose_span", lambda tracks: (3, "read over 3 photographs"))
    whole = MemoryStore()
    results = infer_sequence(inputs, store=whole, complete=False)
    assert results.frames[0].reason.startswith("read over 3 photographs")
    assert not np.array_equal(results.frames[6].ut, neighbours.frames[6].ut)
    resumed = infer_sequence(inputs, store=MemoryStore(whole.frames[:5]), complete=False)
    for one, other in zip(results.frames, resumed.frames, strict=True):
        np.testing.assert_array_equal(one.fn, other.fn)
        np.testing.assert_array_equal(one.ut, other.ut)


def test_noise_that_hides_sliding_is_the_one_that_the_calibration_measured(contradicted, monkeypatch):
    inputs, _ = contradicted
    seen = []

    def louder(material, settings, tracks, walls, *rest):
        return replace(tracks, sigma=3.0 * tracks.sigma), walls, None

    monkeypatch.setattr(correct_module, "calibrate_with_radii", louder)
    monkeypatch.setattr(correct_module, "choose_span", lambda tracks: (seen.append(tracks.sigma.max()), (1, ""))[1])
    corrected = correct_module.correct_sequence(inputs)
    assert seen == [corrected.tracks.sigma.max()]
    assert seen[0] >= 3.0 * inputs.tracks.sigma.max()


@pytest.mark.slow
def test_a_first_frame_that_cannot_be_estimated_stays_and_is_reported(contradicted, monkeypatch):
    inputs, _ = contradicted
    store, failures = MemoryStore(), []

    def fail(*_: object) -> None:
        raise ZeroDivisionError("no estimate")

    class Observer(InferenceObserver):
        def failed(self, stage: str, frame: int, error: Exception) -> None:
            failures.append((stage, frame, type(error)))

    monkeypatch.setattr(inference, "estimate_first_frame", fail)
    results = infer_sequence(inputs, Observer(), store)
    assert failures == [(inference.FIRST_FRAME, 0, ZeroDivisionError)]
    np.testing.assert_array_equal(results.frames[0].fn, store.frames[0].forces.fn)


@pytest.mark.slow
def test_the_observer_receives_every_frame_once_and_the_progress(contradicted, tmp_path: Path):
    inputs, _ = contradicted
    events: list[int] = []
    steps: list[tuple[int, int]] = []

    class Observer(InferenceObserver):
        def solved(self, frame: object) -> None:
            events.append(frame.forces.frame)  # type: ignore[attr-defined]

    infer_sequence(inputs, Observer(lambda stage, done, total: steps.append((done, total))), complete=False)
    assert events == list(range(FRAMES))
    assert steps == [(k, FRAMES) for k in range(FRAMES + 1)]


def test_a_sequence_without_a_solved_frame_is_neither_estimated_nor_checked(contradicted, monkeypatch):
    inputs, _ = contradicted

    def unsolvable(*_: object, **options: object) -> Iterator[tuple[FrameForces, object]]:
        for k in range(FRAMES):
            yield replace(failed(k), frame=k), None

    def failed(k: int) -> FrameForces:
        from rodsight.solver.sequence.failure import failed_frame

        return failed_frame(k, "test", inputs.tracks.grain_count, inputs.walls.count)

    monkeypatch.setattr(solving, "solve_sequence", unsolvable)
    results = infer_sequence(inputs)
    assert {frame.status for frame in results.frames} == {FrameStatus.FAILED}
    assert results.friction_check is None


@pytest.mark.slow
def test_contacts_of_an_interpolated_rod_bear_force_and_are_marked(contradicted):
    inputs, results = contradicted
    frame, load = 4, np.bincount(results.frames[4].contacts.i, results.frames[4].fn)
    rod = int(np.argmax(load))
    position = inputs.tracks.position.copy()
    position[frame, rod] = np.nan
    found = infer_sequence(replace(inputs, tracks=replace(inputs.tracks, position=position)), complete=False)
    forces = found.frames[frame]
    theirs = (forces.contacts.i == rod) | (forces.contacts.j == rod)
    assert forces.fn[theirs].sum() > 0.5 * load[rod]
    source = forces.source[theirs]
    assert np.isin(source, (ContactSource.INTERPOLATED, ContactSource.FROM_BALANCE)).all()
    assert (source == ContactSource.INTERPOLATED).sum() >= 3
    assert (forces.source[~theirs] != ContactSource.INTERPOLATED).all()
    assert found.tracks.lost[frame].sum() == 1


@pytest.mark.thorough
def test_confused_names_change_no_force_and_are_named(contradicted):
    inputs, results = contradicted
    row = np.tile(np.arange(inputs.tracks.grain_count), (FRAMES, 1))
    row[FRAMES // 2 :, :3] = [1, 2, 0]
    confused = infer_sequence(replace(inputs, tracks=inputs.tracks.rearranged(row)))
    for given, found in zip(results.frames, confused.frames, strict=True):
        assert np.array_equal(given.contacts.key, found.contacts.key)
        assert np.array_equal(given.fn, found.fn)
        assert given.trust == found.trust
    assert "under the names of others" in confused.frames[0].reason


@pytest.mark.thorough
def test_sensors_that_contradict_the_scale_widen_it_and_change_no_force(contradicted):
    inputs, results = contradicted
    force = np.stack([each.wall_force for each in results.statistics])
    sensed = infer_sequence(replace(inputs, walls=replace(inputs.walls, force=force / 1.6)))
    agreeing = replace(results, walls=replace(results.walls, force=force))
    assert agreeing.wall_force_ratio() == pytest.approx(1.0)
    assert sensed.wall_force_ratio() == pytest.approx(1.6)
    for given, found in zip(results.frames, sensed.frames, strict=True):
        assert np.array_equal(given.fn, found.fn)
        assert found.scale_sd == pytest.approx(np.hypot(given.scale_sd, 0.6))
        assert (found.fn_sd >= given.fn_sd).all()
    circles = replace(agreeing.walls, side=np.full(agreeing.walls.count, OUT, np.int8))
    assert np.isnan(replace(agreeing, walls=circles).wall_force_ratio()).all()
    assert np.isnan(replace(agreeing, walls=replace(agreeing.walls, force=None)).wall_force_ratio()).all()


@pytest.mark.parametrize(("scenario", "least"), [("softer", 0.97), ("isotropic", 0.9)])
def test_a_single_photograph_shows_forces_by_its_positions_and_is_not_trusted(tmp_path, scenario, least):
    experiment = load_experiment(make_scenario(tmp_path, scenario, 6, grains=100).folder, ())
    inputs = read_inputs(experiment)
    inputs = replace(inputs, tracks=inputs.tracks.frames(0, 1), walls=inputs.walls.frames(0, 1))
    kept = SequenceKeeper()
    (frame,) = infer_sequence(inputs, kept).frames
    key, force = true_forces(experiment, kept.sequence)[0]
    _, found, true = align(frame.contacts.key, frame.fn, key, force[:, 0])
    assert pearson(found, true) > least
    assert frame.trust <= TRUST_OF_FEW
    assert frame.trust_penalties.startswith("the test has only 1 photograph")
