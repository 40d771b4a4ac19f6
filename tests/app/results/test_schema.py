"""The schema and stored files agree in names, dimensions, types, units and attributes."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Annotated, get_type_hints
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from rodsight.exchange.tidy_tables import make_tables
from rodsight.exchange.vtk_polydata import write_polydata
from rodsight.results import schema
from rodsight.results.hdf5.store import Provenance, load_results, save_results
from rodsight.results.schema import ATTRIBUTES, DIMENSIONS, PARTS, Entry, entries, unit_of
from rodsight.results.schema_page import PAGE, schema_page
from rodsight.solver.bodies.grains import Array
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.quantity import Quantity, quantities

from tests.app.results.full_results import make_full_results
from tests.golden.stored import unpack

ORIGIN = Provenance("fingerprint", "experiment.toml", (2, 5), {"photos/0000.jpg": "a1b2", "walls.csv": "c3d4"})
OWN = {"unit", "units", "long_name", "flag_values", "flag_meanings", "DIMENSION_LIST", "DIMENSION_LABELS"}
OF_SCALES = {"CLASS", "NAME", "REFERENCE_LIST", "long_name"}
MADE_WITH = 2  # schema of the stored file: datasets of this version may be newer than the file
NEWER = {"inputs", "code", "libraries", "diagnosis", "base_friction"}  # attributes that the stored file is older than
UNDECLARED = {
    "Grains.drag",
    "Grains.moment",
    "Grains.moment_sd",
    "FrameForces.frame",
    "Contacts.grain_count",
    "Contacts.wall_count",
}  # derived from the rest of a file


@pytest.fixture(scope="module", params=["stored", "written now"])
def file(request, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("schema")
    if request.param == "stored":
        return unpack(MADE_WITH, folder)
    save_results(folder / "results.h5", make_full_results(), ORIGIN)
    return folder / "results.h5"


def datasets(store: h5py.File) -> dict[str, h5py.Dataset]:
    found = {}
    store.visititems(lambda path, item: found.update({path: item}) if isinstance(item, h5py.Dataset) else None)
    return found


def described(each: Entry) -> dict[str, object]:
    names = each.quantity.names
    return {
        "dims": each.dims,
        "dtype": "text" if each.dtype.kind == "O" else "uint8" if names else str(each.dtype),
        "unit": each.quantity.unit or None,
        "units": each.quantity.unit or None,
        "names": {member.name.lower(): member.value for member in names} if names else None,
        "flags": " ".join(member.name.lower() for member in names) if names else None,
    }


def found_in(dataset: h5py.Dataset) -> dict[str, object]:
    text = h5py.check_string_dtype(dataset.dtype) is not None
    names = h5py.check_enum_dtype(dataset.dtype)
    return {
        "dims": tuple(dim.label for dim in dataset.dims),
        "dtype": "text" if text else str(dataset.dtype),
        "unit": dataset.attrs.get("unit"),
        "units": dataset.attrs.get("units"),
        "names": names if dataset.dtype != bool else None,
        "flags": dataset.attrs.get("flag_meanings"),
    }


def test_every_stored_dataset_agrees_with_the_schema(file):
    with h5py.File(file) as store:
        table = {each.path: described(each) for each in entries()}
        renamed = {each.quantity.formerly: each.path for each in entries() if each.quantity.formerly is not None}
        stored = {
            renamed.get(path, path): found_in(item) for path, item in datasets(store).items() if path not in DIMENSIONS
        }
        for path, found in stored.items():
            declared = table[path]
            # Later versions of an enumeration may have more names; stored ones keep their values.
            names, flags = declared.pop("names"), declared.pop("flags")
            then, flagged = found.pop("names"), found.pop("flags")
            assert found == declared, path
            assert (then or {}).items() <= (names or {}).items(), path
            assert str(flags).startswith(str(flagged)), path
        lacking = {each.path for each in entries() if each.quantity.since < MADE_WITH} - stored.keys()
        assert lacking == set()


def test_every_dimension_is_a_scale_with_its_labels(file):
    with h5py.File(file) as store:
        used = set()
        for path, item in datasets(store).items():
            if path in DIMENSIONS:
                assert item.is_scale, path
                assert set(item.attrs) <= OF_SCALES
                continue
            for dim in item.dims:
                used.add(dim.label)
                assert [scale.name for scale in dim.values()] == [f"/{dim.label}"], path
        assert used == set(DIMENSIONS) & set(store)
        for name in used:
            labels = DIMENSIONS[name].labels
            if name == "frame":
                labels = (0, 1, 2)
            elif name == "wall":
                labels = tuple(store["walls/name"].asstr()[()])
            elif name == "grain":
                labels = store["grains/id"][()]
            if labels is not None:
                scale = store[name]
                values = scale.asstr()[()] if h5py.check_string_dtype(scale.dtype) else scale[()]
                assert np.array_equal(values, labels), name


def test_every_attribute_is_in_the_schema(file):
    with h5py.File(file) as store:
        declared = {each.name for each in ATTRIBUTES if not each.of}
        assert declared - set(store.attrs) in (set(), NEWER)
        assert set(store.attrs) <= declared
        for path, item in datasets(store).items():
            if path not in DIMENSIONS:
                assert set(item.attrs) - OWN == {each.name for each in ATTRIBUTES if path in each.of}, path


def test_no_dataset_has_the_name_of_a_dimension():
    assert {each.path for each in entries() if each.path.rsplit("/", 1)[-1] in DIMENSIONS} == set()


def test_every_field_of_a_result_is_declared():
    def undeclared(kind: type) -> set[str]:
        hints, known = get_type_hints(kind), {each.name for each in quantities(kind)}
        below = [hint for hint in hints.values() if is_dataclass(hint)]
        own = {f"{kind.__name__}.{each.name}" for each in fields(kind) if each.name not in known}
        own -= {f"{kind.__name__}.{name}" for name, hint in hints.items() if is_dataclass(hint)}
        return own.union(*(undeclared(each) for each in below))

    assert set().union(*map(undeclared, PARTS.values())) == UNDECLARED


def test_the_schema_page_is_up_to_date():
    assert PAGE.read_text() == schema_page(), "run: python -m rodsight.results.schema_page"


def test_units_are_those_of_the_schema():
    assert [unit_of(path) for path in ("forces/fn", "contacts/gap", "frames/trust")] == ["N", "m", ""]


@dataclass(frozen=True, slots=True)
class WithDrift(FrameForces):
    """Frames with additional quantities."""

    drift: Annotated[float, Quantity("how far the packing drifted", "m", since=2)] = float("nan")
    pull: Annotated[Array | None, Quantity("force on every grain", "N", "grain", since=2)] = None
    wear: Annotated[Array | None, Quantity("wear of every contact", "m", "contact", since=2)] = None


@pytest.fixture
def with_drift(monkeypatch):
    """The schema with the additional quantities, which is gathered once for each process."""
    with monkeypatch.context() as patch:
        patch.setitem(schema.PARTS, "frames", WithDrift)
        schema.entries.cache_clear()
        yield
    schema.entries.cache_clear()


@pytest.mark.thorough
@pytest.mark.usefixtures("with_drift")
def test_a_declared_quantity_reaches_every_output(tmp_path):
    plain = make_full_results()
    values = {each.name: None for each in fields(FrameForces)}
    frames = [
        WithDrift(
            **{name: getattr(frame, name) for name in values},
            drift=0.5 + frame.frame,
            pull=np.arange(12.0) + frame.frame,
            wear=np.full(frame.contacts.count, 7.0 + frame.frame),
        )
        for frame in plain.frames
    ]
    results = replace(plain, frames=frames)
    save_results(tmp_path / "results.h5", results, ORIGIN)
    with h5py.File(tmp_path / "results.h5") as store:
        assert store["frames/drift"][()].tolist() == [0.5, 1.5, 2.5]
        assert store["frames/drift"].attrs["unit"] == "m"
        assert [dim.label for dim in store["frames/pull"].dims] == ["frame", "grain"]
        assert [dim.label for dim in store["contacts/wear"].dims] == ["contact"]
    again = load_results(tmp_path / "results.h5")
    assert [getattr(frame, "drift", None) for frame in again.frames] == [0.5, 1.5, 2.5]
    assert getattr(again.frames[2], "pull", np.empty(0)).tolist() == (np.arange(12.0) + 2).tolist()
    tables = make_tables(again)
    assert tables["frames"].column("drift").to_pylist() == [0.5, 1.5, 2.5]
    assert tables["frames"].schema.field("drift").metadata == {
        b"unit": b"m",
        b"meaning": b"how far the packing drifted",
    }
    assert tables["grains"].column("pull").to_pylist()[12] == 1.0
    assert tables["contacts"].column("wear").to_pylist()[0] == 7.0
    write_polydata(again, tmp_path)
    root = ElementTree.parse(tmp_path / "contacts_0001.vtp").getroot()
    shown = {str(each.get("Name")): each.text or "" for each in root.iter("DataArray")}
    assert float(shown["drift"]) == 1.5
    assert set(shown["wear"].split()) == {"8.0"}
    assert "| `frames/drift` | frame | float64 | m | how far the packing drifted | 2 |" in schema_page()

    save_results(tmp_path / "plain.h5", plain, ORIGIN)
    earlier = load_results(tmp_path / "plain.h5")
    assert np.isnan([getattr(frame, "drift", 0.0) for frame in earlier.frames]).all()
    assert getattr(earlier.frames[0], "pull", 0) is None
