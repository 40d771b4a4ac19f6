"""The page app/docs/schema.md with the datasets of results.h5; `python -m rodsight.results.schema_page` writes it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

from ..process.atomic import write_atomically
from .schema import ATTRIBUTES, DIMENSIONS, SCHEMA_VERSION, Dimension, Entry, entries

PAGE = Path(__file__).parent.parent / "docs" / "schema.md"
FIRST_LINE = "<!-- Generated: run `python -m rodsight.results.schema_page` to write it anew. -->"


def schema_page() -> str:
    """Return the page as Markdown."""
    groups = groupby(sorted(entries(), key=_group), key=_group)
    parts = [
        FIRST_LINE,
        f"# results.h5, schema {SCHEMA_VERSION}",
        "SI units throughout; y points up. Files of earlier schemas open as well: missing datasets are absent. A file\n"
        "needs the datasets in bold. `tracks.h5` holds `tracks/`, `walls/`, `grains/id`, `grains/radius` and\n"
        "`frames/time` only.",
        "## Dimensions",
        "Each is an HDF5 dimension scale at the root of the file: `xarray.open_datatree(file)` reads names and labels.",
        _table(("dimension", "labels", "rows"), ((f"`{name}`", _labels(name, each), each.meaning)
                                                 for name, each in DIMENSIONS.items())),
        *(part for group, members in groups for part in (f"## {group}/", _datasets(members))),
        "## Attributes",
        _table(
            ("attribute", "of", "type", "meaning", "since"),
            (
                (f"`{each.name}`", ", ".join(f"`{path}`" for path in each.of) or "the file", each.kind, each.meaning,
                 str(each.since))
                for each in ATTRIBUTES
            ),
        ),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _group(entry: Entry) -> str:
    return entry.path.split("/")[0]


def _labels(name: str, dimension: Dimension) -> str:
    if name == "frame":
        return "0, 1, …"
    if dimension.labels is None:
        return f"`{dimension.labelled_by}`" if dimension.labelled_by else ""
    if isinstance(dimension.labels, tuple):
        return ", ".join(dimension.labels)
    return f"{dimension.labels[0]:g}, {dimension.labels[1]:g}, … {dimension.labels[-1]:g}"


def _datasets(members: Iterable[Entry]) -> str:
    rows = (
        (
            f"**`{each.path}`**" if each.quantity.essential else f"`{each.path}`",
            ", ".join(each.dims),
            _type(each),
            each.quantity.unit,
            each.quantity.meaning + (f" (earlier: `{each.quantity.formerly}`)" if each.quantity.formerly else ""),
            str(each.quantity.since),
        )
        for each in members
    )
    return _table(("dataset", "dimensions", "type", "unit", "meaning", "since"), rows)


def _type(entry: Entry) -> str:
    if entry.quantity.names is not None:
        return "enumeration: " + ", ".join(member.name.lower() for member in entry.quantity.names)
    return "text" if entry.dtype.kind == "O" else str(entry.dtype)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


if __name__ == "__main__":
    write_atomically(PAGE, schema_page().encode())
