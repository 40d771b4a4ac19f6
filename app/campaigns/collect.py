"""Results of all runs of a campaign: Parquet of all contacts, grains, frames and walls, and a catalogue of the runs."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import pyarrow as pa
import pyarrow.parquet

from ..exchange.data_package import write_description
from ..exchange.tidy_tables import TableName, make_table
from ..process.atomic import replacing, write_atomically
from ..results.hdf5.store import load_results
from ..run_folder import RESULTS, SUMMARY
from .plan import Case
from .task import Outcome

CATALOGUE = "catalogue.csv"
Row = dict[str, Any]


def collect(folder: Path, cases: Sequence[Case], outcomes: Sequence[Outcome]) -> list[Row]:
    """Write contacts, grains, frames and walls of all runs as Parquet, and catalogue.csv.

    The first column of the tables is the name of the run. Runs are read one at a time.

    Parameters
    ----------
    folder : Path
        Folder of the campaign.
    cases : sequence of Case
    outcomes : sequence of Outcome
        In any order.

    Returns
    -------
    list of dict
        The rows of the catalogue.
    """
    outcome_of = {each.name: each for each in outcomes}
    rows = [_row(folder, case, outcome_of[case.name]) for case in cases]
    completed = [case for case in cases if not outcome_of[case.name].error]
    described = {}
    for table in get_args(TableName):
        file = folder / f"{table}.parquet"
        schema = _write(folder, completed, table, file)
        if schema is not None:
            described[file.name] = schema.empty_table()
    write_description(folder, described, name=folder.name, configuration="")
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(folder / CATALOGUE, text.getvalue().encode())
    return rows


def _write(folder: Path, cases: Sequence[Case], table: TableName, file: Path) -> pa.Schema | None:
    """Write one table of all runs, with nulls in columns that a run lacks; return its schema, None without runs."""
    names = pa.field("run", pa.string(), metadata={"meaning": "name of the run, as in catalogue.csv"})
    schema = None
    for case in cases:  # runs are read twice, for the schema and for the rows, to hold one at a time
        found = pa.schema([names, *make_table(load_results(folder / case.name / RESULTS), table).schema])
        schema = found if schema is None else pa.unify_schemas([schema, found], promote_options="permissive")
    if schema is None:
        file.unlink(missing_ok=True)
        return None
    with replacing(file) as part, pyarrow.parquet.ParquetWriter(part, schema) as writer:
        for case in cases:
            rows = make_table(load_results(folder / case.name / RESULTS), table)
            rows = rows.add_column(0, names, pa.array([case.name] * len(rows), pa.string()))
            columns = [
                rows.column(each.name).cast(each.type) if each.name in rows.column_names
                else pa.nulls(len(rows), each.type)
                for each in schema
            ]  # fmt: skip
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))
    return schema


def _row(folder: Path, case: Case, outcome: Outcome) -> Row:
    """Return the catalogue's row of a run."""
    row: Row = {"run": case.name, "experiment": case.experiment}
    row |= {key: value for key, _, value in (each.partition("=") for each in case.settings)}
    row |= {
        "state": "failed" if outcome.error else "done",
        "error": outcome.error,
        "seconds": round(outcome.seconds, 1),
    }
    if outcome.error:
        return row
    summary = json.loads((folder / case.name / SUMMARY).read_text(encoding="utf-8"))
    count = summary["status_count"]
    row |= {
        "frames": summary["frame_count"],
        "grains": summary["grain_count"],
        "contacts": _mean(summary["contact_count"]),
        "friction_angle_degrees": _mean(summary["friction_angle_degrees"][1:]),
        "coordination_number": _mean(summary["coordination_number"]),
        "mean_fn": _mean(summary["mean_fn"]),
        "settled": count.get("settled", 0),
        "suspect": count.get("suspect", 0),
        "failed_frames": count.get("failed", 0),
        "trust": _mean(summary["trust"]),
        "least_trust": min((each for each in summary["trust"] if each is not None), default=None),
        "friction_measured": (summary["friction"] or {}).get("measured"),
    }
    if "accuracy" in summary:
        row["r_fn"] = _mean(summary["accuracy"]["r_fn"])
    return row


def _mean(values: Sequence[float | None]) -> float | None:
    known = [each for each in values if each is not None]
    return round(sum(known) / len(known), 4) if known else None
