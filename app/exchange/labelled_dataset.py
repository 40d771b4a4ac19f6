"""Results as an xarray.DataTree with named dimensions, labels and units."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray

from ..results.hdf5.writer import columns_of_results
from ..results.results import Results
from ..results.schema import DIMENSIONS, SCHEMA, SCHEMA_VERSION, Entry, entries


def make_dataset(results: Results) -> xarray.DataTree:
    """Return the contents of results.h5 under the same paths, in SI units (attribute `units`).

    Enumerations are integers with `flag_values` and `flag_meanings`; unknown values are NaN or absent. Rows of contacts
    have their frame as the coordinate `frame_of_contact`.
    """
    columns = columns_of_results(results)
    present = [each for each in entries() if each.path in columns]
    sizes = {name: size for each in present for name, size in zip(each.dims, columns[each.path].shape, strict=True)}
    groups: dict[str, dict[str, Any]] = {}
    for each in present:
        group, _, name = each.path.rpartition("/")
        values = columns[each.path].astype(each.dtype)
        groups.setdefault(f"/{group}", {})[name] = xarray.Variable(each.dims, values, _attributes(each))
    attributes = {"name": results.name, "friction": results.friction, "configuration": results.configuration,
                  SCHEMA: SCHEMA_VERSION}  # fmt: skip
    tree = {"/": xarray.Dataset(coords=_labels(sizes, columns), attrs=attributes)}
    row = _frame_of_contact(columns)
    for path, group in groups.items():
        ragged = any("contact" in variable.dims for variable in group.values())
        tree[path] = xarray.Dataset(group, {"frame_of_contact": row} if ragged else None)
    return xarray.DataTree.from_dict(tree)


def _attributes(entry: Entry) -> dict[str, Any]:
    quantity = entry.quantity
    found: dict[str, Any] = {"long_name": quantity.meaning}
    if quantity.unit:
        found["units"] = quantity.unit
    if quantity.names is not None:
        found["flag_values"] = np.array([member.value for member in quantity.names], np.uint8)
        found["flag_meanings"] = " ".join(member.name.lower() for member in quantity.names)
    return found


def _labels(sizes: dict[str, int], columns: dict[str, np.ndarray]) -> dict[str, xarray.Variable]:
    """Return the labels of labelled dimensions."""
    found: dict[str, xarray.Variable] = {}
    for name, size in sizes.items():
        dimension = DIMENSIONS[name]
        labels = columns.get(dimension.labelled_by, dimension.labels)
        if name == "frame":
            labels = np.arange(size)
        if labels is not None:
            found[name] = xarray.Variable((name,), np.asarray(labels), {"long_name": dimension.meaning})
    return found


def _frame_of_contact(columns: dict[str, np.ndarray]) -> xarray.Variable:
    counts = np.diff(columns["contacts/offset"])
    frames = np.repeat(np.arange(len(counts)), counts)
    return xarray.Variable(("contact",), frames, {"long_name": "frame of this row of contacts"})
