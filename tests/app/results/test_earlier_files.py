"""Files of every schema version open; missing datasets are absent, missing essential ones are reported."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from rich.console import Console
from rodsight.cli.summary_table import print_summary
from rodsight.exchange.tidy_tables import make_tables
from rodsight.exchange.vtk_polydata import write_polydata
from rodsight.process.errors import InputError
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.files.finished_run import write_recording
from rodsight.results.hdf5.store import Provenance, load_results, read_origin, save_results
from rodsight.results.results import Results
from rodsight.results.schema import entries
from rodsight.results.summary import save_summary, summarize

from tests.app.results.differences import same_values
from tests.app.results.full_results import make_full_results
from tests.golden.stored import SCHEMAS, unpack

ESSENTIAL = [each.path for each in entries() if each.quantity.essential]
OTHERS = [each.path for each in entries() if not each.quantity.essential]

pytestmark = pytest.mark.thorough


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return unpack(2, tmp_path)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_new(tmp_path_factory.mktemp("saved"))


@pytest.fixture
def new_file(saved: Path, tmp_path: Path) -> Path:
    """A file with every dataset of the current schema."""
    return Path(shutil.copy(saved, tmp_path / "results.h5"))


def save_new(folder: Path) -> Path:
    save_results(folder / "results.h5", make_full_results(), Provenance("abc", "experiment.toml", (0, None), {}))
    return folder / "results.h5"


def use(results: Results, folder: Path) -> None:
    """Make everything that is made of stored results."""
    for frame, forces in enumerate(results.frames):
        assert forces.history.fn.shape == (len(forces.history.recorded), forces.contacts.count), frame
    tables = make_tables(results)
    assert tables["contacts"].num_rows == sum(forces.contacts.count for forces in results.frames)
    assert tables["frames"].num_rows == len(results.frames)
    write_polydata(results, folder / "vtk")
    summary = summarize(results, None, {})
    save_summary(folder / "summary.json", summary)
    assert "NaN" not in (folder / "summary.json").read_text()
    print_summary(Console(file=io.StringIO()), summary)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_a_file_of_any_schema_opens_records_and_exports(schema, tmp_path):
    file = unpack(schema, tmp_path)
    results = load_results(file)
    with h5py.File(file) as store:
        assert store.attrs["schema_version"] == schema
        assert np.array_equal(np.concatenate([frame.fn for frame in results.frames]), store["forces/fn"][()])
        moved = "calibration/wall" if schema == 1 else "calibration/wall_outward"
        assert results.calibration is not None
        assert np.array_equal(results.calibration.wall, store[moved][()])
        assert results.calibration.priors.wall == store[moved.replace("wall", "priors/wall", 1)][()]
    use(results, tmp_path)
    write_recording(results, tmp_path / "run.rrd")
    shown = read_forces(tmp_path / "run.rrd")
    assert [len(shown[k].fn) for k in range(3)] == [frame.contacts.count for frame in results.frames]


def test_a_file_of_schema_1_keeps_its_values(tmp_path):
    file = unpack(1, tmp_path)
    results = load_results(file)
    assert (results.name, results.friction, results.ensemble_size) == ("small", 0.25, 2)
    assert [frame.status.name for frame in results.frames] == ["RESET", "SUSPECT", "SETTLING"]
    assert [frame.contacts.count for frame in results.frames] == [49, 47, 45]
    assert results.walls.name == ("bottom", "right", "top", "left")
    assert results.frames[2].fn.sum() == pytest.approx(2985.023761044898, rel=1e-15)
    assert results.frames[2].trust == 0.8246288997121087
    assert results.statistics[1].pressure == 53332.37477869715
    origin = read_origin(file)
    assert origin is not None
    assert origin.frames == (0, None, 1)
    assert origin.checksums["walls.csv"].startswith("234f33")


def test_a_file_of_schema_2_keeps_its_values(file, tmp_path):
    origin = read_origin(file)
    assert origin is not None
    save_results(tmp_path / "again.h5", load_results(file), origin)
    renamed = {each.quantity.formerly: each.path for each in entries() if each.quantity.formerly}
    with h5py.File(file) as then, h5py.File(tmp_path / "again.h5") as now:
        paths: list[str] = []
        then.visititems(lambda path, each: paths.append(path) if isinstance(each, h5py.Dataset) else None)
        values = {path: (then[path][()], now[renamed.get(path, path)][()]) for path in paths}
    assert len(values) > 150
    assert [path for path, both in values.items() if not same_values(*map(np.asarray, both))] == []


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The results of such a file with all its datasets."""
    return load_results(save_new(tmp_path_factory.mktemp("whole")))


@pytest.mark.parametrize(
    "path", [pytest.param(path, marks=pytest.mark.slow) if k % 12 else path for k, path in enumerate(OTHERS)]
)
def test_without_a_dataset_that_is_not_essential_a_file_opens(path, new_file, whole, tmp_path):
    with h5py.File(new_file, "a") as store:
        del store[path]
    results = load_results(new_file)
    use(results, tmp_path)
    if path != "frames/trust":
        assert [frame.trust for frame in results.frames] == [frame.trust for frame in whole.frames]
    kept = {each.path: each for each in entries("frames", "statistics")}.get(path)
    if kept is not None and kept.quantity.dims == "" and kept.dtype.kind == "f":
        part = results.frames if kept.part == "frames" else results.statistics
        values = [getattr(each, kept.name) for each in part]
        assert np.array_equal(values, [kept.absent] * len(part), equal_nan=True)


def test_a_file_of_nothing_but_essentials_opens_records_and_exports(new_file, tmp_path):
    with h5py.File(new_file, "a") as store:
        for path in OTHERS:
            del store[path]
    results = load_results(new_file)
    use(results, tmp_path)
    write_recording(results, tmp_path / "run.rrd")
    assert results.calibration is None
    assert results.frames[0].member_force is None
    assert np.isnan(results.frames[0].probability).all()
    assert np.isnan([each.contact_count for each in results.statistics]).all()
    assert "contact_count" not in make_tables(results)["frames"].column_names  # whole numbers have no NaN


@pytest.mark.parametrize("path", ESSENTIAL)
def test_an_essential_dataset_that_is_missing_is_named(path, file):
    with h5py.File(file, "a") as store:
        del store[path]
    with pytest.raises(InputError, match=rf"results\.h5: dataset {path}: is missing"):
        load_results(file)


@pytest.mark.parametrize("path", [*ESSENTIAL, "frames/trust", "sweeps/fn", "calibration/offset"])
def test_a_dataset_of_another_shape_is_named(path, file):
    with h5py.File(file, "a") as store:
        values, kind = store[path][()], store[path].dtype
        del store[path]
        store.create_dataset(path, data=values[:-1], dtype=kind)
    with pytest.raises(InputError, match=r"results\.h5: dataset \S+: has shape") as raised:
        load_results(file)
    names_the_dimension = path in ("grains/id", "frames/time", "walls/name")  # other datasets are then longer than it
    assert names_the_dimension or path in str(raised.value)


@pytest.mark.parametrize(
    ("path", "values", "problem"),
    [
        ("forces/fn", "text", "not float64"),
        ("frames/reason", 1.5, "not text"),
        ("contacts/offset", 1.5, "not int64"),
        ("contacts/state", np.uint8(77), "holds 77"),
        ("contacts/offset", -1, "does not ascend from 0"),
        ("sweeps/number", 1000, "names a sweep beyond"),
    ],
)
def test_a_dataset_with_other_values_is_named(path, values, problem, file):
    with h5py.File(file, "a") as store:
        shape = store[path].shape
        del store[path]
        if isinstance(values, str):
            store.create_dataset(path, data=np.full(shape, values, object), dtype=h5py.string_dtype())
        else:
            store.create_dataset(path, data=np.full(shape, values))
    with pytest.raises(InputError, match=rf"dataset {path}: .*{problem}"):
        load_results(file)


def test_states_with_other_numbers_are_read_by_their_names(file):
    before = load_results(file)
    with h5py.File(file, "a") as store:
        values = store["contacts/state"][()]
        del store["contacts/state"]
        other = h5py.enum_dtype({"sliding": 0, "open": 1, "sticking": 2}, basetype=np.uint8)
        store.create_dataset("contacts/state", data=np.array([1, 2, 0], np.uint8)[values], dtype=other)
    after = load_results(file)
    for one, two in zip(before.frames, after.frames, strict=True):
        assert np.array_equal(one.state, two.state)


@pytest.mark.parametrize("version", [0, 3, "two", None])
def test_an_unknown_schema_is_refused(version, file):
    with h5py.File(file, "a") as store:
        del store.attrs["schema_version"]
        if version is not None:
            store.attrs["schema_version"] = version
    with pytest.raises(InputError, match="schema_version"):
        load_results(file)


def test_a_missing_attribute_is_named(file):
    with h5py.File(file, "a") as store:
        del store.attrs["friction"]
    with pytest.raises(InputError, match="attribute friction: is missing"):
        load_results(file)
