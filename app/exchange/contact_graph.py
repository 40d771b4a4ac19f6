"""The contacts of a frame as a graph: GraphML files for networkx, Gephi, igraph and yEd, or a networkx.Graph.

Nodes are grains, named by their ids, and walls; edges are contacts with their forces. Unknown numbers are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ..process.atomic import write_atomically
from ..process.errors import InputError
from ..results.results import Results
from ..solver.quantity import quantities

HEAD = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<graphml xmlns="http://graphml.graphdrawing.org/xmlns">\n'
    "<!-- Lengths in metres, forces in newtons. -->"
)
KINDS = {bool: "boolean", int: "long", float: "double", str: "string"}
UNITS = {"x": "m", "y": "m", "radius": "m"}

Row = Mapping[str, bool | int | float | str]


def make_graph(results: Results, frame: int) -> Any:
    """Build the contact graph of one frame.

    Parameters
    ----------
    results : Results
    frame : int

    Returns
    -------
    networkx.Graph
        The units of its attributes are in graph["units"].

    Raises
    ------
    InputError
        If networkx is not installed.
    """
    try:
        import networkx  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError("networkx", "", "is not installed: pip install 'rodsight[graph]'") from None
    graph: Any = networkx.Graph(name=results.name, frame=frame, time=float(results.tracks.time[frame]))
    graph.graph["units"] = units_of_graph(results, frame)
    graph.add_nodes_from(nodes(results, frame))
    graph.add_edges_from(edges(results, frame))
    return graph


def write_graphs(results: Results, folder: Path) -> list[Path]:
    """Write a GraphML file for every frame; return the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for frame in range(len(results.frames)):
        file = folder / f"contacts_{frame:04d}.graphml"
        write_atomically(file, _graphml(results, frame).encode())
        files.append(file)
    return files


def nodes(results: Results, frame: int) -> Iterator[tuple[str, Row]]:
    """Yield names of grains and walls with their attributes in a frame; a lost grain has no position."""
    tracks, walls = results.tracks, results.walls
    for k, name in enumerate(tracks.id.tolist()):
        x, y = tracks.position[frame, k].tolist()
        yield str(name), _known({"kind": "grain", "radius": float(tracks.radius[k]), "x": x, "y": y})
    for w, name in enumerate(walls.name):
        x, y = walls.endpoints[frame, w].mean(axis=0).tolist()
        yield name, _known({"kind": "wall", "x": x, "y": y})


def edges(results: Results, frame: int) -> Iterator[tuple[str, str, Row]]:
    """Yield the contacts of a frame: names of both bodies and attributes."""
    forces = results.frames[frame]
    names = [*map(str, results.tracks.id.tolist()), *results.walls.name]
    columns = _contact_columns(results, frame)
    for c, (i, j) in enumerate(zip(forces.contacts.i.tolist(), forces.contacts.j.tolist(), strict=True)):
        yield names[i], names[j], _known({name: values[c] for name, values in columns.items()})


def units_of_graph(results: Results, frame: int) -> dict[str, str]:
    """Return the units of the attributes of nodes and edges."""
    units = dict(UNITS)
    for record in (results.frames[frame].contacts, results.frames[frame]):
        units |= {each.name: each.quantity.unit for each in quantities(type(record)) if each.quantity.unit}
    return {name: unit for name, unit in units.items() if name in UNITS or name in _contact_columns(results, frame)}


def _contact_columns(results: Results, frame: int) -> dict[str, list[Any]]:
    """Return the attributes with one value per contact, enumerations by name."""
    columns = {}
    forces = results.frames[frame]
    for record in (forces.contacts, forces):
        for each in quantities(type(record)):
            values = getattr(record, each.name)
            if each.quantity.dims != "contact" or values is None or each.name in ("i", "j"):
                continue
            columns[each.name] = values.tolist()
            if each.quantity.names is not None:
                names = {member.value: member.name.lower() for member in each.quantity.names}
                columns[each.name] = [names[value] for value in columns[each.name]]
    return columns


def _known(row: dict[str, Any]) -> Row:
    return {name: value for name, value in row.items() if not (isinstance(value, float) and not np.isfinite(value))}


def _graphml(results: Results, frame: int) -> str:
    """Write a frame as GraphML: keys, then nodes and edges with their values."""
    node_rows = [("node", name, data) for name, data in nodes(results, frame)]
    edge_rows = list(edges(results, frame))
    kinds: dict[tuple[str, str], str] = {}
    for of, data in [("node", data) for _, _, data in node_rows] + [("edge", data) for _, _, data in edge_rows]:
        kinds |= {(of, key): KINDS[type(value)] for key, value in data.items()}
    units = units_of_graph(results, frame)
    keys = [
        f'<key id="{of}_{name}" for="{of}" attr.name={quoteattr(name)} attr.type="{kind}">'
        + (f"<desc>{escape(units[name])}</desc>" if name in units else "") + "</key>"
        for (of, name), kind in kinds.items()
    ]  # fmt: skip
    rows = [f"<node id={quoteattr(name)}>{_data('node', data)}</node>" for _, name, data in node_rows]
    rows += [
        f"<edge source={quoteattr(i)} target={quoteattr(j)}>{_data('edge', data)}</edge>" for i, j, data in edge_rows
    ]
    return "\n".join([HEAD, *keys, '<graph edgedefault="undirected">', *rows, "</graph>", "</graphml>", ""])


def _data(of: str, row: Row) -> str:
    return "".join(f'<data key="{of}_{name}">{_text(value)}</data>' for name, value in row.items())


def _text(value: bool | int | float | str) -> str:
    return str(value).lower() if isinstance(value, bool) else escape(str(value))
