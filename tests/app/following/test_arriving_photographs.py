"""Control of a running test: which photographs are processed when, which alarms are raised, what is kept."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.following import follow as module
from rodsight.results.checkpoint import Checkpoint
from rodsight.run_folder import UNFINISHED, Run
from rodsight.solver.frame_forces import FrameStatus

LAST_PAUSE = 4.0  # [s] of waiting until a scripted test without a limit is interrupted


@dataclass
class Frame:
    forces: np.ndarray


@pytest.fixture
def run(made_photographs, tmp_path):
    return Run(load_experiment(made_photographs), tmp_path / "run")


@pytest.fixture
def scripted(run, monkeypatch):
    """A follower over scripted listings of files; returns the processed lists, the states and the messages."""

    def follow_through(*listings, idle=None):
        clock, left = SimpleNamespace(now=0.0), list(listings)
        processed, messages = [], []

        class Listings:
            def __init__(self, folder, pattern):
                assert (folder, pattern) == (run.experiment.folder, run.experiment.config.photographs.files)

            def complete_files(self):
                return left.pop(0) if len(left) > 1 else left[0]

        def pause(seconds):
            assert 0.0 < seconds <= 0.5
            clock.now += seconds
            assert clock.now < 20.0, "it does not end"
            if clock.now > LAST_PAUSE and idle is None:
                raise KeyboardInterrupt

        def process(_run, _settings, ready, state, _alarm):
            processed.append((ready, state.files, state.grains))
            state.files, state.grains = ready, "grains"
            return len(ready) if len(ready) > 1 else None

        monkeypatch.setattr(module, "Arrivals", Listings)
        monkeypatch.setattr(module, "_process_new", process)
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=pause))
        found = []
        try:
            for results in module.follow(run, (), idle=idle, alarm=lambda frame, text: None, report=messages.append):
                found.append(results)
        except KeyboardInterrupt:
            found.append("interrupted")
        return found, processed, messages, clock.now

    return follow_through


def test_only_new_photographs_are_processed(scripted):
    found, processed, _, _ = scripted(["a1"], ["a1"], ["a1", "a2"], ["a1", "a2"])
    assert [ready for ready, _, _ in processed] == [("a1",), ("a1", "a2")]
    assert processed[1][1:] == (("a1",), "grains")
    assert found == [2, "interrupted"]


def test_a_vanished_photograph_is_no_reason_to_start_again(scripted):
    _, processed, messages, _ = scripted(["a1", "a2"], ["a1"], ["a1"])
    assert len(processed) == 1
    assert messages == ["Waiting for photographs."]


@pytest.mark.parametrize(("later", "grains"), [(["a1", "a15", "a2"], "grains"), (["a0", "a1", "a2"], None)])
def test_a_photograph_between_others_starts_again(scripted, run, later, grains):
    for stage in ("following-walls", "following-tracking", "solving"):
        Checkpoint(run.folder / UNFINISHED / stage, "before", run.notes).save(0, Frame(np.zeros(1)))
    _, processed, messages, _ = scripted(["a1", "a2"], later)
    assert processed[1] == (tuple(later), (), grains)
    assert "followed from its beginning" in messages[1]
    for stage in ("following-walls", "following-tracking", "solving"):
        assert Checkpoint(run.folder / UNFINISHED / stage, "before", run.notes).finished() == 0


def test_it_ends_when_nothing_arrives_for_the_given_time(scripted):
    found, processed, _, now = scripted(["a1", "a2"], ["a1", "a2"], idle=2.0)
    assert found == [2]
    assert len(processed) == 1
    assert 2.0 <= now < 3.0


def test_every_photograph_extends_the_test(scripted):
    waiting = [["a1"]] * 6  # 1.5 s or more
    found, processed, _, now = scripted(*waiting, ["a1", "a2"], idle=2.0)
    assert (found, len(processed)) == ([2], 2)
    assert now > 3.0


def test_only_newly_lost_rods_raise_an_alarm():
    present = np.ones((3, 8), bool)
    present[1:, 2] = False
    present[2, 3] = False
    tracks = SimpleNamespace(id=np.arange(10, 18), present=present, failed={})
    alarms = []
    lost = frozenset()
    for frame in range(3):
        lost = module._report_lost(tracks, frame, lost, lambda frame, text: alarms.append((frame, text)))
    assert alarms == [(1, "1 rod lost: 12"), (2, "1 rod lost: 13")]
    assert lost == {12, 13}
    tracks.failed = {2: "the photograph is dark"}
    module._report_lost(tracks, 2, frozenset(), lambda frame, text: alarms.append((frame, text)))
    assert alarms[2:] == [(2, "the photograph is dark")]
    present[2] = False
    tracks.failed = {}
    module._report_lost(tracks, 2, frozenset(), lambda frame, text: alarms.append((frame, text)))
    assert alarms[3:] == [(2, "8 rods lost: 10, 11, 12, 13, 14 …")]


@pytest.mark.parametrize(("grains", "kept"), [(30, True), (31, False)])
def test_another_set_of_rods_starts_again(run, grains, kept):
    dropped = []
    stored = SimpleNamespace(forces=SimpleNamespace(contacts=SimpleNamespace(grain_count=30)))
    store = SimpleNamespace(
        finished=lambda: 2, load=lambda frame: {1: stored}[frame], checkpoint=SimpleNamespace(drop=dropped.append)
    )
    observer = module._FollowObserver(run, SimpleNamespace(failed={}), store, lambda frame, text: None)
    observer.corrected(SimpleNamespace(packing=SimpleNamespace(grains=SimpleNamespace(count=grains))))
    assert dropped == ([] if kept else [0])


@pytest.mark.parametrize(
    ("status", "failed", "alarmed"),
    [
        (FrameStatus.SUSPECT, {}, ["suspect: evidence contradicts itself"]),
        (FrameStatus.SETTLED, {}, []),
        (FrameStatus.FAILED, {5: "dark"}, []),
    ],
)
def test_suspect_frames_raise_an_alarm_once(run, status, failed, alarmed):
    alarms = []
    forces = SimpleNamespace(frame=5, status=status, failed_reason="", reason="evidence contradicts itself")
    observer = module._FollowObserver(run, SimpleNamespace(failed=failed), None, lambda k, text: alarms.append(text))
    observer.solved(SimpleNamespace(forces=forces))
    assert alarms == alarmed


def test_frames_depend_on_the_first_photograph_and_the_settings_but_not_on_later_ones(run):
    experiment = run.experiment
    first, second, *_ = experiment.photographs().files

    def fingerprint(change=(), photographs=None):
        loaded = load_experiment(experiment.file, change)
        if photographs:
            loaded.inputs.listed(loaded.config.photographs.files, lambda: photographs)
        return module._fingerprint(loaded, (photographs or (first,))[0])

    known = fingerprint(photographs=(first,))
    assert fingerprint(photographs=(first, second)) == known
    assert fingerprint(photographs=(second,)) != known
    assert fingerprint(("material.friction=0.3",), photographs=(first,)) != known
