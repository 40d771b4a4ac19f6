"""A rod is correlated from a pose given by hand, and the stored correction is what the next run reads."""

import numpy as np
import pytest
from rodsight.experiment.corrections import read_corrections
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.scaling import make_scale
from rodsight.workbench.correcting.pose_editor import PoseEditor
from rodsight.workbench.correcting.proposals import TrackedPoses
from rodsight.workbench.correcting.rod_following import follow_rod

ALIKE = 1e-3  # a fit ends where steps are short, slightly beside the optimum


@pytest.fixture(scope="module")
def case(made_photographs):
    """A pose editor, and the true poses of photograph 2 in pixels."""
    experiment = load_experiment(made_photographs)
    photographs = experiment.photographs()
    table = read_table(made_photographs / "grains.csv", ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    true = read_table(made_photographs / "truth_tracks.csv", ("frame", "id", "x", "y", "theta"))
    here = true.integers("frame") == 2
    scale = make_scale(experiment.config.photographs, photographs.shape[0])
    place = scale.to_pixels(np.stack([true.numbers("x")[here], true.numbers("y")[here]], axis=1))
    pose = np.column_stack([place, scale.angle_to_world(true.numbers("theta")[here])])
    return PoseEditor(table.integers("id"), circles, photographs.__getitem__), pose


@pytest.mark.parametrize("error", [(0.0, 0.0, 0.0), (1.5, -1.0, 0.03), (4.0, 3.0, 0.15), (14.0, -12.0, 2.5)])
def test_a_rod_is_found_from_a_pose_beside_it(case, error):
    editor, pose = case
    found = editor.correlate(2, 7, tuple(pose[7] + np.array(error)))
    assert found.found
    assert found.zncc > 0.95
    np.testing.assert_allclose([found.x, found.y], pose[7, :2], atol=0.1)
    assert np.cos(found.angle - pose[7, 2]) == pytest.approx(1.0, abs=1e-4)
    assert found.zncc_before <= found.zncc + ALIKE
    assert found.residual_before >= found.residual - 100.0 * ALIKE


def test_where_nothing_correlates_the_given_pose_is_kept(case):
    editor, pose = case
    given = (float(pose[7, 0] + 70.0), float(pose[7, 1] + 55.0), 2.0)
    found = editor.correlate(2, 7, given)
    assert not found.found
    assert (found.x, found.y, found.angle) == given


@pytest.mark.parametrize("clear", [1.0, 0.45])
def test_a_rod_that_is_half_covered_is_found_to_parts_of_a_pixel(made_photographs, case, clear):
    editor, pose = case
    photographs = load_experiment(made_photographs).photographs()
    shown = photographs[2].copy()
    rows, columns = np.ogrid[: shown.shape[0], : shown.shape[1]]
    x, y, radius = *pose[7, :2], editor.circles[7, 2]
    face = np.hypot(columns - x, rows - y) < radius
    shown[face] = clear * shown[face] + (1.0 - clear) * 150.0  # a veil, and a reflection in it
    shown[np.hypot(columns - x - 0.25 * radius, rows - y) < 0.55 * radius] = 245.0
    covered = PoseEditor(editor.ids, editor.circles, lambda frame: shown if frame == 2 else photographs[frame])
    found = covered.correlate(2, 7, tuple(pose[7] + np.array([1.0, -1.0, 0.02])))
    assert found.found
    np.testing.assert_allclose([found.x, found.y], pose[7, :2], atol=0.1)
    assert found.zncc > 0.9


def test_an_unknown_rod_is_refused(case):
    with pytest.raises(KeyError):
        case[0].correlate(2, 999, (50.0, 50.0, 0.0))


def test_pictures_show_the_rod_rotated_back_and_the_difference(case):
    editor, pose = case
    right, wrong = tuple(pose[7]), tuple(pose[7] + np.array([6.0, 0.0, 0.5]))
    first, given, left_given, found, left = editor.pictures(2, 7, [wrong, right])
    middle = np.s_[22:66, 22:66]
    assert np.corrcoef(first[middle].ravel(), found[middle].ravel())[0, 1] > 0.95
    assert np.corrcoef(first[middle].ravel(), given[middle].ravel())[0, 1] < 0.5
    assert left[middle].std() < 0.3 * left_given[middle].std()


def test_a_rod_is_followed_until_its_track_agrees(case):
    editor, pose = case
    tracks = np.repeat(pose[None], 4, axis=0)
    tracks[0, :, :2], tracks[0, :, 2] = editor.circles[:, :2], 0.0
    all_right = tracked_poses(editor, np.stack([true_pose(editor, tracks, k) for k in range(4)]))
    spoiled = tracked_poses(editor, all_right.pose.copy())
    spoiled.pose[2, 7], spoiled.good[2, 7] = np.nan, False
    since = 1, editor.correlate(1, 7, tuple(all_right.pose[1, 7]))
    followed = follow_rod(editor, spoiled, 7, since, lambda frame: False)
    assert list(followed.poses) == [2]
    np.testing.assert_allclose([followed.poses[2].x, followed.poses[2].y], pose[7, :2], atol=0.1)
    assert "photograph 3 on" in followed.ended
    assert follow_rod(editor, spoiled, 7, since, lambda frame: frame == 2).poses == {}


def tracked_poses(editor, pose):
    """All poses (f, n, 3) are good."""
    good = np.ones(pose.shape[:2], np.bool_)
    return TrackedPoses(editor.ids, pose, editor.circles[:, 2], np.where(good, 0.98, np.nan), good)


def true_pose(editor, tracks, frame):
    """The poses (n, 3) of a photograph by correlation from those of photograph 2, which is the same within a rod."""
    if frame in (0, 2):
        return tracks[frame]
    found = [editor.correlate(frame, name, tuple(tracks[2, name])) for name in editor.ids.tolist()]
    return np.array([[each.x, each.y, each.angle] for each in found])


def test_a_rod_that_is_not_visible_is_a_correction_until_it_is_removed(visitor, photographs_only):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    visitor.request("mark_lost", at=at, frame=2, id=5)
    answer = visitor.request("mark_lost", at=at, frame=1, id=6)
    assert [(each["frame"], each["id"], each["x"]) for each in answer["corrections"]] == [(1, 6, None), (2, 5, None)]
    read = read_corrections(load_experiment(photographs_only / "my photographs"), None, 4)
    assert read.frame.tolist() == [1, 2]
    assert np.isnan(read.x).all()
    answer = visitor.request("undo_correction", at=at, frame=2, id=5)
    assert len(answer["corrections"]) == 1
    answer = visitor.request("undo", at=at)
    assert len(read_corrections(load_experiment(photographs_only / "my photographs"), None, 4).id) == 2
    assert "step Rods" in visitor.refused("mark_lost", at=at, frame=0, id=5)


def test_every_change_of_the_table_is_logged_with_what_was_before(visitor, photographs_only):
    at = visitor.request("begin", folder="my photographs/pictures", suffix=".jpg", name="mine")["at"]
    visitor.request("set_photographs", at=at, interval=30.0)
    visitor.request("set_scale", at=at, pixel_size=2.5e-4)
    table = photographs_only / "my photographs" / "corrections.csv"
    visitor.request("mark_lost", at=at, frame=2, id=5)
    table.write_text("frame,id,x,y,theta\n2,5,100.5,200.25,0.1\n")  # by another program, which writes no log
    visitor.request("mark_lost", at=at, frame=2, id=5)
    visitor.request("undo", at=at)
    visitor.request("redo", at=at)
    visitor.request("undo_correction", at=at, frame=2, id=5)
    visitor.request("set_photographs", at=at, interval=31.0)
    visitor.request("undo", at=at)  # of something else
    answer = visitor.request("corrections_log", at=at)["changes"]
    pose = [100.5, 200.25, 0.1]
    assert [(each["how"], each["before"], each["after"]) for each in reversed(answer)] == [
        ("hidden", None, "lost"), ("hidden", pose, "lost"), ("undone", "lost", pose), ("redone", pose, "lost"),
        ("removed", "lost", None),
    ]  # fmt: skip
    assert {(each["frame"], each["id"]) for each in answer} == {(2, 5)}
    log = photographs_only / "my photographs" / "corrections_log.jsonl"
    log.write_text(log.read_text() + '{"torn')
    assert visitor.request("corrections_log", at=at)["changes"] == answer
