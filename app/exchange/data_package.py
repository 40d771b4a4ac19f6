"""Description of a folder of tables for repositories: a dictionary of columns, a data package and an RO-Crate.

Formats: Data Package and Table Schema, version 1 (specs.frictionlessdata.io); RO-Crate 1.1
(w3id.org/ro/crate/1.1). Tables carry unit and meaning of their columns as metadata.
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

DICTIONARY, PACKAGE, CRATE = "columns.csv", "datapackage.json", "ro-crate-metadata.json"
CRATE_FORMAT = "https://w3id.org/ro/crate/1.1"
SOURCE = "Richefeu, Combe, Maurin: An Attempt in Assessing Contact Forces From a Kinematic Field, Powders & Grains 2013"


def write_description(folder: Path, tables: Mapping[str, pa.Table], *, name: str, configuration: str) -> list[Path]:
    """Write columns.csv, datapackage.json and ro-crate-metadata.json beside tables.

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
        The three files.
    """
    package = _package(folder, tables, name, configuration)
    write_atomically(folder / DICTIONARY, _dictionary(tables).encode())
    for file, content in ((PACKAGE, package), (CRATE, _crate(package))):
        write_atomically(folder / file, (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode())
    return [folder / DICTIONARY, folder / PACKAGE, folder / CRATE]


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


def _crate(package: dict[str, Any]) -> dict[str, Any]:
    """Return the RO-Crate of a data package: the folder as a data set, its files, and the program that made them.

    Authors and licence of the data are for those who publish it to add; the profile demands a licence of a published
    crate, which therefore states that none is given yet.
    """
    tables = [
        {"@id": each["path"], "@type": "File", "name": each["path"], "encodingFormat": each["mediatype"],
         "contentSize": str(each["bytes"]), "sha256": each["hash"].removeprefix("sha256:")}
        for each in package["resources"]
    ]  # fmt: skip
    descriptions = [
        {"@id": DICTIONARY, "@type": "File", "name": "meaning and unit of all columns", "encodingFormat": "text/csv"},
        {"@id": PACKAGE, "@type": "File", "name": "Frictionless data package", "encodingFormat": "application/json"},
    ]
    program = {"@id": "#rodsight", "@type": "SoftwareApplication", "name": "Rodsight", "version": __version__}
    dataset = {
        "@id": "./", "@type": "Dataset", "name": package["title"], "description": package["description"],
        "datePublished": package["created"], "license": "not stated: to be chosen by those who publish the data",
        "citation": SOURCE, "hasPart": [{"@id": each["@id"]} for each in [*tables, *descriptions]],
        "mentions": {"@id": "#computation"},
    }  # fmt: skip
    computation = {
        "@id": "#computation", "@type": "CreateAction", "name": "inference of contact forces from photographs",
        "endTime": package["created"], "instrument": {"@id": "#rodsight"},
        "result": [{"@id": each["@id"]} for each in tables],
    }  # fmt: skip
    about = {
        "@id": CRATE, "@type": "CreativeWork", "about": {"@id": "./"}, "conformsTo": {"@id": CRATE_FORMAT},
    }  # fmt: skip
    return {
        "@context": f"{CRATE_FORMAT}/context",
        "@graph": [about, dataset, *tables, *descriptions, program, computation],
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
