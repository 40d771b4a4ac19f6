"""What bounds the packing where it is no wall: grains that are the boundary, or the edges of a periodic cell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.cell import Cell, unwrap
from solver.bodies.outer import FreeSurface, find_outer
from solver.bodies.walls import Walls

from ..errors import InputError
from ..tracks import Tracks, WallTracks
from .config.input_sections import OUTER
from .experiment import Experiment, rows_of
from .reading.tables import Table, check_unique

SIDES = ("at the top", "at the bottom", "at the right", "at the left")
FACING_UP = 0.1  # cosine to gravity's opposite from which on a surface counts as one that weight keeps
FEWEST_BARE = 4  # places between grains: fewer are a missing rod beside a wall
WIDEST = 2.0  # largest diameters: a cell must be higher, so that a pair touches in one of its images at most


def bound_tracks(experiment: Experiment, tracks: Tracks, walls: WallTracks | None) -> Tracks:
    """The tracks with their boundary: its grains marked, or positions followed across the edges of the cell.

    Raises InputError for grains that are not there, and for a cell that is too small.
    """
    section = experiment.config.boundary
    if section is None:
        return tracks
    if walls is not None and walls.cell is not None:
        assert section.periodic is not None
        check_cell(experiment.folder / section.periodic, tracks, walls)
        return replace(tracks, position=unwrap(tracks.position, walls.cell))
    if section.found:
        return replace(tracks, boundary=find_boundary(experiment.file, tracks, walls))
    return replace(tracks, boundary=_read_boundary(experiment, tracks))


def check_cell(file: Path | str, tracks: Tracks, walls: WallTracks) -> None:
    """A pair must not touch in two of its images. Raises InputError naming the frame."""
    assert walls.cell is not None
    needed = WIDEST * 2.0 * float(tracks.radius.max())
    for k, vectors in enumerate(walls.cell):
        height = float(Cell.at_rest(vectors).heights.min())
        if not height > needed:
            raise InputError(
                file, f"frame {k}", f"makes a cell {height:g} m high: it must be higher than two of the largest "
                f"diameters, {needed:g} m, in each direction; all in metres",
            )  # fmt: skip


def free_surfaces(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> list[str]:
    """A sentence for every side, and for holes, where rods of frame 0 end at nothing that would hold them.

    Where gravity acts, surfaces that face up are free by right.
    """
    if walls.cell is not None:
        return []
    surface = _surface(tracks, walls)
    up = -np.array(experiment.config.material.gravity)
    bare = np.ones(len(surface.place), np.bool_)
    if np.any(up):
        bare = surface.outward @ (up / np.linalg.norm(up)) < FACING_UP
    if tracks.boundary is not None:
        bare &= ~_near_boundary(tracks, surface)
    side = np.argmax(surface.outward @ np.array([[0.0, 0.0, 1.0, -1.0], [1.0, -1.0, 0.0, 0.0]]), axis=1)
    where = np.where(surface.inner, len(SIDES), side)
    sentences = []
    for k, name in enumerate((*SIDES, "around a hole inside")):
        here = bare & (where == k)
        if np.count_nonzero(here) < FEWEST_BARE:
            continue
        x, y = surface.place[here].mean(axis=0)
        sentences.append(
            f"The packing has a free surface {name}, near x = {x:.3g} m, y = {y:.3g} m, with neither wall nor boundary "
            "there: if something holds these rods, tell it by [walls], or have them move as they were seen by "
            '[boundary] grains = "outer"'
        )
    return sentences


def _near_boundary(tracks: Tracks, surface: FreeSurface) -> NDArray[np.bool_]:
    """At which places of a surface (s,) a boundary grain is."""
    assert tracks.boundary is not None
    there = tracks.boundary & tracks.present[0]
    if not there.any() or not len(surface.place):
        return np.zeros(len(surface.place), np.bool_)
    distance, _ = KDTree(tracks.position[0, there]).query(surface.place)
    return np.asarray(distance) < WIDEST * float(tracks.radius.max())


def _surface(tracks: Tracks, walls: WallTracks | None) -> FreeSurface:
    bounds = Walls.at_rest(np.empty((0, 2, 2)))
    if walls is not None and not np.isnan(walls.endpoints[0]).any():
        bounds = Walls.at_rest(walls.endpoints[0], side=walls.side)
    return find_outer(tracks.radius, tracks.position[0], tracks.present[0], bounds)


def find_boundary(file: Path | str, tracks: Tracks, walls: WallTracks | None) -> NDArray[np.bool_]:
    """The outermost grains (n,) of the first frame. Raises InputError if that is none or all of them."""
    outer = _surface(tracks, walls).outer
    if not outer.any() or outer[tracks.present[0]].all():
        found = "every grain" if outer.any() else "no grain: walls enclose the packing"
        problem = f"finds {found} outermost on the first frame; name the grains in a table id"
        raise InputError(file, f'key boundary.grains = "{OUTER}"', problem)
    return outer


def _read_boundary(experiment: Experiment, tracks: Tracks) -> NDArray[np.bool_]:
    section = experiment.config.boundary
    assert section is not None
    assert section.grains is not None
    return boundary_of(experiment.table(section.grains, ("id",)), tracks)


def boundary_of(table: Table, tracks: Tracks) -> NDArray[np.bool_]:
    """Which grains (n,) a table id names."""
    ids = table.integers("id")
    check_unique(table, "id", ids)
    mask = np.zeros(tracks.grain_count, np.bool_)
    mask[rows_of(table, "id", ids, tracks.id)] = True
    if mask.all():
        raise InputError(table.file, "", "names every grain: none is left that forces would be sought on")
    return mask
