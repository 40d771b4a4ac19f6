"""An untrusted results.h5 opens no other file and yields only its own content."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from rodsight.process.errors import InputError
from rodsight.results.hdf5.store import Provenance, load_results, save_results

from tests.app.results.full_results import make_full_results

ORIGIN = Provenance("print", "experiment.toml", (0, None), {})


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    file = tmp_path_factory.mktemp("sound") / "results.h5"
    save_results(file, make_full_results(), ORIGIN)
    return file


@pytest.fixture
def stored(sound, tmp_path):
    """A copy that a test may spoil."""
    return Path(shutil.copy(sound, tmp_path))


def replace_dataset(file, name, link):
    with h5py.File(file, "r+") as store:
        del store[name]
        store[name] = link


@pytest.mark.parametrize("offset", [[0, 9, 4], [1, 4, 9]])
def test_offsets_that_do_not_ascend_from_zero_are_damage(stored, offset):
    with h5py.File(stored, "r+") as store:
        store["contacts/offset"][:3] = offset
    with pytest.raises(InputError, match="contacts/offset: does not ascend from 0"):
        load_results(stored)


def test_a_sweep_beyond_those_of_its_frame_is_damage(stored):
    with h5py.File(stored, "r+") as store:
        store["sweeps/number"][-1] = store["sweeps/count"][-1]
    with pytest.raises(InputError, match="sweeps/number: names a sweep beyond"):
        load_results(stored)


def test_a_link_to_another_file_is_not_followed(stored, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["secret"] = np.zeros(3)
    replace_dataset(stored, "forces/fn", h5py.ExternalLink(str(tmp_path / "other.h5"), "/secret"))
    with pytest.raises(InputError, match="forces/fn: is a link"):
        load_results(stored)


@pytest.mark.parametrize("name", ["forces", "forces/fn"])
def test_a_soft_link_is_not_followed(stored, name):
    replace_dataset(stored, name, h5py.SoftLink("/contacts/gap" if "/" in name else "/contacts"))
    with pytest.raises(InputError, match=f"{name}: is a link"):
        load_results(stored)


def test_values_stored_in_another_file_are_not_read(stored, tmp_path):
    (tmp_path / "secret").write_bytes(bytes(8000))
    with h5py.File(stored, "r+") as store:
        shape = store["forces/fn"].shape
        del store["forces/fn"]
        store.create_dataset("forces/fn", shape, np.float64, external=[(str(tmp_path / "secret"), 0, 8000)])
    with pytest.raises(InputError, match="another file"):
        load_results(stored)


def test_numbers_of_an_unsupported_type_are_damage(stored):
    kind = h5py.h5t.IEEE_F64LE.copy()
    kind.set_ebias(99_999)
    with h5py.File(stored, "r+") as store:
        size = store["frames/time"].shape
        del store["frames/time"]
        h5py.h5d.create(store.id, b"frames/time", kind, h5py.h5s.create_simple(size))
    with pytest.raises(InputError, match="is damaged"):
        load_results(stored)


def test_an_invalid_configuration_is_damage(stored):
    with h5py.File(stored, "r+") as store:
        store.attrs["configuration"] = "[a"
    with pytest.raises(InputError, match="attribute configuration: is not TOML"):
        load_results(stored)


def test_a_friction_below_zero_is_damage(stored):
    with h5py.File(stored, "r+") as store:
        store.attrs["friction"] = -0.25
    with pytest.raises(InputError, match="is no coefficient of friction"):
        load_results(stored)


def test_states_are_read_by_their_names_whatever_their_numbers(stored):
    expected = [frame.state.tolist() for frame in load_results(stored).frames]
    with h5py.File(stored, "r+") as store:
        values = store["contacts/state"][()]
        named = h5py.check_enum_dtype(store["contacts/state"].dtype)
        other = {name: 9 - number for name, number in named.items()}
        del store["contacts/state"]
        store.create_dataset("contacts/state", data=9 - values, dtype=h5py.enum_dtype(other, basetype=np.uint8))
    assert [frame.state.tolist() for frame in load_results(stored).frames] == expected
