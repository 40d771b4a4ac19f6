"""Stored numbers are shown as they are stored, and verdicts go to the log that the solver applies."""

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.drawing.force_range import THICKEST, THINNEST, ForceRange
from rodsight.drawing.ramps import FORCE_RAMP
from rodsight.process.frame_range import FrameRange
from rodsight.results.hdf5.store import load_results, origin_of, read_origin, save_results, save_tracks
from rodsight.results.manifest import Manifest
from rodsight.reviewing.judging.candidate_pairs import find_candidate_pairs
from rodsight.run_folder import RESULTS, TRACKS, UNFINISHED
from rodsight.solver.kinematics.local_motion import measure_local_motion
from rodsight.solver.kinematics.sequence_kinematics import measure_kinematics
from rodsight.verdicts.decisions import BodyNames, decide
from rodsight.verdicts.log import VERDICTS, VerdictLog
from rodsight.workbench.inspecting.run_data import run_stamp
from rodsight.workbench.service.workbench import Workbench

from tests.app.recording.fake_results import with_fringes
from tests.app.workbench.conftest import Visitor
from tests.golden.stored import unpack

FIRST = 2  # the photograph of the stored run's frame 0
FRAME = 1
SHOWN = FIRST + FRAME  # the photograph of that frame

pytestmark = pytest.mark.thorough


@pytest.fixture
def solved(visitor, photographs_only):
    """A visitor, where the experiment is, its results and their folder."""
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    folder = photographs_only / "runs" / "mine"
    folder.mkdir(parents=True)
    return visitor, at, load_results(unpack(2, folder)), folder


def view(**values):
    return {"reviewer": "anna", "frame": SHOWN, **values}


def judge(visitor, at, pair, verdict, reviewer="anna"):
    named = {"frame": SHOWN, "i": pair["i"], "j": pair["j"]}
    visitor.request("judge", at=at, view=view(reviewer=reviewer), pair=named, verdict=verdict, seconds=2.5)


def test_the_network_of_a_frame_is_what_is_stored(solved):
    visitor, at, results, _ = solved
    answer = visitor.request("network", at=at, frame=SHOWN)
    forces = results.frames[FRAME]
    np.testing.assert_allclose(answer["fn"], forces.fn, rtol=1e-4)
    np.testing.assert_allclose(np.array(answer["ft"]), forces.ft, rtol=1e-4, atol=1e-9)
    assert answer["status"] == forces.status.name.lower()
    assert answer["i"] == results.tracks.id[forces.contacts.i].tolist()
    wall = forces.contacts.with_wall.nonzero()[0][0]
    assert answer["j"][wall] == results.walls.name[forces.contacts.j[wall] - results.grains.count]
    x1, y1, x2, y2 = answer["line"][0]
    length = 2.5e-4 * np.hypot(x2 - x1, y2 - y1)
    pair = forces.contacts.i[0], forces.contacts.j[0]
    assert length == pytest.approx(results.grains.radius[list(pair)].sum(), rel=0.02)  # the calibrated pixel


def test_frames_have_their_status_and_lost_rods(solved):
    visitor, at, results, _ = solved
    answer = visitor.request("run_state", at=at)["frames"]
    assert (answer["first"], answer["count"]) == (FIRST, FIRST + len(results.frames))
    assert answer["status"] == [None] * FIRST + [frame.status.name.lower() for frame in results.frames]
    assert not answer["provisional"]


def test_a_pair_is_described_in_all_frames(solved):
    visitor, at, results, _ = solved
    contacts = results.frames[FRAME].contacts
    i, j = (int(results.tracks.id[row]) for row in (contacts.i[0], contacts.j[0]))
    answer = visitor.request("pair", at=at, i=i, j=j)
    assert answer["gap"][SHOWN] == pytest.approx(contacts.gap[0], rel=1e-3, abs=1e-9)
    assert answer["fn"][SHOWN] == pytest.approx(results.frames[FRAME].fn[0], rel=1e-4)
    assert len(answer["gap_sd"]) == FIRST + len(results.frames)
    assert visitor.post("pair", {"at": at, "i": i, "j": "nowhere"}).status_code == 400


def test_pairs_are_ordered_by_influence_times_ambiguity(solved):
    visitor, at, _, _ = solved
    answer = visitor.request("candidate_pairs", at=at, view=view())["pairs"]
    priority = [each["priority"] for each in answer]
    assert priority == sorted(priority, reverse=True)
    first = answer[0]
    ambiguity = 1.0 - abs(2.0 * first["probability"] - 1.0)
    if first["fn"] is not None:
        assert first["priority"] == pytest.approx(ambiguity * first["fn"], rel=1e-3)


def test_a_verdict_reaches_the_solver_and_is_undone(solved):
    visitor, at, results, folder = solved
    first = visitor.request("candidate_pairs", at=at, view=view())["pairs"][0]
    i, j = first["i"], first["j"]
    judge(visitor, at, {"i": j, "j": i}, "no contact", " anna ")
    answer = visitor.request("candidate_pairs", at=at, view=view())
    assert answer["judged"] == 1
    assert [(each["i"], each["j"]) for each in answer["pairs"] if each["verdict"] == "no contact"] == [(i, j)]
    bodies = BodyNames.of(results.tracks, results.walls)
    log = VerdictLog(folder / VERDICTS)
    origin = read_origin(folder / RESULTS)
    assert origin is not None
    first_frame = origin.frames[0]
    decided = decide(log, bodies, frames=FrameRange(first_frame), frame_count=len(results.frames)).for_solver()
    rows = bodies.rows()
    assert decided[FRAME].forbidden.tolist() == [bodies.key(*sorted((rows[i], rows[j])))]
    assert visitor.request("undo_verdict", at=at, view=view())["undone"] == "no contact"
    assert visitor.request("undo_verdict", at=at, view=view())["undone"] is None
    decided = decide(log, bodies, frames=FrameRange(first_frame), frame_count=len(results.frames))
    assert decided.count == 0


def test_a_verdict_stays_with_its_photograph_when_the_order_changes(solved):
    visitor, at, _, folder = solved
    names = visitor.request("project", at=at)["series"]["names"]
    stored = {"photographs": names}
    Manifest(folder).store(stored)
    Manifest(folder).note(RESULTS, stored)
    pair = visitor.request("candidate_pairs", at=at, view=view())["pairs"][0]
    judge(visitor, at, pair, "no contact")
    moved = [*names[:2], *names[3:], names[2]]
    visitor.request("set_order", at=at, files=moved, change="moved")
    log = VerdictLog(folder / VERDICTS)
    assert [entry.frame for entry in log.entries()] == [moved.index(names[SHOWN])]
    for endpoint, values in (("network", {"frame": SHOWN}), ("candidate_pairs", {"view": view()})):
        assert "another one than in this run" in visitor.refused(endpoint, at=at, **values)
    visitor.request("set_order", at=at, files=[each for each in moved if each != names[SHOWN]], change="left out")
    assert log.entries() == []
    for _ in range(2):
        visitor.request("undo", at=at)
    assert [entry.frame for entry in log.entries()] == [SHOWN]
    assert visitor.request("candidate_pairs", at=at, view=view())["judged"] == 1


def test_an_unknown_pair_cannot_be_judged(solved):
    visitor, at, results, folder = solved
    name = int(results.tracks.id[0])
    other = int(results.tracks.id[1])
    for i, j, verdict in ((name, name, "contact"), (name, 10**6, "contact"), (name, other, "maybe")):
        values = {"at": at, "view": view(), "pair": {"frame": SHOWN, "i": i, "j": j}, "verdict": verdict}
        assert visitor.post("judge", values).status_code == 400
    assert not (folder / VERDICTS).exists()


def test_a_crop_is_a_picture(solved):
    visitor, at, _, _ = solved
    answer = visitor.client.get("/crop", params={"at": at, "frame": 1, "x": 120.5, "y": 130.0, "width": 60})
    assert answer.headers["Content-Type"] == "image/jpeg"
    assert visitor.client.get("/crop", params={"at": at, "frame": 1, "x": 1, "y": 1, "width": 1}).status_code == 400


def test_forces_without_a_contact_differ_and_nothing_is_written(solved):
    visitor, at, results, folder = solved
    before = sorted(file.name for file in folder.iterdir())
    answer = visitor.request("candidate_pairs", at=at, view=view())["pairs"]
    pair = max((each for each in answer if each["fn"]), key=lambda each: each["fn"])
    answer = visitor.request("without_contact", at=at, frame=SHOWN, i=pair["i"], j=pair["j"])
    assert min(answer["fn"]) >= 0.0 or min(answer["fn"]) == min(results.frames[FRAME].fn)
    gone = np.flatnonzero(np.array(answer["fn"]) == 0.0)
    assert len(gone) >= 1
    assert sorted(file.name for file in folder.iterdir()) == before
    assert "no contact" in visitor.refused("without_contact", at=at, frame=SHOWN, i=pair["i"], j=pair["i"])


def test_reviewers_are_compared_with_each_other_and_with_the_detector(solved):
    visitor, at, _, _ = solved
    assert visitor.request("agreement", at=at) == {
        "frames": [], "total": None, "precision": None, "recall": None, "threshold": None, "disputed": [],
        "kappas": [],
    }  # fmt: skip
    answer = visitor.request("candidate_pairs", at=at, view=view())["pairs"]
    detected = [each for each in answer if each["detected"]]
    undetected = [each for each in answer if not each["detected"]]

    def give(who, pair, verdict):
        judge(visitor, at, pair, verdict, who)

    for pair in detected[:4]:
        give("anna", pair, "contact")
        give("ben", pair, "contact" if pair is not detected[0] else "no contact")
    give("anna", undetected[0], "no contact")
    give("ben", undetected[0], "no contact")
    answer = visitor.request("agreement", at=at)
    (row,) = answer["frames"]
    assert row["frame"] == SHOWN
    assert (row["hits"], row["false"], row["missed"], row["rejected"]) == (3, 0, 0, 1)  # a draw counts for neither
    assert answer["precision"] is None  # five pairs are too few
    judges = {(each["first"], each["second"]): each for each in answer["kappas"]}
    both = judges["anna", "ben"]
    assert (both["count"], both["observed"]) == (5, 0.8)
    assert both["kappa"] == pytest.approx((0.8 - (0.8 * 0.6 + 0.2 * 0.4)) / (1.0 - (0.8 * 0.6 + 0.2 * 0.4)), rel=1e-4)
    assert judges["anna", "detector"]["observed"] == 1.0
    (pair,) = answer["disputed"]
    assert (pair["i"], pair["j"]) == (detected[0]["i"], detected[0]["j"])
    assert pair["verdicts"] == {"anna": "contact", "ben": "no contact"}


def test_a_run_of_some_photographs_is_shown_over_those(solved):
    visitor, at, results, _ = solved
    answer = visitor.request("network", at=at, frame=FIRST)
    assert answer["frame"] == FIRST
    np.testing.assert_allclose(answer["fn"], results.frames[0].fn, rtol=1e-4)
    for photograph in (FIRST - 1, FIRST + len(results.frames)):
        assert f"photograph {photograph}" in visitor.refused("network", at=at, frame=photograph)
        assert visitor.post("candidate_pairs", {"at": at, "view": view(frame=photograph)}).status_code == 400
    i, j = answer["i"][0], answer["j"][0]
    past = visitor.request("pair", at=at, i=i, j=j)
    assert past["point"][: FIRST + 1] == [None] * FIRST + [pytest.approx(answer["point"][0], abs=0.02)]
    rod = visitor.request("rod", at=at, id=i)
    assert {len(rod[key]) for key in ("zncc", "sigma", "rotation", "status", "unbalance")} == {len(past["fn"])}


def test_a_verdict_keeps_the_force_before_it(solved):
    visitor, at, _, folder = solved
    pair = next(each for each in visitor.request("candidate_pairs", at=at, view=view())["pairs"] if each["fn"])
    judge(visitor, at, pair, "no contact")
    answer = visitor.request("reviewed_pairs", at=at, reviewer="anna")
    (word,) = answer["pairs"]
    assert answer["waiting"] == 1
    assert (word["frame"], word["i"], word["j"], word["applied"]) == (SHOWN, pair["i"], pair["j"], False)
    assert word["before"]["fn"] == word["now"]["fn"] == pair["fn"]
    assert visitor.request("reviewed_pairs", at=at, reviewer="ben") == {"pairs": [], "waiting": 0}
    os.utime(folder / RESULTS, (4e9, 4e9))  # a later run that did not apply it
    assert visitor.request("reviewed_pairs", at=at, reviewer="anna")["waiting"] == 1
    without_force = [each for each in visitor.request("candidate_pairs", at=at, view=view())["pairs"] if not each["fn"]]
    judge(visitor, at, without_force[0], "no contact")
    words = visitor.request("reviewed_pairs", at=at, reviewer="anna")["pairs"]
    assert [each["applied"] for each in words] == [True, False]  # it carries no force, as the verdict demands
    visitor.request("undo_verdict", at=at, view=view())
    assert len(visitor.request("reviewed_pairs", at=at, reviewer="anna")["pairs"]) == 1


def test_accounts_of_machines_name_no_reviewer(visitor, monkeypatch):
    for account, name in (("root", ""), ("anna", "anna")):
        monkeypatch.setattr("getpass.getuser", lambda account=account: account)
        assert visitor.request("reviewer")["name"] == name


def test_a_run_that_removes_its_pieces_meanwhile_is_no_error(solved, monkeypatch):
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
    assert visitor.request("run_state", at=at)["frames"]["count"] == FIRST + len(results.frames)


def test_rods_of_a_run_of_some_photographs_are_corrected_in_those(solved):
    visitor, at, results, folder = solved
    origin = read_origin(folder / RESULTS)
    assert origin is not None
    save_tracks(folder / TRACKS, "mine", results.tracks, results.walls, origin)
    answer = visitor.request("poses", at=at, frame=SHOWN)
    present = results.tracks.present
    assert answer["rods"]["id"] == results.tracks.id[present[FRAME]].tolist()
    assert answer["lost_count"] == [0] * FIRST + (~present).sum(axis=1).tolist()
    assert "not tracked" in visitor.refused("poses", at=at, frame=FIRST - 1)
    name = int(results.tracks.id[0])
    assert "step Rods" in visitor.refused("mark_lost", at=at, frame=FIRST, id=name)
    assert "is not there" in visitor.refused("mark_lost", at=at, frame=FIRST - 1, id=name)


def test_undo_takes_back_the_last_action_whatever_it_was(solved):
    visitor, at, _, folder = solved
    first, second = visitor.request("candidate_pairs", at=at, view=view())["pairs"][:2]
    before = visitor.request("project", at=at)["photographs"]["interval"]
    judge(visitor, at, first, "no contact")
    visitor.request("set_photographs", at=at, interval=77.0)
    judge(visitor, at, second, "contact")

    def verdicts():
        return [str(entry.verdict) for _, entry in VerdictLog(folder / VERDICTS).verdicts()]

    answer = visitor.request("undo", at=at)
    assert {answer["verdict"]["i"], answer["verdict"]["j"]} == {second["i"], second["j"]}
    assert verdicts() == ["no contact"]
    assert visitor.request("undo", at=at)["photographs"]["interval"] == before
    assert verdicts() == ["no contact"]
    answer = visitor.request("undo", at=at)
    assert "no contact" in answer["undone"]
    assert verdicts() == []
    visitor.request("redo", at=at)
    assert verdicts() == ["no contact"]
    assert visitor.request("redo", at=at)["photographs"]["interval"] == 77.0
    assert visitor.request("redo", at=at)["redone"].endswith(": contact")
    assert sorted(verdicts()) == ["contact", "no contact"]
    visitor.request("undo", at=at)
    assert verdicts() == ["no contact"]


def test_forces_have_the_colours_and_the_range_of_the_recording(solved):
    visitor, at, results, _ = solved
    recorded = ForceRange.of(results.frames)
    for frame in range(FIRST, FIRST + len(results.frames)):  # the same in every frame
        given = visitor.request("network", at=at, frame=frame)["range"]
        assert given["top"] == pytest.approx(recorded.top, rel=1e-6)
        assert given["weak"] == pytest.approx(recorded.weak, rel=1e-6)
    look = visitor.request("force_look")
    assert look["ramps"]["force"][-1] == f"#{bytes(FORCE_RAMP[-1, :3].tolist()).hex()}"
    assert (look["thinnest"], look["thickest"]) == (2.0 * THINNEST, 2.0 * THICKEST)


def test_a_duplicate_has_its_own_name_and_no_run(visitor):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    first, second = (visitor.request("duplicate", at=at) for _ in range(2))
    assert (first["at"], first["name"]) == ("my photographs copy", "my photographs copy")
    assert second["name"] == "my photographs copy 2"
    assert first["photographs"] == visitor.request("project", at=at)["photographs"]
    assert (first["undo"], first["run"]) == (None, None)
    visitor.request("set_photographs", at=first["at"], interval=31.0)
    assert visitor.request("project", at=at)["photographs"]["interval"] == 30.0


def test_the_folder_that_is_opened_is_duplicated_below_itself(visitor, photographs_only):
    folder = photographs_only / "my photographs"
    visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")
    visitor = Visitor(Workbench(folder)).enter()
    assert visitor.request("project", at=".")["name"] == "mine"
    first, second = (visitor.request("duplicate", at=".") for _ in range(2))
    assert (first["at"], second["at"]) == ("my photographs copy", "my photographs copy 2")
    assert second["files"] == first["files"] == visitor.request("project", at=".")["files"]
    assert not (folder / second["at"] / first["at"]).exists()


def test_the_motion_of_rods_is_that_of_their_tracks(solved):
    visitor, at, results, _ = solved
    tracks, last = results.tracks, FIRST + len(results.frames) - 1
    answer = visitor.request("motion", at=at, frame=last, since=FIRST)
    here = tracks.present[-1]
    moved = tracks.position[-1, here] - tracks.position[0, here]
    pixels = np.column_stack([answer["dx"], -np.array(answer["dy"])])
    known = np.isfinite(moved).all(axis=1)
    np.testing.assert_allclose(pixels[known] * answer["pixel"], moved[known], rtol=0.02, atol=2e-6)
    turned = np.degrees(tracks.rotation[-1, here] - tracks.rotation[0, here])
    np.testing.assert_allclose(np.array(answer["rotation"], float)[known], turned[known], rtol=1e-3, atol=1e-6)
    strain = measure_local_motion(tracks.position[0], tracks.position[-1], tracks.radius).strain[here]
    volume = np.array([np.nan if value is None else value for value in answer["volume"]])
    np.testing.assert_allclose(volume, 100.0 * np.trace(strain, axis1=1, axis2=2), rtol=1e-3, atol=1e-6)
    assert all(value is None or value >= 0.0 for value in answer["shear"])
    assert "is not solved" in visitor.refused("motion", at=at, frame=last, since=FIRST - 1)


def test_the_motion_over_the_window_is_that_of_the_results(solved):
    visitor, at, results, folder = solved
    tracks, last = results.tracks, FIRST + len(results.frames) - 1
    measured = measure_kinematics(tracks.position, tracks.rotation, tracks.radius, tracks.sigma)
    save_results(folder / RESULTS, replace(results, read_kinematics=lambda: measured), origin_of(folder / RESULTS))
    answer = visitor.request("motion", at=at, frame=last)
    here = tracks.present[-1]
    assert (answer["window"], answer["since"]) == (measured.window, last - measured.window)
    for name, values in (("shear", measured.shear_strain), ("volume", measured.volumetric_strain)):
        given = np.array(answer[name], float)
        np.testing.assert_allclose(given, 100.0 * values[-1, here], rtol=1e-3, atol=1e-6)
    turned = np.degrees(measured.rotation[-1, here])
    np.testing.assert_allclose(np.array(answer["rotation"], float), turned, rtol=1e-3, atol=1e-6)
    moved = np.column_stack([answer["fx"], -np.array(answer["fy"], float)]).astype(float) * answer["pixel"]
    np.testing.assert_allclose(moved, measured.fluctuation[-1, here], rtol=0.02, atol=2e-6)


def test_fringes_are_values_of_the_discs_where_the_run_has_them(solved):
    visitor, at, results, folder = solved
    last = FIRST + len(results.frames) - 1
    assert visitor.request("run_state", at=at)["frames"]["fringes"] is False
    assert visitor.request("motion", at=at, frame=last)["fringes"] is None
    fringed = with_fringes(results)
    save_results(folder / RESULTS, fringed, origin_of(folder / RESULTS))
    assert visitor.request("run_state", at=at)["frames"]["fringes"] is True
    answer = visitor.request("motion", at=at, frame=last)["fringes"]
    here, found = results.tracks.present[-1], fringed.fringes
    for name, values in (("measured", found.measured), ("inferred", found.inferred), ("residual", found.residual)):
        np.testing.assert_allclose(np.array(answer[name], float), values[-1, here] / found.mean, rtol=2e-3, atol=1e-4)


def test_candidate_pairs_are_those_of_their_photograph(solved):
    visitor, at, results, _ = solved
    for frame in range(len(results.frames)):
        view = {"reviewer": "anna", "frame": FIRST + frame, "blind": False}
        listed = visitor.request("candidate_pairs", at=at, view=view)["pairs"]
        names = BodyNames.of(results.tracks, results.walls)
        found = find_candidate_pairs(results, frame).contacts
        true = {(names.name(i), names.name(j)) for i, j in zip(found.i.tolist(), found.j.tolist(), strict=True)}
        assert {(each["i"], each["j"]) for each in listed} == true


def test_a_rod_has_its_places_in_all_photographs(solved):
    visitor, at, _, _ = solved
    rods = visitor.request("network", at=at, frame=SHOWN)["rods"]
    answer = visitor.request("rod", at=at, id=rods["id"][4])
    assert answer["place"][SHOWN] == pytest.approx([rods["x"][4], rods["y"][4]], abs=0.02)
    assert answer["place"][:FIRST] == answer["displacement"][:FIRST] == [None] * FIRST
    assert answer["displacement"][FIRST] == 0.0


def test_a_part_of_a_photograph_is_sent_as_sharp_as_it_is(solved):
    visitor, at, _, _ = solved

    def picture(**query):
        answer = visitor.client.get("/photograph", params={"at": at, "frame": 0, **query})
        assert answer.status_code == 200, answer.text
        return cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)

    whole = picture()
    part = picture(left=40, top=60, right=140, bottom=110)
    assert part.shape == (50, 100)
    assert np.abs(part.astype(int) - whole[60:110, 40:140]).mean() < 3.0  # JPEG of other blocks
    assert max(picture(left=40, top=60, right=140, bottom=110, size=30).shape) == 30
    assert visitor.client.get("/photograph", params={"at": at, "frame": 0, "left": 9999}).status_code == 422
