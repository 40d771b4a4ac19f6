"""The tests' runs see a field whose shape is not the one stated."""

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import LastSeen, Snapshot
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.nlgs.problem import ContactProblem
from rodsight.solver.nlgs.sweep_record import SweepHistory
from rodsight.solver.statistics.frame_statistics import FrameStatistics

from tests.shapes import ShapeError, check_shapes_of


def contacts(**changed):
    fields = {
        "i": np.zeros(3, np.int32),
        "j": np.ones(3, np.int32),
        "gap": np.zeros(3),
        "normal": np.zeros((3, 2)),
        "point": np.zeros((3, 2)),
    }
    return Contacts(**{**fields, **changed}, grain_count=2, wall_count=0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"normal": np.zeros((3, 3))},  # not the two components
        {"gap": np.zeros(4)},  # not the number that the others have
        {"i": np.zeros(3, np.int64)},  # not the kind
        {"point": np.zeros((3, 2), int)},
    ],
)
def test_a_field_of_another_shape_is_seen(wrong):
    contacts()
    with pytest.raises(ShapeError, match=next(iter(wrong))):
        contacts(**wrong)


def test_a_scalar_where_an_array_belongs_is_seen():
    with pytest.raises(ShapeError, match="rotation"):
        LastSeen(np.zeros(2), np.zeros((2, 2)), 0.0)


def test_named_tuples_are_checked_too():
    def problem(wall):
        return ContactProblem(
            np.zeros((3, 4)), np.zeros((1, 2)), np.zeros((1, 2, 32), np.int32), np.zeros((1, 5, 32)), 0,
            np.zeros((2, 2), np.int32), wall, np.zeros(2), np.zeros((3, 3)), np.zeros(4, np.int64),
        )  # fmt: skip

    problem(np.zeros((2, 8)))
    with pytest.raises(ShapeError, match=r"ContactProblem\.wall"):
        problem(np.zeros((3, 6)))


def test_dimensions_of_quantities_are_shapes_too():
    none = {"recorded": np.zeros(2, np.int64), "fn": np.zeros((2, 5), np.float32), "ft": np.zeros((2, 5), np.float32)}
    SweepHistory(np.zeros(9), np.zeros(9), np.zeros(9), **none)
    with pytest.raises(ShapeError, match=r"SweepHistory\.natural_map"):
        SweepHistory(np.zeros(9), np.zeros(8), np.zeros(9), **none)
    with pytest.raises(ShapeError, match=r"SweepHistory\.ft"):
        SweepHistory(np.zeros(9), np.zeros(9), np.zeros(9), **{**none, "ft": np.zeros((2, 4), np.float32)})


def test_the_refusal_of_a_type_itself_comes_first():
    with pytest.raises(ValueError, match="equal length"):
        Grains(np.ones(2), np.ones(3))


def test_types_without_stated_shapes_are_left_alone():
    class Plain:
        number: int

    assert not check_shapes_of(Plain)


def test_the_types_of_the_solver_are_checked_in_every_run():
    for kind in (Grains, Snapshot, LastSeen, Contacts, FrameForces, FrameStatistics, SweepHistory):
        assert hasattr(kind.__init__, "__wrapped__")
