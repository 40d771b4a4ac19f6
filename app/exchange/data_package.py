"""Description of a folder of tables: a dictionary of columns, and a Frictionless data package for repositories.

Format: Data Package and Table Schema, version 1 (specs.frictionlessdata.io). Tables carry unit and meaning of their
columns as metadata.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa

from .. import __version__
from ..process.atomic import write_atomically

DICTIONARY, PACKAGE = "columns.csv", "datapackage.json"
SOURCE = "Richefeu, Combe, Maurin: An Attempt in Assessing Contact Forces From a Kinematic Field, Powders & Grains 2013"


def write_description(folder: Path, tables: Mapping[str, pa.Table], *, name: str, configuration: str) -> list[Path]:
    """Write columns.csv and datapackage.json beside tables.

    Parameters
    ----------
    folder : Path
        Folder of the tables.
    tables : mapping of str to pyarrow.Table
        By file name.
    name : str
        Of the experiment.
    configuration : str
        Settings of the solution, TOML.

    Returns
    -------
    list of Path
        The two files.
    """
    package = _package(folder, tables, name, configuration)
    write_atomically(folder / DICTIONARY, _dictionary(tables).encode())
    write_atomically(folder / PACKAGE, (json.dumps(package, indent=1, ensure_ascii=False) + "\n").encode())
    return [folder / DICTIONARY, folder / PACKAGE]


def _dictionary(tables: Mapping[str, pa.Table]) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(("table", "column", "type", "unit", "meaning"))
    for file, table in tables.items():
        rows.writerows((file, each.name, _kind(each.type), _metadata(each, "unit"), _metadata(each, "meaning"))
                       for each in table.schema)  # fmt: skip
    return text.getvalue()


def _package(folder: Path, tables: Mapping[str, pa.Table], name: str, configuration: str) -> dict[str, Any]:
    return {
        "profile": "data-package",
        "name": _slug(name),
        "title": f"Contact forces inferred from photographs: {name}",
        "description": "SI units; y points up. Forces are those that i exerts on j, compression positive. Unknown "
        "values are empty. Columns fn_sd and ft_sd are standard deviations; see status and trust of the frames.",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "sources": [{"title": SOURCE}],
        "rodsight": {"version": __version__, "configuration": configuration},
        "resources": [_resource(folder / file, table) for file, table in tables.items()],
    }


def _resource(file: Path, table: pa.Table) -> dict[str, Any]:
    content = file.read_bytes()
    kind = file.suffix.removeprefix(".")
    return {
        "name": file.stem,
        "path": file.name,
        "profile": "tabular-data-resource" if kind == "csv" else "data-resource",
        "format": kind,
        "mediatype": "text/csv" if kind == "csv" else "application/vnd.apache.parquet",
        "encoding": "utf-8",
        "bytes": len(content),
        "hash": f"sha256:{hashlib.sha256(content).hexdigest()}",
        "schema": {"fields": [_field(each) for each in table.schema], "missingValues": [""]},
    }


def _field(field: pa.Field) -> dict[str, str]:
    texts = {"description": _metadata(field, "meaning"), "unit": _metadata(field, "unit")}
    return {"name": field.name, "type": _kind(field.type)} | {key: text for key, text in texts.items() if text}


def _kind(kind: pa.DataType) -> str:
    """Return the type in the words of table schemas."""
    if pa.types.is_boolean(kind):
        return "boolean"
    if pa.types.is_integer(kind):
        return "integer"
    return "number" if pa.types.is_floating(kind) else "string"


def _metadata(field: pa.Field, key: str) -> str:
    return ((field.metadata or {}).get(key.encode()) or b"").decode()


def _slug(name: str) -> str:
    return re.sub(r"[^a-z0-9._-]+", "-", name.lower()).strip("-") or "run"
