"""Boundaries other than walls: grains with imposed motion, or the edges of a periodic cell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..process.errors import InputError
from ..solver.bodies.cell import Cell, unwrap
from ..solver.bodies.outer_grains import SIDES, FreeSurface, find_outer_grains
from ..solver.bodies.walls import Walls
from ..tracks import Tracks, WallTracks
from .coincident_rods import refuse_coincident_rods
from .config.input_sections import OUTER
from .experiment import Experiment, rows_of
from .reading.tables import Table, check_unique

# Rods are sought in the first photograph alone.
HIDDEN = "; if the first photograph hides rods there, as a hand before them does, begin with a later one: --frames 1:"
FACING_UP = 0.1  # a surface with a larger cosine to the direction opposite to gravity may be free
WIDEST = 2.0  # largest diameters: a cell must be higher, so that a pair touches in at most one of its images


def apply_boundary(experiment: Experiment, tracks: Tracks, walls: WallTracks | None) -> Tracks:
    """Return tracks with boundary grains marked, or with positions unwrapped across the edges of the cell.

    Raises
    ------
    InputError
        A boundary grain does not exist, or the cell is too small.
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
    """Raise InputError with the frame in which a pair could touch in two of its images, or is at one place."""
    assert walls.cell is not None
    needed = WIDEST * 2.0 * float(tracks.radius.max())
    for k, vectors in enumerate(walls.cell):
        height = float(Cell.at_rest(vectors).heights.min())
        if not height > needed:
            raise InputError(
                file, f"frame {k}", f"makes a cell {height:g} m high: it must be higher than two of the largest "
                f"diameters, {needed:g} m, in each direction; all in metres",
            )  # fmt: skip
    refuse_coincident_rods(file, tracks.id, tracks.radius, tracks.position, walls.cell)


def free_surfaces(experiment: Experiment, tracks: Tracks, walls: WallTracks) -> list[str]:
    """Describe every side and hole of the packing of frame 0 without a wall or boundary, in one sentence each.

    Where gravity acts, surfaces that face up may be free and are not reported.
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
    sentences = []
    for name, (x, y) in surface.sides(bare):
        more = HIDDEN if name == SIDES[-1] and experiment.config.photographs is not None else ""
        sentences.append(
            f"The packing has a free surface {name}, near x = {x:.3g} m, y = {y:.3g} m, with neither wall nor boundary "
            "there: if something holds these rods, give it by [walls], or impose their measured motion by "
            f'[boundary] grains = "outer"{more}'
        )
    return sentences


def _near_boundary(tracks: Tracks, surface: FreeSurface) -> NDArray[np.bool_]:
    """Return which points of a surface (s,) have a boundary grain nearby."""
    assert tracks.boundary is not None
    present = tracks.boundary & tracks.present[0]
    if not present.any() or not len(surface.place):
        return np.zeros(len(surface.place), np.bool_)
    distance, _ = KDTree(tracks.position[0, present]).query(surface.place)
    return np.asarray(distance) < WIDEST * float(tracks.radius.max())


def _surface(tracks: Tracks, walls: WallTracks | None) -> FreeSurface:
    bounds = Walls.at_rest(np.empty((0, 2, 2)))
    if walls is not None and not np.isnan(walls.endpoints[0]).any():
        bounds = walls.at_rest(0)
    return find_outer_grains(tracks.radius, tracks.position[0], tracks.present[0], bounds)


def find_boundary(file: Path | str, tracks: Tracks, walls: WallTracks | None) -> NDArray[np.bool_]:
    """Return the outermost grains (n,) of the first frame. Raises InputError where none or all grains are outermost."""
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
    """Return which grains (n,) a table id lists. Raises InputError where it lists unknown grains or all of them."""
    ids = table.integers("id")
    check_unique(table, "id", ids)
    mask = np.zeros(tracks.grain_count, np.bool_)
    mask[rows_of(table, "id", ids, tracks.id)] = True
    if mask.all():
        raise InputError(table.file, "", "names every grain: no grain remains whose forces could be computed")
    return mask
