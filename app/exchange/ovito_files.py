"""Results for OVITO: a multi-block VTK file (.vtm) per frame, grains as particles and contacts as bonds between them.

OVITO requires the two particles id1 and id2 of every bond: a contact with a wall gets a very small particle with
`wall_contact` 1. The lines of contacts lie in front of the spheres of the rods, higher by the largest radius. Lengths
in metres, forces in newtons.

Format: the reader of contact networks in OVITO's user manual, "ParaView VTM".
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..process.atomic import write_atomically
from ..results.results import Results
from ..solver.contacts.contacts import Contacts
from ..solver.frame_forces import FrameForces
from ..solver.statistics.stress import contact_force_vectors
from .vtk_polydata import blocks, columns, polydata, spatial

POINT_SIZE = 1e-3  # [mean radius], of a particle on a wall


def write_ovito(results: Results, folder: Path) -> list[Path]:
    """Write frame_NNNN.vtm and its parts for every frame; return the .vtm files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for frame in range(len(results.frames)):
        parts = {"particles": _particles(results, frame), "contacts": _contacts(results, frame)}
        for kind, text in parts.items():
            write_atomically(folder / f"{kind}_{frame:04d}.vtp", text.encode())
        files.append(folder / f"frame_{frame:04d}.vtm")
        write_atomically(files[-1], blocks(parts, frame).encode())
    return files


def _particles(results: Results, frame: int) -> str:
    """Write the grains that have a position, and the points on walls."""
    tracks, forces = results.tracks, results.frames[frame]
    here = _shown(results, frame)
    points = forces.contacts.point[forces.contacts.with_wall]
    known = columns(forces, "grain", here)
    size = np.full(len(points), POINT_SIZE * tracks.radius.mean())
    data = {
        "id": np.concatenate([tracks.id[here], _point_ids(results, forces.contacts)]),
        "radius": np.concatenate([tracks.radius[here], size]),
        "wall_contact": np.repeat([0, 1], [len(here), len(points)]),
        **{name: np.concatenate([values, np.zeros(len(points), values.dtype)]) for name, values in known.items()},
    }
    centres = np.concatenate([tracks.position[frame, here], points])
    return polydata(centres, "Verts", np.arange(len(centres))[:, None], point_data=data)


def _contacts(results: Results, frame: int) -> str:
    """Write lines between particles, with the attributes of the contacts."""
    forces, tracks = results.frames[frame], results.tracks
    rows = _between_shown(results, frame)
    contacts = forces.contacts.select(rows)
    fn, ft = forces.fn[rows], forces.ft[rows]
    second = tracks.id[np.where(contacts.with_wall, 0, contacts.j)]
    second[contacts.with_wall] = _point_ids(results, forces.contacts)[rows[forces.contacts.with_wall]]
    far = np.where(contacts.with_wall[:, None], contacts.point, contacts.second_centre(tracks.position[frame]))
    points = np.stack([tracks.position[frame][contacts.i], far], axis=1).reshape(-1, 2)  # both ends, line after line
    lines = np.arange(2 * contacts.count).reshape(-1, 2)
    data = {
        "id1": tracks.id[contacts.i],
        "id2": second,
        **({} if np.isnan(fn).any() else {"contact_force": spatial(contact_force_vectors(contacts, fn, ft))}),
        "gap": contacts.gap,
        **columns(forces, "contact", rows),
    }
    return polydata(points, "Lines", lines, cell_data=data, height=float(tracks.radius.max()))


def _shown(results: Results, frame: int) -> np.ndarray:
    return np.flatnonzero(results.tracks.present[frame])


def _between_shown(results: Results, frame: int) -> np.ndarray:
    """Return a mask (c,) of contacts whose grains have a position."""
    forces: FrameForces = results.frames[frame]
    present = np.append(results.tracks.present[frame], np.ones(results.walls.count, np.bool_))
    return present[forces.contacts.i] & present[forces.contacts.j]


def _point_ids(results: Results, contacts: Contacts) -> np.ndarray:
    """Return ids for the points on walls, above those of grains."""
    first = int(results.tracks.id.max()) + 1
    return first + np.arange(int(contacts.with_wall.sum()))
