"""Results for ParaView: VTK PolyData files (.vtp, XML, ASCII) of grains, contacts and walls for every frame.

packing.pvd is the animation of all of them with its times; grains.pvd and contacts.pvd are parts of it. The scalars of
a frame are field data of grains and contacts.

Format: The VTK User's Guide, "VTK File Formats". Lengths in metres, forces in newtons, stresses in pascals; z = 0, and
the largest radius for contacts.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from ..process.atomic import write_atomically
from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import STRAIGHT
from ..solver.contacts.contacts import Contacts
from ..solver.frame_forces import FrameForces
from ..solver.quantity import quantities
from ..solver.statistics.stress import contact_force_vectors, grain_stresses

UNKNOWN = -1.0  # probability that was not computed

CORNERS = 96  # of the polygon of a circle
TOPOLOGY = ("connectivity", "offsets")  # written without number of components

_TYPES = {"f": "Float64", "i": "Int64", "u": "Int64"}


def write_polydata(results: Results, folder: Path) -> list[Path]:
    """Write packing.pvd, grains.pvd, contacts.pvd and their parts; return the collections."""
    folder.mkdir(parents=True, exist_ok=True)
    names: dict[str, list[str]] = {"packing": [], "grains": [], "contacts": []}
    for frame in range(len(results.frames)):
        parts = {"grains": _grains(results, frame), "contacts": _contacts(results, frame)}
        if results.walls.count:
            parts["walls"] = _walls(results, frame)
        for kind, text in parts.items():
            write_atomically(folder / f"{kind}_{frame:04d}.vtp", text.encode())
            names.setdefault(kind, []).append(f"{kind}_{frame:04d}.vtp")
        write_atomically(folder / f"packing_{frame:04d}.vtm", blocks(parts, frame).encode())
        names["packing"].append(f"packing_{frame:04d}.vtm")
    names.pop("walls", None)
    files = []
    for kind, parts in names.items():
        write_atomically(folder / f"{kind}.pvd", _collection(parts, results.tracks.time).encode())
        files.append(folder / f"{kind}.pvd")
    return files


def _grains(results: Results, frame: int) -> str:
    tracks, forces = results.tracks, results.frames[frame]
    here = np.flatnonzero(tracks.present[frame])
    count = np.bincount(_bodies(forces.contacts, forces.fn > 0.0), minlength=tracks.grain_count)
    data = {
        "id": tracks.id[here],
        "radius": tracks.radius[here],
        "rotation": tracks.rotation[frame, here],
        "status": tracks.status[frame, here],
        "loaded_contacts": count[: tracks.grain_count][here],
        "stress": _stresses(results, frame)[here],
        **({} if tracks.boundary is None else {"boundary": tracks.boundary[here].astype(np.int64)}),
        **columns(forces, "grain", here),
    }
    vertices = np.arange(len(here))[:, None]
    return polydata(
        tracks.position[frame, here], "Verts", vertices, point_data=data, field_data=_numbers(results, frame)
    )


def _contacts(results: Results, frame: int) -> str:
    """Write lines from centre to centre, or from centre to wall contact point, in front of the spheres of rods.

    Forces are also point data, since ParaView scales tubes by point data.
    """
    forces, position = results.frames[frame], results.tracks.position[frame]
    contacts = forces.contacts
    far = contacts.point.copy()
    pair = ~contacts.with_wall
    far[pair] = contacts.second_centre(position)[pair]  # of the image that i touches
    points = np.concatenate([position[contacts.i], far])
    lines = np.column_stack([np.arange(contacts.count), np.arange(contacts.count) + contacts.count])
    ids = np.concatenate([results.tracks.id, -1 - np.arange(results.walls.count)])  # walls: −1, −2, …
    force = spatial(contact_force_vectors(contacts, forces.fn, forces.ft))
    data = {
        "i": ids[contacts.i],
        "j": ids[contacts.j],
        "gap": contacts.gap,
        **({} if np.isnan(force).any() else {"force": force}),
        **columns(forces, "contact", slice(None)),
    }
    ends = {name: np.tile(data[name], 2) for name in ("fn", "ft") if name in data}
    return polydata(
        points, "Lines", lines, point_data=ends, cell_data=data, field_data=_numbers(results, frame),
        height=float(results.tracks.radius.max()),
    )  # fmt: skip


def _walls(results: Results, frame: int) -> str:
    """Write walls as lines, circles as polygons, with the force that the packing exerts on them."""
    walls, ends = results.walls, results.walls.endpoints[frame]
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    lines = [ends[w] for w in range(walls.count)]
    for w in np.flatnonzero(walls.sides != STRAIGHT):
        centre, radius = ends[w].mean(axis=0), 0.5 * np.linalg.norm(ends[w, 1] - ends[w, 0])
        lines[w] = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate(lines)
    starts = np.cumsum([0, *map(len, lines)])
    pairs = [np.column_stack([np.arange(a, b - 1), np.arange(a + 1, b)]) for a, b in pairwise(starts)]
    owner = np.repeat(np.arange(walls.count), [len(each) for each in pairs])
    force = results.statistics[frame].wall_force[owner]
    data = {"wall": owner, **({} if np.isnan(force).any() else {"force": spatial(force)})}
    return polydata(points, "Lines", np.concatenate(pairs), cell_data=data)


def _stresses(results: Results, frame: int) -> Array:
    """Return the stress of every grain (n, 9) [Pa] as a tensor in space; zero without forces."""
    forces, length = results.frames[frame], tomllib.loads(results.configuration)["material"]["length"]
    found = np.nan_to_num(grain_stresses(forces.contacts, forces.fn, forces.ft, results.grains.radius, length))
    spatial = np.zeros((len(found), 3, 3))
    spatial[:, :2, :2] = found
    return spatial.reshape(-1, 9)


def columns(forces: FrameForces, dimension: str, rows: np.ndarray | slice) -> dict[str, np.ndarray]:
    """Return the quantities of a frame with one number per contact or grain, on some of their rows."""
    found = {}
    for each in quantities(type(forces)):
        if each.quantity.dims != dimension or getattr(forces, each.name) is None:
            continue
        values = getattr(forces, each.name)[rows]
        if each.name == "probability":
            values = np.nan_to_num(values, nan=UNKNOWN)
        if not np.isnan(values).any():  # readers of ASCII files reject NaN
            found[each.name] = values
    return found


def _numbers(results: Results, frame: int) -> dict[str, np.ndarray]:
    """Return the known scalars of a frame."""
    found = {}
    for record in (results.frames[frame], results.statistics[frame]):
        for each in quantities(type(record)):
            value = np.asarray(getattr(record, each.name))
            if not each.quantity.dims and each.dtype.kind != "O" and np.isfinite(value):
                found[each.name] = value.reshape(1)
    return found


def _bodies(contacts: Contacts, kept: np.ndarray) -> np.ndarray:
    return np.concatenate([contacts.i[kept], contacts.j[kept]])


def polydata(
    points: Array,
    kind: str,
    cells: np.ndarray,
    *,
    point_data: Mapping[str, np.ndarray] | None = None,
    cell_data: Mapping[str, np.ndarray] | None = None,
    field_data: Mapping[str, np.ndarray] | None = None,
    height: float = 0.0,
) -> str:
    """Write one piece of PolyData.

    Parameters
    ----------
    points : ndarray
        (p, 2) [m].
    kind : {'Verts', 'Lines'}
    cells : ndarray of int
        (k, s) point numbers.
    point_data, cell_data : mapping of str to ndarray, optional
    field_data : mapping of str to ndarray, optional
        Scalars of the whole piece.
    height : float
        z of the points [m].
    """
    offsets = (np.arange(len(cells)) + 1) * cells.shape[1]
    coordinates = np.add(spatial(points), [0.0, 0.0, height])
    count = {name: len(cells) if name == kind else 0 for name in ("Verts", "Lines")}
    parts = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">',
        "<PolyData>",
        *_data("FieldData", field_data),
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="{count["Verts"]}" NumberOfLines="{count["Lines"]}" '
        'NumberOfStrips="0" NumberOfPolys="0">',
        "<Points>", _array("points", coordinates), "</Points>",
        f"<{kind}>", _array("connectivity", cells), _array("offsets", offsets), f"</{kind}>",
        *_data("PointData", point_data), *_data("CellData", cell_data),
        "</Piece>", "</PolyData>", "</VTKFile>", "",
    ]  # fmt: skip
    return "\n".join(parts)


def _data(tag: str, data: Mapping[str, np.ndarray] | None) -> list[str]:
    return [] if not data else [f"<{tag}>", *(_array(name, values) for name, values in data.items()), f"</{tag}>"]


def _array(name: str, values: np.ndarray) -> str:
    """Write an array with all digits of floats."""
    values = np.asarray(values)
    kind = _TYPES[values.dtype.kind]
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 and name not in TOPOLOGY else ""
    count = f' NumberOfTuples="{len(values)}"' if values.ndim == 1 else ""  # required for field data
    text = " ".join(map(repr, values.astype(float if kind == "Float64" else int).ravel().tolist()))
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{width}{count} format="ascii">{text}</DataArray>'


def spatial(vectors: Array) -> Array:
    """Extend vectors in the plane (k, 2) to space (k, 3)."""
    return np.column_stack([vectors, np.zeros(len(vectors))])


def blocks(parts: Iterable[str], frame: int) -> str:
    """Write a multi-block file of several parts, PART_FRAME.vtp."""
    rows = [f'<DataSet index="{k}" name="{kind}" file="{kind}_{frame:04d}.vtp"/>' for k, kind in enumerate(parts)]
    head = '<?xml version="1.0"?>\n<VTKFile type="vtkMultiBlockDataSet" version="1.0" byte_order="LittleEndian">'
    return "\n".join([head, "<vtkMultiBlockDataSet>", *rows, "</vtkMultiBlockDataSet>", "</VTKFile>", ""])


def _collection(names: list[str], time: Array) -> str:
    rows = [
        f'<DataSet timestep="{second!r}" part="0" file={quoteattr(name)}/>'
        for second, name in zip(time.tolist(), names, strict=True)
    ]
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">\n<Collection>'
    return "\n".join([head, *rows, "</Collection>", "</VTKFile>", ""])
