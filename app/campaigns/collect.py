"""Results of all runs of a campaign: Parquet of all contacts, grains, frames and walls, and a catalogue of the runs."""

from __future__ import annotations

import csv
import io
import json
import math
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from ..exchange.data_package import write_description
from ..exchange.tidy_tables import TableName, make_table
from ..process.atomic import replacing, write_atomically
from ..process.counts import known_or_none, mean_of_known
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
    varied = list(dict.fromkeys(each.partition("=")[0] for case in cases for each in case.settings))
    rows = [_row(folder, case, outcome_of[case.name], varied) for case in cases]
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


def _row(folder: Path, case: Case, outcome: Outcome, varied: Sequence[str]) -> Row:
    """Return the catalogue's row of a run; a varied key that it does not set has the value of its experiment."""
    row: Row = {"run": case.name, "experiment": case.experiment, **dict.fromkeys(varied, "")}
    row |= {key: value for key, _, value in (each.partition("=") for each in case.settings)}
    row |= {
        "state": "failed" if outcome.error else "done",
        "error": outcome.error,
        "seconds": round(outcome.seconds, 1),
    }
    if outcome.error:
        return row
    summary = json.loads((folder / case.name / SUMMARY).read_text(encoding="utf-8"))
    results = load_results(folder / case.name / RESULTS)
    row |= {key: setting_of(results.configuration, key) for key in varied if row[key] == ""}
    count = summary["status_count"]
    row |= {
        "frames": summary["frame_count"],
        "grains": summary["grain_count"],
        "contacts": _mean(summary["contact_count"]),
        "friction_angle_degrees": _mean(summary["friction_angle_degrees"][1:]),
        **_interval("friction_angle_degrees", summary["friction_angle_degrees"][1:]),
        "friction_angle_degrees_sd": _rms(math.degrees(each.friction_angle_sd) for each in results.statistics),
        "coordination_number": _mean(summary["coordination_number"]),
        **_interval("coordination_number", summary["coordination_number"]),
        "coordination_number_sd": _rms(each.coordination_number_sd for each in results.statistics),
        "mean_fn": _mean(summary["mean_fn"]),
        "settled": count.get("settled", 0),
        "suspect": count.get("suspect", 0),
        "failed_frames": count.get("failed", 0),
        "trust": _mean(summary["trust"]),
        **_interval("trust", summary["trust"]),
        "least_trust": min((each for each in summary["trust"] if each is not None), default=None),
        "friction_measured": (summary["friction"] or {}).get("measured"),
    }
    if "accuracy" in summary:
        row["r_fn"] = _mean(summary["accuracy"]["r_fn"])
        row |= _interval("r_fn", summary["accuracy"]["r_fn"])
    return row


def setting_of(configuration: str, key: str) -> Any:
    """Return the value of a dotted key of a configuration in TOML; empty if it is not set."""
    value: Any = tomllib.loads(configuration)
    for part in key.split("."):
        value = value.get(part, "") if isinstance(value, dict) else ""
    return value


def _interval(name: str, values: Sequence[float | None]) -> Row:
    """Return the tenth and the ninetieth percentile of the frames, as columns."""
    known = [each for each in values if each is not None]
    low, high = np.quantile(known, [0.1, 0.9]).tolist() if known else (None, None)
    return {f"{name}_low": low and round(low, 4), f"{name}_high": high and round(high, 4)}


def _rms(deviations: Iterable[float]) -> float | None:
    """Return the root mean square of standard deviations: those of frames are not independent of one another."""
    known = [each for each in deviations if math.isfinite(each)]
    return round(math.sqrt(sum(each**2 for each in known) / len(known)), 4) if known else None


def _mean(values: Sequence[float | None]) -> float | None:
    mean = known_or_none(mean_of_known(values))
    return None if mean is None else round(mean, 4)
