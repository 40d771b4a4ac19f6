"""The content of results.h5, read directly by h5py and by load_results."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rodsight.process.errors import InputError
from rodsight.results.hdf5.store import (
    Provenance,
    load_results,
    load_tracks,
    read_origin,
    save_results,
    save_tracks,
)
from rodsight.results.results import Results
from rodsight.solver.contacts.contacts import ContactSource, ContactState
from rodsight.solver.frame_forces import MEMBERS, FrameForces, FrameStatus
from rodsight.solver.quantity import columns

from tests.app.recording.fake_results import make_results
from tests.app.results.differences import differences
from tests.app.results.full_results import make_full_results

SUMS = {"photos/0000.jpg": "a1b2", "walls.csv": "c3d4"}
ORIGIN = Provenance("fingerprint", "somewhere/experiment.toml", (2, 5), SUMS)


@pytest.fixture(scope="module")
def results() -> Results:
    return make_full_results()


@pytest.fixture(scope="module")
def file(results: Results, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("stored") / "results.h5"
    save_results(file, results, ORIGIN)
    return file


def thinned(results: Results, rng: np.random.Generator) -> Results:
    """Return results without some contacts and some stored sweeps of every frame, of some frames without all."""
    frames = []
    for frame in results.frames:
        keep = rng.random(frame.contacts.count) < rng.choice([0.0, 0.5, 1.0])
        sweeps = rng.random(len(frame.history.recorded)) < rng.choice([0.0, 0.5, 1.0])
        history = replace(
            frame.history,
            recorded=frame.history.recorded[sweeps],
            fn=frame.history.fn[sweeps][:, keep],
            ft=frame.history.ft[sweeps][:, keep],
        )
        kept = {name: getattr(frame, name)[keep] for name in columns(FrameForces, "contact")}
        frames.append(replace(frame, contacts=frame.contacts.select(keep), history=history, **kept))
    return replace(results, frames=frames)


@pytest.mark.thorough
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1),
    frame_count=st.integers(1, 4),
    columns=st.integers(1, 4),
    rows=st.integers(2, 3),
    sweeps=st.integers(0, 5),
)
def test_any_results_read_back_unchanged(tmp_path, seed, frame_count, columns, rows, sweeps):
    rng = np.random.default_rng(seed)
    results = thinned(make_full_results(frame_count, seed, columns=columns, rows=rows, sweeps=sweeps), rng)
    if rng.random() < 0.5:
        plain = {
            "calibration": None,
            "friction_check": None,
            "radius_tuning": None,
            "read_kinematics": lambda: None,
            "ensemble_size": 0,
        }
        frames = [replace(frame, member_force=None) for frame in results.frames]
        walls = replace(results.walls, force=None, sigma=None)
        results = replace(results, frames=frames, walls=walls, **plain)
    save_results(tmp_path / "results.h5", results, ORIGIN)
    assert differences(results, load_results(tmp_path / "results.h5")) == []


def test_rows_of_a_frame_lie_between_its_offsets(results, file):
    with h5py.File(file) as store:
        offset = store["contacts/offset"][()]
        assert offset.tolist() == np.cumsum([0, *(frame.contacts.count for frame in results.frames)]).tolist()
        for k, frame in enumerate(results.frames):
            rows = slice(offset[k], offset[k + 1])
            for name in ("i", "j", "gap", "normal", "point"):
                assert np.array_equal(store[f"contacts/{name}"][rows], getattr(frame.contacts, name)), name
            for name in ("un", "ut", "state", "age", "source", "probability"):
                assert np.array_equal(store[f"contacts/{name}"][rows], getattr(frame, name)), name
            for name in ("fn", "ft", "nlgs_fn", "nlgs_ft", "fn_sd", "ft_sd"):
                assert np.array_equal(store[f"forces/{name}"][rows], getattr(frame, name)), name
            assert np.array_equal(store["members/force"][rows], frame.member_force)


def test_every_number_of_a_frame_has_its_own_dataset(results, file):
    names = (
        "sweeps", "natural_map", "unbalance", "kappa", "correction", "old_unbalance", "trust", "frames_since_reset",
        "start_difference", "unseen_grains", "hidden_fraction", "similarity", "new_contact_count", "lost_contact_count",
        "warm_residual", "cold_residual", "sweeps_saved", "force_change", "strain", "shear", "shear_step",
    )  # fmt: skip
    with h5py.File(file) as store:
        for name in names:
            expected = [getattr(frame, name) for frame in results.frames]
            assert np.array_equal(store[f"frames/{name}"][()], expected, equal_nan=True), name
        expected = [frame.grain_unbalance for frame in results.frames]
        assert np.array_equal(store["grains/unbalance"][()], expected)
        assert store["frames/reason"].asstr()[()].tolist() == [frame.reason for frame in results.frames]
        assert store["frames/time"][()].tolist() == results.tracks.time.tolist()
        for name in ("stress", "wall_force", "mean_fn", "chain_count", "fn_density"):
            expected = np.array([getattr(each, name) for each in results.statistics])
            assert np.array_equal(store[f"statistics/{name}"][()], expected), name


def test_bodies_are_stored_unchanged(results, file):
    with h5py.File(file) as store:
        for name in ("position", "rotation", "sigma", "zncc", "status", "centre_sigma", "second_zncc",
                     "reference_frame"):  # fmt: skip
            assert np.array_equal(store[f"tracks/{name}"][()], getattr(results.tracks, name)), name
        for name in ("endpoints", "pressure", "force", "sigma"):
            assert np.array_equal(store[f"walls/{name}"][()], getattr(results.walls, name), equal_nan=True), name
        assert store["walls/name"].asstr()[()].tolist() == list(results.walls.name)
        assert np.array_equal(store["grains/id"][()], results.tracks.id)
        assert np.array_equal(store["grains/radius"][()], results.grains.radius)
        assert np.array_equal(store["grains/mass"][()], results.grains.mass)


def test_enumerations_carry_their_names(file):
    kinds = {"frames/status": FrameStatus, "contacts/state": ContactState, "contacts/source": ContactSource}
    with h5py.File(file) as store:
        for path, kind in kinds.items():
            names = h5py.check_enum_dtype(store[path].dtype)
            assert names == {member.name.lower(): member.value for member in kind}, path
            assert store[path].dtype == np.uint8


@pytest.mark.parametrize(
    ("path", "kind"),
    [("contacts/i", np.int32), ("contacts/age", np.int32), ("contacts/offset", np.int64), ("forces/fn", np.float64),
     ("sweeps/fn", np.float32), ("sweeps/number", np.int64), ("grains/id", np.int64), ("frames/sweeps", np.int64),
     ("tracks/reference_frame", np.int32), ("statistics/contact_count", np.int64)],
)  # fmt: skip
def test_numbers_keep_their_type(path, kind, file):
    with h5py.File(file) as store:
        assert store[path].dtype == kind


def test_only_sweeps_that_were_measured_have_rows(results, file):
    with h5py.File(file) as store:
        offset, number = store["sweeps/offset"][()], store["sweeps/number"][()]
        assert store["sweeps/count"][()].tolist() == [6, 6, 6]
        assert offset.tolist() == [0, 3, 6, 9]
        assert number.tolist() == [0, 2, 4] * 3
        for k, frame in enumerate(results.frames):
            for name in ("force_change", "natural_map", "unbalance"):
                assert np.array_equal(
                    store[f"sweeps/{name}"][offset[k] : offset[k + 1]], getattr(frame.history, name)[::2]
                )


def test_a_sweep_with_one_measured_residual_has_a_row(results, tmp_path):
    frames = []
    for frame in results.frames:
        unbalance = frame.history.unbalance.copy()
        unbalance[2] = np.nan
        frames.append(replace(frame, history=replace(frame.history, unbalance=unbalance)))
    save_results(tmp_path / "results.h5", replace(results, frames=frames), ORIGIN)
    with h5py.File(tmp_path / "results.h5") as store:
        assert store["sweeps/number"][()].tolist() == [0, 2, 4] * 3
        assert np.isnan(store["sweeps/unbalance"][1])


def test_forces_of_kept_sweeps_lie_end_to_end(tmp_path):
    results = make_full_results(sweeps=8, recorded=np.array([0, 3, 7]))
    save_results(tmp_path / "results.h5", results, ORIGIN)
    with h5py.File(tmp_path / "results.h5") as store:
        assert store["sweeps/recorded_offset"][()].tolist() == [0, 3, 6, 9]
        assert store["sweeps/recorded"][()].tolist() == [0, 3, 7] * 3
        for name in ("fn", "ft"):
            laid = np.concatenate([getattr(frame.history, name).ravel() for frame in results.frames])
            assert np.array_equal(store[f"sweeps/{name}"][()], laid), name


@pytest.mark.thorough
def test_members_are_named_and_absent_where_a_frame_has_none(results, file, tmp_path):
    with h5py.File(file) as store:
        assert store["members/force"].attrs["member"].tolist() == list(MEMBERS)
    without = [replace(results.frames[0], member_force=None), *results.frames[1:]]
    save_results(tmp_path / "results.h5", replace(results, frames=without), ORIGIN)
    assert [frame.member_force for frame in load_results(tmp_path / "results.h5").frames] == [None] * 3


@pytest.mark.thorough
@pytest.mark.parametrize("size", [0, 5])
def test_standard_deviations_are_stored_with_their_source(results, size, tmp_path):
    save_results(tmp_path / "results.h5", replace(results, ensemble_size=size), ORIGIN)
    assert load_results(tmp_path / "results.h5").ensemble_size == size
    with h5py.File(tmp_path / "results.h5") as store:
        for path in ("forces/fn_sd", "forces/ft_sd"):
            assert store[path].attrs["ensemble_size"] == size
            assert ("5 sequences" in store[path].attrs["source"]) == (size == 5)


@pytest.mark.parametrize(
    ("path", "unit"),
    [("forces/fn", "N"), ("contacts/un", "m/s"), ("contacts/gap", "m"), ("frames/time", "s"), ("grains/mass", "kg"),
     ("tracks/rotation", "rad"), ("statistics/stress", "Pa"), ("statistics/area", "m2"), ("sweeps/ft", "N"),
     ("walls/pressure", "Pa"), ("calibration/wall_tilt", "rad"), ("frames/trust", None)],
)  # fmt: skip
def test_datasets_have_their_unit_as_an_attribute(path, unit, file):
    with h5py.File(file) as store:
        assert store[path].attrs.get("unit") == unit


@pytest.mark.thorough
@pytest.mark.parametrize("frames", [(0, None), (2, 5), (0, 9, 4)])
def test_the_provenance_of_a_file_reads_back(results, frames, tmp_path):
    origin = replace(ORIGIN, frames=frames)
    save_results(tmp_path / "results.h5", results, origin)
    assert read_origin(tmp_path / "results.h5") == origin
    save_tracks(tmp_path / "tracks.h5", "fake", results.tracks, results.walls, origin)
    assert read_origin(tmp_path / "tracks.h5") == origin
    with h5py.File(tmp_path / "results.h5") as store:
        assert store.attrs["configuration"] == results.configuration
        assert (store.attrs["name"], store.attrs["friction"]) == (results.name, results.friction)


def test_other_files_have_no_provenance_and_are_refused(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as store:
        store["data"] = 1.0
    (tmp_path / "text.h5").write_text("nothing")
    for name in ("other.h5", "text.h5", "absent.h5"):
        assert read_origin(tmp_path / name) is None
        with pytest.raises(InputError, match=name):
            load_results(tmp_path / name)


@pytest.mark.parametrize("with_walls", [True, False])
def test_a_file_of_tracks_reads_back(results, with_walls, tmp_path):
    walls = results.walls if with_walls else None
    save_tracks(tmp_path / "tracks.h5", "fake", results.tracks, walls, ORIGIN)
    tracks, read = load_tracks(tmp_path / "tracks.h5")
    assert differences(results, replace(results, tracks=tracks, walls=read or results.walls)) == []
    assert (read is None) == (not with_walls)
    with pytest.raises(InputError, match="holds no forces"):
        load_results(tmp_path / "tracks.h5")


def test_large_columns_are_compressed_without_loss(tmp_path):
    results = make_results(3, 24, 20, sweeps=20)
    save_results(tmp_path / "results.h5", results, ORIGIN)
    assert differences(results, load_results(tmp_path / "results.h5")) == []
    with h5py.File(tmp_path / "results.h5") as store:
        assert store["sweeps/fn"].compression == "gzip"
        assert len(results.frames[0].history.fn.ravel()) > 2 * store["sweeps/fn"].chunks[0]  # several blocks at once
        assert store["sweeps/fn"].id.get_storage_size() < 0.9 * store["sweeps/fn"].nbytes


def test_columns_of_different_lengths_are_not_written(results, tmp_path):
    frames = [replace(frame) for frame in results.frames]
    for frame in frames:  # bypasses the shape checks of the tests
        object.__setattr__(frame, "un", frame.un[:-1])
    with pytest.raises(ValueError, match="contacts/un"):
        save_results(tmp_path / "results.h5", replace(results, frames=frames), ORIGIN)
    assert not (tmp_path / "results.h5").exists()
