"""Poses are proposed from neighbours and the last good photograph; a correction is judged, and tracked at once."""

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.tables import read_table
from rodsight.workbench.correcting.pose_editor import PoseEditor, PoseFit
from rodsight.workbench.correcting.proposals import TrackedPoses, overlap, predict_pose, warnings_of, with_corrections
from rodsight.workbench.service.workbench import Workbench

from tests.app.workbench.conftest import Visitor
from tests.app.workbench.spoiled_tracks import GONE, ROD, WRONG, true_poses

RIGHT = 0.15  # [px] of a place
AT = "mine"


@pytest.fixture
def desk(spoiled):
    return Visitor(Workbench(spoiled)).enter()


@pytest.fixture
def truth(spoiled):
    return true_poses(spoiled)


@pytest.mark.parametrize("frame", [WRONG, GONE])
def test_a_rod_is_proposed_where_its_neighbours_have_gone(desk, truth, frame):
    proposed = desk.request("propose_pose", at=AT, frame=frame, id=ROD)
    np.testing.assert_allclose(proposed["pose"][:2], truth[frame, ROD, :2], atol=RIGHT)
    assert np.cos(proposed["pose"][2] + truth[frame, ROD, 2]) == pytest.approx(1.0, abs=1e-4)
    assert proposed["since"] == 1  # wrong in photograph 2, lost in 3


def test_a_pose_on_another_rod_is_no_fit_and_is_warned_of(desk, truth):
    other = int(np.hypot(*(truth[WRONG, :, :2] - truth[WRONG, ROD, :2]).T).argsort()[1])
    x, y = truth[WRONG, other, :2]
    found = desk.request("correlate", at=AT, frame=WRONG, id=ROD, x=x, y=y, angle=0.3)
    assert not found["found"]
    assert (found["x"], found["y"]) == (x, y)
    stated = " ".join(found["warnings"])
    for part in (f"on rod {other}", "Nothing correlates", "Against its neighbours it has moved"):
        assert part in stated
    right = desk.request(
        "correlate", at=AT, frame=WRONG, id=ROD, x=truth[WRONG, ROD, 0], y=truth[WRONG, ROD, 1], angle=0.0
    )
    assert right["found"]
    assert right["warnings"] == []


def test_a_correction_is_tracked_at_once_and_costs_no_neighbour(desk, truth):
    x, y, theta = truth[WRONG, ROD]
    desk.request("correct_pose", at=AT, frame=WRONG, id=ROD, x=x + 1.0, y=y - 1.0, angle=-theta)
    again = desk.request("tracked_again", at=AT, frame=WRONG, id=ROD)
    assert again["changes"][0]["id"] == ROD
    assert again["changes"][0]["status"] == ["suspect", "ok"]
    assert len(again["changes"]) > 2  # its neighbours
    assert {tuple(each["status"]) for each in again["changes"][1:]} == {("ok", "ok")}
    n = again["rods"]["id"].index(ROD)
    np.testing.assert_allclose([again["rods"]["x"][n], again["rods"]["y"][n]], [x, y], atol=RIGHT)


def test_a_wrong_correction_costs_its_rod_at_most(desk, truth):
    other = int(np.hypot(*(truth[WRONG, :, :2] - truth[WRONG, ROD, :2]).T).argsort()[1])
    x, y = truth[WRONG, other, :2]
    desk.request("correct_pose", at=AT, frame=WRONG, id=ROD, x=x, y=y, angle=0.3)
    again = desk.request("tracked_again", at=AT, frame=WRONG, id=ROD)
    assert again["lost_after"] == again["lost_before"] == 0
    assert again["changes"][0]["status"][1] == "given"
    assert {tuple(each["status"]) for each in again["changes"][1:]} == {("ok", "ok")}


@pytest.mark.parametrize("turned", [0.0, 2.0])
def test_dirt_on_the_first_photograph_is_no_obstacle_at_any_angle(made_photographs, spoiled, truth, turned):
    photographs = load_experiment(made_photographs).photographs()
    table = read_table(made_photographs / "grains.csv", ("id", "x", "y", "radius"))
    circles = np.stack([table.numbers(name) for name in ("x", "y", "radius")], axis=1)
    dirty = photographs[0].copy()
    rows, columns = np.ogrid[: dirty.shape[0], : dirty.shape[1]]
    x, y, radius = circles[ROD]
    dirty[(np.hypot(columns - x, rows - y) < radius) & (columns > x + 0.1 * radius)] = 60.0
    editor = PoseEditor(table.integers("id"), circles, lambda frame: photographs[frame] if frame else dirty)
    x, y, theta = truth[WRONG, ROD]
    found = editor.correlate(WRONG, ROD, (x + 1.4, y, -theta + turned))
    assert found.found
    np.testing.assert_allclose([found.x, found.y], [x, y], atol=RIGHT)
    assert np.cos(found.angle + theta) == pytest.approx(1.0, abs=1e-3)


def grid() -> TrackedPoses:
    """Nine rods, 20 px apart, in three photographs: all move by 3 px to the right, rod 4 is lost in the last ones."""
    x, y = np.meshgrid([0.0, 20.0, 40.0], [0.0, 20.0, 40.0])
    first = np.stack([x.ravel(), y.ravel(), np.zeros(9)], axis=1)
    pose = np.stack([first + np.array([3.0 * k, 0.0, 0.0]) for k in range(3)])
    good = np.ones((3, 9), np.bool_)
    good[1:, 4] = False
    return TrackedPoses(np.arange(9), pose, np.full(9, 10.0), np.full((3, 9), 0.98), good)


def fit_at(x: float, y: float, zncc: float = 0.97) -> PoseFit:
    return PoseFit(x, y, 0.0, zncc, 1.0, 0.1, 9.0, 0.02, True)


def test_a_rod_moves_with_its_neighbours_since_its_last_good_photograph():
    predicted = predict_pose(grid(), 4, 2)
    assert predicted is not None
    assert predicted.pose == pytest.approx((26.0, 20.0, 0.0))
    assert predicted.since == 0
    assert predict_pose(grid(), 4, 0) is None
    corrected = with_corrections(grid(), [(1, 4, (25.0, 20.0, None)), (2, 5, None), (7, 4, None), (1, 99, None)])
    predicted = predict_pose(corrected, 4, 2)
    assert predicted is not None
    assert (predicted.since, predicted.pose[0]) == (1, pytest.approx(28.0))
    assert not corrected.good[2, 5]


@pytest.mark.parametrize(
    ("found", "stated"),
    [
        (fit_at(26.2, 20.0), []), (fit_at(26.0, 20.0, 0.7), ["correlates by 0.70, the other rods here by 0.98"]),
        (fit_at(40.0, 20.0), ["on rod 5", "moved by 14 px since photograph 3"]),
    ],
)  # fmt: skip
def test_what_makes_a_pose_improbable_is_stated(found, stated):
    warnings = warnings_of(grid(), 4, 2, found, first=3)
    assert len(warnings) == len(stated)
    for part, warning in zip(stated, warnings, strict=True):
        assert part in warning


def test_overlap_is_measured_by_the_smaller_radius():
    assert overlap((0.0, 0.0, 10.0), np.array([[19.0, 0.0, 10.0], [0.0, 12.0, 5.0]])) == (1, pytest.approx(0.6))
    assert overlap((0.0, 0.0, 10.0), np.empty((0, 3))) == (-1, 0.0)
