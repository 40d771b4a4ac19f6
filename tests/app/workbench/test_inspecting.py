"""Stored numbers are shown as they are stored, and verdicts go to the log that the solver obeys."""

import os
from pathlib import Path

import numpy as np
import pytest
from rodsight.results.hdf5.store import load_results, read_origin, save_tracks
from rodsight.run_folder import RESULTS, TRACKS, UNFINISHED
from rodsight.verdicts.decisions import Bodies, decide
from rodsight.verdicts.log import VERDICTS, VerdictLog
from rodsight.workbench.inspecting.found import run_stamp

from tests.golden.stored import unpack

FIRST = 2  # the photograph of the stored run's frame 0
FRAME = 1
SHOWN = FIRST + FRAME  # the photograph of that frame


@pytest.fixture
def solved(visitor, photographs_only):
    """A visitor, where the experiment is, its results and their folder."""
    at = visitor.ask("begin", roll=0, name="mine")["at"]
    visitor.ask("set_photographs", at=at, interval=30.0)
    visitor.ask("set_scale", at=at, pixel_size=2.5e-4)
    folder = photographs_only / "runs" / "mine"
    folder.mkdir(parents=True)
    return visitor, at, load_results(unpack(2, folder)), folder


def test_the_network_of_a_frame_is_what_is_stored(solved):
    visitor, at, results, _ = solved
    told = visitor.ask("network", at=at, frame=SHOWN)
    forces = results.frames[FRAME]
    np.testing.assert_allclose(told["fn"], forces.fn, rtol=1e-4)
    np.testing.assert_allclose(np.array(told["ft"]), forces.ft, rtol=1e-4, atol=1e-9)
    assert told["status"] == forces.status.name.lower()
    assert told["i"] == results.tracks.id[forces.contacts.i].tolist()
    wall = forces.contacts.with_wall.nonzero()[0][0]
    assert told["j"][wall] == results.walls.name[forces.contacts.j[wall] - results.grains.count]
    x1, y1, x2, y2 = told["line"][0]
    length = 2.5e-4 * np.hypot(x2 - x1, y2 - y1)
    pair = forces.contacts.i[0], forces.contacts.j[0]
    assert length == pytest.approx(results.grains.radius[list(pair)].sum(), rel=0.02)  # the calibrated pixel


def test_frames_are_told_with_their_status_and_what_is_lost(solved):
    visitor, at, results, _ = solved
    told = visitor.ask("run_told", at=at)["frames"]
    assert (told["first"], told["count"]) == (FIRST, FIRST + len(results.frames))
    assert told["status"] == [None] * FIRST + [frame.status.name.lower() for frame in results.frames]
    assert not told["provisional"]


def test_a_pair_is_told_over_all_frames(solved):
    visitor, at, results, _ = solved
    contacts = results.frames[FRAME].contacts
    i, j = (int(results.tracks.id[row]) for row in (contacts.i[0], contacts.j[0]))
    told = visitor.ask("pair", at=at, i=i, j=j)
    assert told["gap"][SHOWN] == pytest.approx(contacts.gap[0], rel=1e-3, abs=1e-9)
    assert told["fn"][SHOWN] == pytest.approx(results.frames[FRAME].fn[0], rel=1e-4)
    assert len(told["gap_sd"]) == FIRST + len(results.frames)
    assert visitor.post("pair", {"at": at, "i": i, "j": "nowhere"}).status_code == 400


def test_those_pairs_come_first_on_which_most_hangs(solved):
    visitor, at, _, _ = solved
    told = visitor.ask("candidates", at=at, frame=SHOWN, reviewer="anna")["pairs"]
    stake = [each["stake"] for each in told]
    assert stake == sorted(stake, reverse=True)
    first = told[0]
    doubt = 1.0 - abs(2.0 * first["probability"] - 1.0)
    if first["fn"] is not None:
        assert first["stake"] == pytest.approx(doubt * first["fn"], rel=1e-3)


def test_a_verdict_reaches_the_solver_and_is_taken_back(solved):
    visitor, at, results, folder = solved
    first = visitor.ask("candidates", at=at, frame=SHOWN, reviewer="anna")["pairs"][0]
    i, j = first["i"], first["j"]
    visitor.ask("judge", at=at, frame=SHOWN, i=j, j=i, verdict="no contact", reviewer=" anna ", seconds=2.5)
    told = visitor.ask("candidates", at=at, frame=SHOWN, reviewer="anna")
    assert told["judged"] == 1
    assert [(each["i"], each["j"]) for each in told["pairs"] if each["verdict"] == "no contact"] == [(i, j)]
    bodies = Bodies.of(results.tracks, results.walls)
    log = VerdictLog(folder / VERDICTS)
    origin = read_origin(folder / RESULTS)
    assert origin is not None
    first_frame = origin.frames[0]
    decided = decide(log, bodies, first_frame=first_frame, frame_count=len(results.frames)).for_solver()
    rows = bodies.rows()
    assert decided[FRAME].forbidden.tolist() == [bodies.key(*sorted((rows[i], rows[j])))]
    assert visitor.ask("unjudge", at=at, reviewer="anna")["undone"] == "no contact"
    assert visitor.ask("unjudge", at=at, reviewer="anna")["undone"] is None
    decided = decide(log, bodies, first_frame=first_frame, frame_count=len(results.frames))
    assert decided.count == 0


def test_what_is_no_pair_cannot_be_judged(solved):
    visitor, at, results, folder = solved
    name = int(results.tracks.id[0])
    other = int(results.tracks.id[1])
    for i, j, verdict in ((name, name, "contact"), (name, 10**6, "contact"), (name, other, "maybe")):
        values = {"at": at, "frame": SHOWN, "i": i, "j": j, "verdict": verdict, "reviewer": "anna"}
        assert visitor.post("judge", values).status_code == 400
    assert not (folder / VERDICTS).exists()


def test_a_crop_is_a_picture(solved):
    visitor, at, _, _ = solved
    answer = visitor.client.get("/crop", params={"at": at, "frame": 1, "x": 12050, "y": 13000, "width": 60})
    assert answer.headers["Content-Type"] == "image/jpeg"
    assert visitor.client.get("/crop", params={"at": at, "frame": 1, "x": 1, "y": 1, "width": 1}).status_code == 422


def test_forces_without_a_contact_differ_and_nothing_is_written(solved):
    visitor, at, results, folder = solved
    before = sorted(file.name for file in folder.iterdir())
    told = visitor.ask("candidates", at=at, frame=SHOWN, reviewer="anna")["pairs"]
    pair = max((each for each in told if each["fn"]), key=lambda each: each["fn"])
    answer = visitor.ask("without", at=at, frame=SHOWN, i=pair["i"], j=pair["j"])
    assert min(answer["fn"]) >= 0.0 or min(answer["fn"]) == min(results.frames[FRAME].fn)
    gone = np.flatnonzero(np.array(answer["fn"]) == 0.0)
    assert len(gone) >= 1
    assert sorted(file.name for file in folder.iterdir()) == before
    assert "no contact" in visitor.refused("without", at=at, frame=SHOWN, i=pair["i"], j=pair["i"])


def test_eyes_are_compared_with_one_another_and_with_the_program(solved):
    visitor, at, _, _ = solved
    assert visitor.ask("agreement", at=at) == {
        "frames": [], "total": None, "precision": None, "recall": None, "disputed": [], "judges": [],
    }  # fmt: skip
    told = visitor.ask("candidates", at=at, frame=SHOWN, reviewer="anna")["pairs"]
    seen = [each for each in told if each["detected"]]
    unseen = [each for each in told if not each["detected"]]

    def say(who, pair, verdict):
        visitor.ask("judge", at=at, frame=SHOWN, i=pair["i"], j=pair["j"], verdict=verdict, reviewer=who)

    for pair in seen[:4]:
        say("anna", pair, "contact")
        say("ben", pair, "contact" if pair is not seen[0] else "no contact")
    say("anna", unseen[0], "no contact")
    say("ben", unseen[0], "no contact")
    told = visitor.ask("agreement", at=at)
    (row,) = told["frames"]
    assert row["frame"] == SHOWN
    assert (row["hits"], row["false"], row["missed"], row["rejected"]) == (3, 0, 0, 1)  # a draw is nobody's word
    assert told["precision"] is None  # five pairs say too little
    judges = {(each["first"], each["second"]): each for each in told["judges"]}
    both = judges["anna", "ben"]
    assert (both["count"], both["observed"]) == (5, 0.8)
    assert both["kappa"] == pytest.approx((0.8 - (0.8 * 0.6 + 0.2 * 0.4)) / (1.0 - (0.8 * 0.6 + 0.2 * 0.4)), rel=1e-4)
    assert judges["anna", "detector"]["observed"] == 1.0
    (pair,) = told["disputed"]
    assert (pair["i"], pair["j"]) == (seen[0]["i"], seen[0]["j"])
    assert pair["said"] == {"anna": "contact", "ben": "no contact"}


def test_a_run_of_some_photographs_is_shown_over_those(solved):
    visitor, at, results, _ = solved
    told = visitor.ask("network", at=at, frame=FIRST)
    assert told["frame"] == FIRST
    np.testing.assert_allclose(told["fn"], results.frames[0].fn, rtol=1e-4)
    for photograph in (FIRST - 1, FIRST + len(results.frames)):
        assert f"photograph {photograph}" in visitor.refused("network", at=at, frame=photograph)
        assert "photograph" in visitor.refused("candidates", at=at, frame=photograph, reviewer="anna")
    i, j = told["i"][0], told["j"][0]
    past = visitor.ask("pair", at=at, i=i, j=j)
    assert past["point"][: FIRST + 1] == [None] * FIRST + [pytest.approx(told["point"][0], abs=0.02)]
    rod = visitor.ask("rod", at=at, id=i)
    assert {len(rod[key]) for key in ("zncc", "sigma", "rotation", "status", "unbalance")} == {len(past["fn"])}


def test_what_was_said_keeps_the_force_that_it_was_said_of(solved):
    visitor, at, _, folder = solved
    pair = next(each for each in visitor.ask("candidates", at=at, frame=SHOWN, reviewer="")["pairs"] if each["fn"])
    visitor.ask("judge", at=at, frame=SHOWN, i=pair["i"], j=pair["j"], verdict="no contact", reviewer="anna")
    told = visitor.ask("judged", at=at, reviewer="anna")
    (word,) = told["pairs"]
    assert told["waiting"] == 1
    assert (word["frame"], word["i"], word["j"], word["obeyed"]) == (SHOWN, pair["i"], pair["j"], False)
    assert word["before"]["fn"] == word["now"]["fn"] == pair["fn"]
    assert visitor.ask("judged", at=at, reviewer="ben") == {"pairs": [], "waiting": 0}
    os.utime(folder / RESULTS, (4e9, 4e9))  # a run after it that did not obey
    assert visitor.ask("judged", at=at, reviewer="anna")["waiting"] == 1
    forgotten = [each for each in visitor.ask("candidates", at=at, frame=SHOWN, reviewer="")["pairs"] if not each["fn"]]
    visitor.ask("judge", at=at, frame=SHOWN, i=forgotten[0]["i"], j=forgotten[0]["j"], verdict="no contact",
                reviewer="anna")  # fmt: skip
    words = visitor.ask("judged", at=at, reviewer="anna")["pairs"]
    assert [each["obeyed"] for each in words] == [True, False]  # it carries nothing, as was said
    visitor.ask("unjudge", at=at, reviewer="anna")
    assert len(visitor.ask("judged", at=at, reviewer="anna")["pairs"]) == 1


def test_nobody_is_called_by_the_account_of_a_machine(visitor, monkeypatch):
    for account, name in (("root", ""), ("anna", "anna")):
        monkeypatch.setattr("getpass.getuser", lambda account=account: account)
        assert visitor.ask("reviewer")["name"] == name


def test_a_run_that_takes_its_pieces_away_meanwhile_is_no_error(solved, monkeypatch):
    visitor, at, results, folder = solved
    pieces = folder / UNFINISHED / "solving"
    pieces.mkdir(parents=True)
    walk = os.scandir

    def gone(place):
        if Path(place) == pieces:
            raise FileNotFoundError(place)
        return walk(place)

    monkeypatch.setattr(os, "scandir", gone)
    monkeypatch.setattr(os, "listdir", gone)
    assert run_stamp(folder)[0] == 0
    assert visitor.ask("run_told", at=at)["frames"]["count"] == FIRST + len(results.frames)


def test_rods_of_a_run_of_some_photographs_are_mended_in_those(solved):
    visitor, at, results, folder = solved
    origin = read_origin(folder / RESULTS)
    assert origin is not None
    save_tracks(folder / TRACKS, "mine", results.tracks, results.walls, origin)
    told = visitor.ask("poses", at=at, frame=SHOWN)
    present = results.tracks.present
    assert told["rods"]["id"] == results.tracks.id[present[FRAME]].tolist()
    assert told["lost_count"] == [0] * FIRST + (~present).sum(axis=1).tolist()
    assert "not tracked" in visitor.refused("poses", at=at, frame=FIRST - 1)
    name = int(results.tracks.id[0])
    assert "step Rods" in visitor.refused("mark_lost", at=at, frame=FIRST, id=name)
    assert "is not there" in visitor.refused("mark_lost", at=at, frame=FIRST - 1, id=name)
