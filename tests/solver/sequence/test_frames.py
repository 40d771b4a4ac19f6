"""Sequences of frames: state, lost grains, resets, verdicts and the ensemble."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rodsight.solver.assessment.penalties import assess
from rodsight.solver.assessment.trust import INFERRED_PENALTY, unseen_penalty
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import LastSeen, Snapshot, motion_to
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.contacts.pairs import are_among
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.nlgs.chain import ChainSettings
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.nlgs.sweep_record import recorded_sweeps
from rodsight.solver.sequence import ensemble
from rodsight.solver.sequence.frames import SequencePart, solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings
from rodsight.solver.sequence.state import SequenceState
from rodsight.solver.statistics.bearing import bearing_probability

from tests.packings import LENGTH, squeezed_heap

SETTINGS = SequenceSettings(estimator="nlgs", chain=ChainSettings(sweeps=40), threshold=2e-4)
ENSEMBLE = SequenceSettings(estimator="ensemble", chain=ChainSettings(sweeps=40))


def sheared_frames(count, lost=()):
    """A heap in shear steps of 0.002; `lost`: (frame, grain) without a pose."""
    grains, state, walls = squeezed_heap(np.random.default_rng(3))
    packing = Packing(grains, LENGTH, Material(0.25, 0.25), np.array([np.nan, np.nan, 5e4, np.nan]))
    snapshots = []
    for k in range(count):
        shear = np.array([[1.0, 2e-3 * k], [0.0, 1.0]])
        position = state.position @ shear.T
        rotation = np.full(grains.count, -1e-3 * k)
        present = np.ones(grains.count, bool)
        for frame, grain in lost:
            if frame == k:
                present[grain] = False
                position[grain] = np.nan
                rotation[grain] = np.nan
        snapshots.append(Snapshot(30.0 * k, position, rotation, present, walls.endpoints @ shear.T, 1e-5))
    return packing, snapshots


def run(packing, snapshots, settings=SETTINGS, **kwargs):
    return list(solve_sequence(packing, snapshots, settings, **kwargs))


@cache
def solved_heap(settings=SETTINGS, count=4):
    """The frames and states of a sheared heap. The ensemble refines positions of several frames together."""
    return run(*sheared_frames(count), settings)


@pytest.mark.slow
@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_a_sequence_resumes_from_a_stored_state_bit_for_bit(settings):
    packing, snapshots = sheared_frames(5)
    whole = solved_heap(settings, 5)
    resumed = run(packing, snapshots, settings, part=SequencePart(3, [whole[2][1]]))
    for (frame, _), (again, _) in zip(whole[3:], resumed, strict=True):
        assert np.array_equal(frame.fn, again.fn)
        assert np.array_equal(frame.ft, again.ft)
        assert np.array_equal(frame.age, again.age)


def test_the_first_two_frames_of_a_chain_are_resets():
    frames = [frame for frame, _ in run(*sheared_frames(4))]
    assert [frame.status for frame in frames[:2]] == [FrameStatus.RESET, FrameStatus.RESET]
    assert frames[1].frames_since_reset == 0
    assert frames[3].frames_since_reset == 2
    assert np.isnan(frames[0].trust)


def test_a_lost_grain_has_no_contacts_until_it_is_found_again():
    packing, snapshots = sheared_frames(5, lost=[(2, 14)])
    frames = [frame for frame, _ in run(packing, snapshots)]

    def touching(frame):
        return np.any((frame.contacts.i == 14) | (frame.contacts.j == 14))

    assert touching(frames[1])
    assert not touching(frames[2])
    assert touching(frames[3])


def test_forces_of_the_contacts_of_a_lost_grain_are_kept():
    packing, snapshots = sheared_frames(4, lost=[(2, 14)])
    states = [state for _, state in run(packing, snapshots)]
    bodies = packing.grains.count + 4

    def of(state):
        key = state.members.soft.key
        return set(key[(key // bodies == 14) | (key % bodies == 14)].tolist())

    assert of(states[1]) == of(states[2])


def test_the_velocity_of_a_grain_found_again_is_that_since_it_was_last_seen():
    packing, snapshots = sheared_frames(3, lost=[(1, 14)])
    seen = LastSeen.never(packing.grains.count).updated(snapshots[0]).updated(snapshots[1])
    motion = motion_to(snapshots[2], seen, snapshots[1].time, snapshots[1].endpoints)
    expected = (snapshots[2].position[14] - snapshots[0].position[14]) / 60.0
    assert motion.grains.velocity[14] == pytest.approx(expected)


def test_an_unseen_grain_has_the_velocity_of_its_neighbours():
    packing, snapshots = sheared_frames(2, lost=[(0, 14)])
    seen = LastSeen.never(packing.grains.count).updated(snapshots[0])
    motion = motion_to(snapshots[1], seen, snapshots[0].time, snapshots[0].endpoints)
    around = motion.grains.velocity[[13, 15, 8, 20]]
    assert around[:, 0].min() <= motion.grains.velocity[14, 0] <= around[:, 0].max()


def test_times_that_do_not_ascend_are_refused():
    packing, snapshots = sheared_frames(2)
    late = [snapshots[0], Snapshot(0.0, *[getattr(snapshots[1], n) for n in Snapshot.__slots__[1:]])]
    with pytest.raises(ValueError, match="not after"):
        run(packing, late)


def test_a_single_frame_can_be_solved():
    packing, snapshots = sheared_frames(1)
    frames = run(packing, snapshots)
    assert len(frames) == 1
    assert frames[0][0].status is FrameStatus.RESET


def test_every_sweep_is_counted_and_the_last_recorded_one_has_the_forces_of_the_frame():
    packing, snapshots = sheared_frames(3)
    frame, _ = run(packing, snapshots)[2]
    history = frame.history
    assert history.count == frame.sweeps == 5 * 40
    assert history.recorded[-1] == history.count - 1
    assert history.fn[-1] == pytest.approx(frame.nlgs_fn.astype(np.float32))


@pytest.mark.slow
def test_chains_without_forces_sweep_in_proportion_to_the_grains_until_they_have_advanced(monkeypatch):
    packing, snapshots = sheared_frames(5)
    settings = replace(ENSEMBLE, reset_frames=frozenset({3}))
    usual = [frame.sweeps for frame, _ in run(packing, snapshots, settings)]
    assert usual == [200, 200, 200, 400, 200]
    monkeypatch.setattr(ensemble, "REACHED_GRAINS", packing.grains.count / 3)
    found = [frame.sweeps for frame, _ in run(packing, snapshots, settings)]
    assert found == [600, 600, 200, 1200, 200]


def test_recorded_sweeps_are_log_spaced_and_end_with_the_last():
    kept = recorded_sweeps(5000, "log")
    assert kept[:8].tolist() == list(range(8))
    assert kept[-1] == 4999
    assert len(kept) <= 41
    assert recorded_sweeps(5000, "none").tolist() == [4999]
    assert len(recorded_sweeps(50, "all")) == 50


def test_memory_recalls_forces_by_pair_and_zero_for_unknown_pairs():
    packing, snapshots = sheared_frames(2)
    frame, _ = run(packing, snapshots)[1]
    memory = ForceMemory(frame.contacts.key[::2], np.column_stack([frame.fn, frame.ft])[::2])
    force = memory.recall(frame.contacts)
    assert np.array_equal(force[::2, 0], frame.fn[::2])
    assert not force[1::2].any()


def test_forces_scale_with_the_pressure_through_a_whole_sequence():
    packing, snapshots = sheared_frames(3)
    double = Packing(packing.grains, packing.length, packing.material, 2 * packing.pressure)
    once, twice = run(packing, snapshots)[2][0], run(double, snapshots)[2][0]
    assert twice.fn == pytest.approx(2 * once.fn, rel=1e-9, abs=1e-9 * once.fn.max())


def test_states_start_empty():
    grains = Grains.of_rods(np.array([0.01]), density=1.0, length=1.0)
    packing = Packing(grains, 1.0, Material(0, 0), np.full(4, np.nan))
    assert len(SequenceState.first(packing).members.soft.key) == 0


def test_the_ensemble_reports_a_balanced_field_inside_the_coulomb_cone():
    packing, snapshots = sheared_frames(4, lost=[(2, 14)])
    for frame, _ in run(packing, snapshots, ENSEMBLE):
        assert np.all(frame.fn >= 0)
        assert np.all(np.abs(frame.ft) <= 0.25 * frame.fn * (1 + 1e-12))
        assert np.all(frame.probability > 0)
        assert len(frame.nlgs_fn) == len(frame.fn)
        assert not np.any((frame.contacts.i == 14) & (frame.frame == 2))


def test_a_single_frame_is_solved_by_the_chain():
    frame, _ = solved_heap(ENSEMBLE, 1)[0]
    assert np.array_equal(frame.fn, frame.nlgs_fn)


def test_the_ensemble_has_a_disagreement_and_a_single_chain_has_none():
    for frame, state in solved_heap(ENSEMBLE):
        assert state.evidence.disagreement > 0
        assert state.evidence.unbalance == frame.unbalance
        assert np.all(frame.fn_sd[frame.fn > 0] > 0)
    for _, state in solved_heap():
        assert np.isnan(state.evidence.disagreement)


def test_members_may_disagree_on_the_scale_where_weight_alone_sets_it():
    loaded, snapshots = sheared_frames(2)
    heavy = replace(
        loaded, pressure=np.full(len(loaded.pressure), np.nan), material=Material(0.25, 0.25, 0, (0, -9.81))
    )
    assert np.isfinite(loaded.pressure).any()
    alone = replace(ENSEMBLE, positions="never")  # 40 sweeps balance this heap so little that a mixture of it fails
    found = [run(each, snapshots, alone)[1][1].evidence.scale_disagreement for each in (loaded, heavy)]
    assert np.isnan(found[0])
    assert found[1] > 0


def test_a_frame_reports_the_penalty_for_unseen_rods():
    packing, snapshots = sheared_frames(2)
    for inferred in (0, 2):
        frame, state = run(replace(packing, inferred=inferred), snapshots)[1]
        assert frame.unseen_penalty == unseen_penalty(state.evidence)
        assert (frame.unseen_penalty > 2 * INFERRED_PENALTY / packing.grains.count - 1e-12) == (inferred == 2)


def test_the_load_fraction_is_known_only_with_a_load():
    packing, snapshots = sheared_frames(3)
    imposed = Packing(packing.grains, packing.length, packing.material, np.full(4, np.nan))
    assert run(packing, snapshots)[2][1].evidence.load_fraction > 0
    assert np.isnan(run(imposed, snapshots)[2][1].evidence.load_fraction)


@pytest.mark.slow
def test_members_are_kept_on_request():
    packing, snapshots = sheared_frames(4)
    requested = SequenceSettings(estimator="ensemble", chain=ChainSettings(sweeps=40), keep_members=True)
    runs = run(packing, snapshots, requested), run(packing, snapshots, ENSEMBLE)
    for (frame, _), (without, _) in zip(*runs, strict=True):
        assert without.member_force is None
        assert frame.member_force is not None
        assert frame.member_force.shape == (frame.contacts.count, 7, 2)
        assert np.array_equal(frame.member_force[:, 0, 0], frame.nlgs_fn)  # the first member is the recorded chain
        assert np.array_equal(frame.fn, without.fn)


def test_inertia_alone_has_no_correction_and_no_trust():
    packing, snapshots = sheared_frames(3)
    chain = ChainSettings(kappa=None, sweeps=40)
    frame, _ = run(packing, snapshots, SequenceSettings(estimator="nlgs", chain=chain, threshold=2e-4))[2]
    assert np.isnan(frame.correction)
    assert np.isnan(frame.trust)


@pytest.mark.parametrize(("level", "stated"), [(None, False), (1e-9, True)])
def test_the_end_of_the_sweeps_is_a_reason_where_a_level_should_end_them(level, stated):
    packing, snapshots = sheared_frames(3)
    chain = replace(SETTINGS.chain, force_change=level, sweeps=40)
    frame, _ = run(packing, snapshots, replace(SETTINGS, chain=chain))[2]
    assert ("convergence is not claimed" in frame.reason) == stated


@pytest.mark.thorough
@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_a_reset_can_be_forced_at_a_frame(settings):
    packing, snapshots = sheared_frames(5)
    frames = [frame for frame, _ in run(packing, snapshots, replace(settings, reset_frames=frozenset({3})))]
    assert frames[3].status is FrameStatus.RESET
    assert "requested a reset" in frames[3].reason
    assert [frame.frames_since_reset for frame in frames[3:]] == [0, 1]


def test_a_reset_at_a_rearrangement_reports_the_change_and_can_be_disabled(monkeypatch):
    def rearranging(evidence):
        return (FrameStatus.RESET if evidence.reset else FrameStatus.REARRANGING), "decided by this test"

    monkeypatch.setattr("rodsight.solver.sequence.frame.decide_status", rearranging)
    packing, snapshots = sheared_frames(5)
    settings = replace(SETTINGS, reset_to_zero=True, kept_frames=frozenset({3}))
    frames = [frame for frame, _ in run(packing, snapshots, settings)]
    assert [frame.status for frame in frames[2:]] == [FrameStatus.RESET, FrameStatus.REARRANGING, FrameStatus.RESET]
    assert "changed the forces by" in frames[2].reason
    carried = [frame for frame, _ in run(packing, snapshots)]
    assert not np.array_equal(frames[2].fn, carried[2].fn)


def test_the_overlap_is_a_fraction_of_the_mean_diameter_unless_given():
    radius = np.array([0.007, 0.009])
    given, usual = SequenceSettings(overlap=2e-6).for_radii(radius), SequenceSettings().for_radii(radius)
    assert usual.overlap == usual.ensemble.probability.overlap == pytest.approx(3e-4 * 0.016)
    assert given.overlap == given.ensemble.probability.overlap == 2e-6


def test_a_pair_confirmed_by_a_reviewer_is_certain_whatever_its_gaps():
    packing, snapshots = sheared_frames(3)
    detected, before = solved_heap(ENSEMBLE, 3)[2][0], solved_heap(ENSEMBLE, 3)[1][1]
    uncertain = detected.contacts.key[[np.argmin(detected.probability)]]
    assert detected.probability.min() < 0.9
    verdicts = {2: Verdicts(forced=uncertain)}
    ((frame, state),) = run(packing, snapshots, ENSEMBLE, part=SequencePart(2, [before]), verdicts=verdicts)
    assert state.members.pairs.of(uncertain) == 1.0
    assert frame.probability[frame.contacts.key == uncertain] == detected.probability.min()  # as detected


def test_a_pair_added_by_a_reviewer_counts_as_bearing():
    packing, snapshots = sheared_frames(3)
    detected, before = solved_heap(ENSEMBLE, 3)[2][0].contacts.key, solved_heap(ENSEMBLE, 3)[1][1]
    now, reach = snapshots[2], 0.5 * packing.grains.radius.mean()
    near = detect_contacts(packing.grains, now.position, now.present, packing.walls_of(now), reach)
    open_pairs = near.select(np.flatnonzero(~are_among(near.key, detected)))
    added = open_pairs.key[np.argsort(open_pairs.gap)[:8]]
    ((frame, _),) = run(
        packing, snapshots, ENSEMBLE, part=SequencePart(2, [before]), verdicts={2: Verdicts(forced=added)}
    )
    row = are_among(frame.contacts.key, added) & (frame.probability == 0.0) & (frame.fn > 0.01 * frame.fn.mean())
    assert row.any()
    assert (frame.bearing_probability[row] == bearing_probability(frame.fn, np.ones_like(frame.fn))[row]).all()


def test_only_the_ensemble_compares_two_starts():
    chain = [frame.start_difference for frame, _ in solved_heap()]
    ensemble = [frame.start_difference for frame, _ in solved_heap(ENSEMBLE)]
    assert np.isnan(chain).all()
    assert np.isnan(ensemble[0])
    assert np.isfinite(ensemble[1:]).all()
    assert ensemble[3] < ensemble[1]


@pytest.mark.thorough
def test_two_starts_are_compared_until_they_agree_for_three_frames_and_after_a_reset():
    packing, snapshots = sheared_frames(8)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ensemble, "SETTLED_DIFFERENCE", 10.0)  # any two starts agree within it
        solved = run(packing, snapshots, replace(ENSEMBLE, reset_frames=frozenset([6])))
    known = [bool(np.isfinite(frame.start_difference)) for frame, _ in solved]
    assert known == [False, True, True, True, False, False, True, True]
    assert [state.evidence.start_forgotten for _, state in solved] == [False] * 3 + [True] * 3 + [False] * 2


def test_the_hidden_forces_of_a_lost_grain_lower_the_trust():
    packing, snapshots = sheared_frames(5, lost=[(2, 14)])
    (seen, _), (holed, state) = run(packing, snapshots)[1:3]
    assert seen.hidden_fraction == 0.0
    assert 0.0 < holed.hidden_fraction < 1.0
    assert holed.trust == pytest.approx(assess(state.evidence).trust)
    assert holed.trust < assess(replace(state.evidence, hidden_fraction=0.0)).trust


def test_the_return_from_a_faulty_frame_is_no_jump_of_the_stress():
    packing, snapshots = sheared_frames(5)
    state = run(packing, snapshots)[2][1]
    state = replace(state, sound_pressure=state.pressure)
    faulty = replace(state, pressure=3.0 * state.pressure)
    (_, after), *_ = run(packing, snapshots, part=SequencePart(3, [faulty]))
    (_, sound), *_ = run(packing, snapshots, part=SequencePart(3, [state]))
    assert after.evidence.pressure_jump == sound.evidence.pressure_jump
    never_sound = replace(faulty, sound_pressure=np.nan)
    (_, jumped), *_ = run(packing, snapshots, part=SequencePart(3, [never_sound]))
    assert jumped.evidence.pressure_jump > after.evidence.pressure_jump
    unloaded = replace(packing, pressure=np.full_like(packing.pressure, np.nan))  # its scale is arbitrary
    (_, arbitrary), *_ = run(unloaded, snapshots, part=SequencePart(3, [never_sound]))
    assert np.isnan(arbitrary.evidence.pressure_jump)
