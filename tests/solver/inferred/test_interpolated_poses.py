"""Grains that a photograph lacks stand where their gaps are those of the photographs beside it."""

import numpy as np
import pytest
from rodsight.solver.bodies.rods import RodMaterial
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.inferred.interpolated_poses import interpolate_poses, settle_poses

RADIUS, SIGMA = 0.008, 1e-6
TIME = np.array([0.0, 1.0, 2.0])
FLOOR = np.array([[[-1.0, -RADIUS], [1.0, -RADIUS]]])
SIDE = 6
ROD = SIDE * 2 + 2  # inside
LOW = 2  # on the floor


def rolling_rows():
    """Positions (3, n, 2) of rows that roll to and fro over one another, all in contact, on a floor."""
    frames = []
    for angle in np.deg2rad([60.0, 63.0, 67.0]):
        step = 2.0 * RADIUS * np.array([np.cos(angle), np.sin(angle)])
        x, y = (each.ravel() for each in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
        frames.append(np.column_stack([2.0 * RADIUS * x + (y % 2) * step[0], y * step[1]]))
    return np.array(frames)


def settled(row, radius=RADIUS, walls=FLOOR):
    true = rolling_rows()
    position = true.copy()
    position[1, row] = np.nan
    poses = interpolate_poses(TIME, position, 1, np.array([row]))
    grains = RodMaterial().pack(np.full(len(true[0]), radius), np.empty(0)).grains
    found = settle_poses(poses, grains, position, SIGMA, lambda k: Walls.at_rest(walls))
    return poses.place[0] - true[1, row], found[0] - true[1, row]


@pytest.mark.parametrize("row", [ROD, LOW])
def test_contacts_keep_a_grain_where_it_touches(row):
    before, after = settled(row)
    assert np.linalg.norm(after) < 0.1 * np.linalg.norm(before)


def test_errors_of_radii_hardly_move_it():
    before, _ = settled(ROD)
    _, after = settled(ROD, radius=0.999 * RADIUS)
    assert np.linalg.norm(after) < 0.1 * np.linalg.norm(before)


def test_a_wall_holds_a_grain_that_nothing_else_touches():
    position = np.zeros((3, 12, 2))
    position[:, :, 0] = 0.05 * np.arange(12)
    position[:, 5, 1] = [0.0, 3e-4, 0.0]  # its place by the neighbours' motion is wrong
    position[1, [1, 2, 3, 4, 6, 7, 8, 9], 1] = 4e-4
    position[1, 5] = np.nan
    poses = interpolate_poses(TIME, position, 1, np.array([5]))
    grains = RodMaterial().pack(np.full(12, RADIUS), np.empty(0)).grains
    assert poses.place[0, 1] > 3e-4
    sd = np.full(1, 1e-4)
    loose = type(poses)(1, poses.row, poses.before, poses.after, poses.fraction, poses.place, sd)
    found = settle_poses(loose, grains, position, SIGMA, lambda k: Walls.at_rest(FLOOR))
    assert abs(found[0, 1]) < 1e-6
