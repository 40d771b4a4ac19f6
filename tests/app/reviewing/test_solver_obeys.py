"""The solver applies verdicts: forced contacts exist, forbidden ones carry no force, flags take effect."""

import csv
import json
import shutil
import signal
import subprocess
import urllib.request

import h5py
import numpy as np
import pytest
from rodsight.process.frame_range import FrameRange
from rodsight.results.hdf5.store import load_results
from rodsight.solver.contacts.contacts import ContactSource
from rodsight.solver.frame_forces import FrameStatus
from rodsight.verdicts.decisions import BodyNames, decide
from rodsight.verdicts.log import VERDICTS, Entry, Flag, Verdict, VerdictLog

from tests.program import RODSIGHT, rodsight

pytestmark = pytest.mark.thorough

ESTIMATORS = ("ensemble", "nlgs")
FEW = ("--set", "solver.sweeps=50", "--quiet")


def solve_again(experiment, out, estimator):
    """The command that solves a run again."""
    return ("solve", str(experiment), "--out", str(out), "--set", f"solver.estimator={estimator}", *FEW)


@pytest.fixture(scope="module")
def made_runs(made_tracks, tmp_path_factory):
    """A solved run of every estimator; not to be written to."""
    folder = tmp_path_factory.mktemp("runs")
    for estimator in ESTIMATORS:
        assert rodsight(*solve_again(made_tracks, folder / estimator, estimator)) == 0
    return folder


def copy_run(made_runs, made_tracks, tmp_path, estimator):
    out = shutil.copytree(made_runs / estimator, tmp_path / "out")
    return out, solve_again(made_tracks, out, estimator)


@pytest.fixture(params=ESTIMATORS)
def solved(request, made_runs, made_tracks, tmp_path):
    """A solved run of either estimator: its folder, and the command that solves it again."""
    return copy_run(made_runs, made_tracks, tmp_path, request.param)


@pytest.fixture
def solved_by_default(made_runs, made_tracks, tmp_path):
    """The same of one estimator, where nothing depends on which."""
    return copy_run(made_runs, made_tracks, tmp_path, ESTIMATORS[0])


def strongest(results, frame):
    forces = results.frames[frame]
    row = int(np.argmax(forces.fn))
    return int(forces.contacts.i[row]), int(forces.contacts.j[row])


def widest_pair(results, frame, bodies):
    """Two grains that are no contact by far, but neighbours."""
    position = results.tracks.position[frame]
    gap = (
        np.linalg.norm(position[:, None] - position[None], axis=2)
        - results.grains.radius
        - results.grains.radius[:, None]
    )
    gap[np.tril_indices(len(gap))] = np.inf
    gap[gap < 2e-4] = np.inf
    return (int(v) for v in np.unravel_index(np.argmin(gap), gap.shape))


def test_a_forbidden_contact_carries_no_force_and_an_added_one_exists(solved):
    out, again = solved
    results = load_results(out / "results.h5")
    bodies = BodyNames.of(results.tracks, results.walls)
    i, j = strongest(results, 3)
    a, b = widest_pair(results, 3, bodies)
    log = VerdictLog(out / VERDICTS)
    log.append(Entry(3, "anna", bodies.name(i), bodies.name(j), Verdict.NO_CONTACT))
    log.append(Entry(3, "anna", bodies.name(a), bodies.name(b), Verdict.CONTACT))
    assert rodsight(*again) == 0
    frame = load_results(out / "results.h5").frames[3]
    row = int(np.searchsorted(frame.contacts.key, bodies.key(i, j)))
    assert frame.contacts.key[row] == bodies.key(i, j)
    assert (frame.fn[row], frame.ft[row], frame.nlgs_fn[row]) == (0.0, 0.0, 0.0)
    assert frame.source[row] == ContactSource.FORBIDDEN_BY_REVIEWER
    row = int(np.searchsorted(frame.contacts.key, bodies.key(a, b)))
    assert frame.contacts.key[row] == bodies.key(a, b)
    assert frame.source[row] == ContactSource.ADDED_BY_REVIEWER
    assert (np.diff(frame.contacts.key) > 0).all()
    assert frame.history.fn.shape == (len(frame.history.recorded), frame.contacts.count)
    others = load_results(out / "results.h5").frames[1]
    assert (others.source == ContactSource.DETECTED).all()


@pytest.mark.slow
def test_undoing_every_verdict_gives_the_former_results(solved_by_default):
    out, again = solved_by_default
    before = load_results(out / "results.h5")
    bodies = BodyNames.of(before.tracks, before.walls)
    i, j = strongest(before, 2)
    log = VerdictLog(out / VERDICTS)
    log.append(Entry(2, "anna", bodies.name(i), bodies.name(j), Verdict.NO_CONTACT))
    assert rodsight(*again) == 0
    assert not np.array_equal(load_results(out / "results.h5").frames[4].fn, before.frames[4].fn)
    log.undo("anna")
    assert rodsight(*again) == 0
    after = load_results(out / "results.h5")
    for one, other in zip(before.frames, after.frames, strict=True):
        assert np.array_equal(one.fn, other.fn)
        assert np.array_equal(one.contacts.key, other.contacts.key)


@pytest.mark.slow
def test_flags_take_effect(solved):
    out, again = solved
    log = VerdictLog(out / VERDICTS)
    log.append(Entry(2, "anna", flag=Flag.REARRANGEMENT))
    log.append(Entry(3, "anna", flag=Flag.RESET))
    log.append(Entry(4, "anna", flag=Flag.IGNORE))
    assert rodsight(*again) == 0
    frames = load_results(out / "results.h5").frames
    assert frames[2].status is FrameStatus.REARRANGING or frames[2].status is FrameStatus.RESET
    assert frames[3].status is FrameStatus.RESET
    assert "a reviewer requested a reset" in frames[3].reason
    assert frames[3].frames_since_reset == 0
    assert frames[4].status is FrameStatus.SUSPECT
    assert "a reviewer excluded this photograph" in frames[4].reason


def test_ignoring_every_frame_is_refused(solved_by_default, capsys):
    out, again = solved_by_default
    for frame in range(5):
        VerdictLog(out / VERDICTS).append(Entry(frame, "anna", flag=Flag.IGNORE))
    assert rodsight(*again) == 2
    assert "nothing is left to solve" in capsys.readouterr().err


@pytest.mark.slow
def test_a_spoiled_photograph_that_is_ignored_harms_no_other(tracked, tmp_path):
    out = tmp_path / "out"
    # The position-only estimate would repair a part of the harm.
    again = ("solve", str(tracked), "--out", str(out), *FEW, "--set", "solver.positions=never")
    table = tracked / "tracks.csv"
    lines = table.read_text().splitlines()
    moved = []
    for line in lines:
        cells = line.split(",")
        if cells[0] == "2":  # a jolt of the camera
            cells[2] = str(float(cells[2]) + (1e-3 if int(cells[1]) % 2 else -1e-3))
        moved.append(",".join(cells))
    assert rodsight(*again) == 0
    good = load_results(out / "results.h5")
    table.write_text("\n".join(moved) + "\n")
    assert rodsight(*again) == 0
    spoiled = load_results(out / "results.h5")
    VerdictLog(out / VERDICTS).append(Entry(2, "anna", flag=Flag.IGNORE))
    assert rodsight(*again) == 0
    repaired = load_results(out / "results.h5")

    def distance(a, b):
        keys = np.union1d(a.contacts.key, b.contacts.key)
        one, two = np.zeros(len(keys)), np.zeros(len(keys))
        one[np.searchsorted(keys, a.contacts.key)], two[np.searchsorted(keys, b.contacts.key)] = a.fn, b.fn
        return np.linalg.norm(one - two) / np.linalg.norm(one)

    harm, left = distance(good.frames[3], spoiled.frames[3]), distance(good.frames[3], repaired.frames[3])
    assert left < 0.5 * harm  # measured: a small part of the harm is left


def test_score_counts_the_detector_as_it_was_before_the_verdicts(solved_by_default, capsys):
    out, again = solved_by_default
    results = load_results(out / "results.h5")
    bodies = BodyNames.of(results.tracks, results.walls)
    log = VerdictLog(out / VERDICTS)
    i, j = strongest(results, 3)
    a, b = widest_pair(results, 3, bodies)
    log.append(Entry(3, "anna", bodies.name(i), bodies.name(j), Verdict.CONTACT))
    log.append(Entry(3, "anna", bodies.name(a), bodies.name(b), Verdict.CONTACT))
    scores = []
    for _ in range(2):
        capsys.readouterr()
        assert rodsight("score", str(out), "--json") == 0
        scores.append(json.loads(capsys.readouterr().out)["verdicts"])
        assert rodsight(*again) == 0
    assert scores[0]["total"] == scores[1]["total"]
    assert scores[0]["total"]["recall"] == 0.5
    assert scores[0]["frame"] == [3]


def test_verdicts_on_unknown_bodies_are_counted_and_ignored(solved_by_default):
    out, _ = solved_by_default
    results = load_results(out / "results.h5")
    log = VerdictLog(out / VERDICTS)
    log.append(Entry(0, "anna", 999999, 1, Verdict.CONTACT))
    found = decide(log, BodyNames.of(results.tracks, results.walls), frames=FrameRange(0), frame_count=5)
    assert (found.count, found.unknown) == (0, 1)


def test_the_source_of_contacts_is_stored_by_name(solved_by_default):
    out, _ = solved_by_default
    with h5py.File(out / "results.h5") as store:
        names = h5py.check_enum_dtype(store["contacts/source"].dtype)
    assert set(names) == {"detected", "added_by_reviewer", "forbidden_by_reviewer", "from_balance", "interpolated"}


@pytest.mark.screen
def test_review_serves_until_it_is_interrupted(solved_by_default):
    out, _ = solved_by_default
    command = [*RODSIGHT, "review", str(out), "--no-browser", "--reviewer", "anna"]
    page = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        line = page.stdout.readline()
        assert line.startswith("Review of ")
        address = line.split()[-1]
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.build_opener(urllib.request.HTTPCookieProcessor()).open(address, timeout=20) as answer:
            assert b"<canvas" in answer.read()
        page.send_signal(signal.SIGINT)
        assert page.wait(20) == 0
    finally:
        page.kill()
        page.stdout.close()
        page.stderr.close()


def test_a_table_of_contacts_comes_in_and_the_threshold_is_refitted(solved_by_default, tmp_path, capsys):
    out, _ = solved_by_default
    assert rodsight("score", str(out), "--fit-threshold") == 2
    results = load_results(out / "results.h5")
    bodies = BodyNames.of(results.tracks, results.walls)
    contacts = results.frames[2].contacts
    rows = [f"2,{bodies.name(i)},{bodies.name(j)}" for i, j in zip(contacts.i, contacts.j, strict=True)]
    table = tmp_path / "list.csv"
    table.write_text("frame,i,j\n" + "\n".join(rows[:-3]) + "\n")
    assert rodsight("review", str(out), "--import-csv", str(table), "--complete", "--reviewer", "ben") == 0
    with (out / "judged_forces.csv").open() as stream:  # the forces before the verdicts, as the page stores them
        stored = list(csv.DictReader(stream))
    assert len(stored) == len((out / VERDICTS).read_text().splitlines())
    assert float(stored[0]["fn"]) == pytest.approx(results.frames[2].fn[0], rel=1e-4)
    capsys.readouterr()
    assert rodsight("score", str(out), "--json", "--fit-threshold") == 0
    scored = json.loads(capsys.readouterr().out)["verdicts"]
    assert scored["total"]["precision"] < 1.0
    assert scored["fit"]["contacts"] == len(rows) - 3
    assert abs(scored["fit"]["radius_change"]) < 2e-5  # twice the precision of a position
    assert rodsight("review", str(out), "--export-csv", str(tmp_path / "all.csv")) == 0
    assert len((tmp_path / "all.csv").read_text().splitlines()) == 1 + scored["judged"][0]
