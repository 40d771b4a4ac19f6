"""A rod is correlated again from where a hand puts it, and what is kept is what the next run reads."""

import numpy as np
import pytest
from rodsight.experiment.corrections import read_corrections
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.scaling import make_scale
from rodsight.workbench.mending.following import Tracked, follow_on
from rodsight.workbench.mending.mender import Mender

ALIKE = 1e-3  # a fit ends where steps are short, which may be a hair beside the best


@pytest.fixture(scope="module")
def mended(made_photographs):
    """A mender, and the true poses of photograph 2 in pixels."""
    experiment = load_experiment(made_photographs)
    photographs = experiment.photographs()
    table = read_table(made_photographs / "grains.csv", ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    true = read_table(made_photographs / "truth_tracks.csv", ("frame", "id", "x", "y", "theta"))
    here = true.integers("frame") == 2
    scale = make_scale(experiment.config.photographs, photographs.shape[0])
    place = scale.to_pixels(np.stack([true.numbers("x")[here], true.numbers("y")[here]], axis=1))
    pose = np.column_stack([place, scale.angle_to_world(true.numbers("theta")[here])])
    return Mender(table.integers("id"), circles, photographs.__getitem__), pose


@pytest.mark.parametrize("error", [(0.0, 0.0, 0.0), (1.5, -1.0, 0.03), (4.0, 3.0, 0.15), (14.0, -12.0, 2.5)])
def test_a_rod_is_found_from_a_pose_beside_it(mended, error):
    mender, pose = mended
    found = mender.correlate(2, 7, tuple(pose[7] + np.array(error)))
    assert found.found
    assert found.zncc > 0.95
    np.testing.assert_allclose([found.x, found.y], pose[7, :2], atol=0.1)
    assert np.cos(found.angle - pose[7, 2]) == pytest.approx(1.0, abs=1e-4)
    assert found.zncc_before <= found.zncc + ALIKE
    assert found.residual_before >= found.residual - 100.0 * ALIKE


def test_where_nothing_correlates_the_hand_is_taken_at_its_word(mended):
    mender, pose = mended
    given = (float(pose[7, 0] + 70.0), float(pose[7, 1] + 55.0), 2.0)
    found = mender.correlate(2, 7, given)
    assert not found.found
    assert (found.x, found.y, found.angle) == given


@pytest.mark.parametrize("clear", [1.0, 0.45])
def test_a_rod_that_is_half_covered_is_found_to_parts_of_a_pixel(made_photographs, mended, clear):
    mender, pose = mended
    photographs = load_experiment(made_photographs).photographs()
    shown = photographs[2].copy()
    rows, columns = np.ogrid[: shown.shape[0], : shown.shape[1]]
    x, y, radius = *pose[7, :2], mender.circles[7, 2]
    face = np.hypot(columns - x, rows - y) < radius
    shown[face] = clear * shown[face] + (1.0 - clear) * 150.0  # a veil, and a reflection in it
    shown[np.hypot(columns - x - 0.25 * radius, rows - y) < 0.55 * radius] = 245.0
    covered = Mender(mender.ids, mender.circles, lambda frame: shown if frame == 2 else photographs[frame])
    found = covered.correlate(2, 7, tuple(pose[7] + np.array([1.0, -1.0, 0.02])))
    assert found.found
    np.testing.assert_allclose([found.x, found.y], pose[7, :2], atol=0.1)
    assert found.zncc > 0.9


def test_an_unknown_rod_is_refused(mended):
    with pytest.raises(KeyError):
        mended[0].correlate(2, 999, (50.0, 50.0, 0.0))


def test_pictures_show_the_rod_turned_back_and_what_is_left_over(mended):
    mender, pose = mended
    right, wrong = tuple(pose[7]), tuple(pose[7] + np.array([6.0, 0.0, 0.5]))
    first, given, left_given, found, left = mender.pictures(2, 7, [wrong, right])
    middle = np.s_[22:66, 22:66]
    assert np.corrcoef(first[middle].ravel(), found[middle].ravel())[0, 1] > 0.95
    assert np.corrcoef(first[middle].ravel(), given[middle].ravel())[0, 1] < 0.5
    assert left[middle].std() < 0.3 * left_given[middle].std()


def test_a_rod_is_followed_until_its_track_is_right(mended):
    mender, pose = mended
    tracks = np.repeat(pose[None], 4, axis=0)
    tracks[0, :, :2], tracks[0, :, 2] = mender.circles[:, :2], 0.0
    all_right = Tracked(mender.ids, np.stack([true_pose(mender, tracks, k) for k in range(4)]))
    spoiled = Tracked(mender.ids, all_right.pose.copy())
    spoiled.pose[2, 7] = np.nan
    since = 1, mender.correlate(1, 7, tuple(all_right.pose[1, 7]))
    followed = follow_on(mender, spoiled, 7, since, lambda frame: False)
    assert list(followed.poses) == [2]
    np.testing.assert_allclose([followed.poses[2].x, followed.poses[2].y], pose[7, :2], atol=0.1)
    assert "photograph 3 on" in followed.ended
    assert follow_on(mender, spoiled, 7, since, lambda frame: frame == 2).poses == {}


def true_pose(mender, tracks, frame):
    """The poses (n, 3) of a photograph by correlation from those of photograph 2, which is the same within a rod."""
    if frame in (0, 2):
        return tracks[frame]
    found = [mender.correlate(frame, name, tuple(tracks[2, name])) for name in mender.ids.tolist()]
    return np.array([[each.x, each.y, each.angle] for each in found])


def test_a_rod_that_is_not_to_be_seen_is_a_correction_until_it_is_taken_back(visitor, photographs_only):
    at = visitor.ask("begin", roll=0, name="mine")["at"]
    visitor.ask("set_photographs", at=at, interval=30.0)
    visitor.ask("set_scale", at=at, pixel_size=2.5e-4)
    told = visitor.ask("mark_lost", at=at, frame=2, id=5)
    told = visitor.ask("mark_lost", at=at, frame=1, id=6)
    assert [(each["frame"], each["id"], each["x"]) for each in told["corrections"]] == [(1, 6, None), (2, 5, None)]
    read = read_corrections(load_experiment(photographs_only / "my photographs"), None, 4)
    assert read.frame.tolist() == [1, 2]
    assert np.isnan(read.x).all()
    told = visitor.ask("take_back", at=at, frame=2, id=5)
    assert len(told["corrections"]) == 1
    told = visitor.ask("undo", at=at)
    assert len(read_corrections(load_experiment(photographs_only / "my photographs"), None, 4).id) == 2
    assert "step Rods" in visitor.refused("mark_lost", at=at, frame=0, id=5)


def test_every_change_of_the_table_is_logged_with_what_was_before(visitor, photographs_only):
    at = visitor.ask("begin", roll=0, name="mine")["at"]
    visitor.ask("set_photographs", at=at, interval=30.0)
    visitor.ask("set_scale", at=at, pixel_size=2.5e-4)
    table = photographs_only / "my photographs" / "corrections.csv"
    visitor.ask("mark_lost", at=at, frame=2, id=5)
    table.write_text("frame,id,x,y,theta\n2,5,100.5,200.25,0.1\n")  # by another hand, which tells no log
    visitor.ask("mark_lost", at=at, frame=2, id=5)
    visitor.ask("undo", at=at)
    visitor.ask("redo", at=at)
    visitor.ask("take_back", at=at, frame=2, id=5)
    visitor.ask("set_photographs", at=at, interval=31.0)
    visitor.ask("undo", at=at)  # of something else
    told = visitor.ask("corrections_log", at=at)["changes"]
    pose = [100.5, 200.25, 0.1]
    assert [(each["how"], each["before"], each["after"]) for each in reversed(told)] == [
        ("hidden", None, "lost"), ("hidden", pose, "lost"), ("undone", "lost", pose), ("done again", pose, "lost"),
        ("taken back", "lost", None),
    ]  # fmt: skip
    assert {(each["frame"], each["id"]) for each in told} == {(2, 5)}
    log = photographs_only / "my photographs" / "corrections_log.jsonl"
    log.write_text(log.read_text() + '{"torn')
    assert visitor.ask("corrections_log", at=at)["changes"] == told
