"""The tree of datasets in Python equals that of the file in xarray."""

from __future__ import annotations

import numpy as np
import pytest
import xarray
from rodsight.exchange.labelled_dataset import make_dataset
from rodsight.results.hdf5.store import Provenance, save_results

from tests.app.results.full_results import make_full_results


@pytest.mark.slow
def test_the_tree_equals_that_of_the_file(tmp_path):
    results = make_full_results()
    save_results(tmp_path / "results.h5", results, Provenance("", "experiment.toml", (0, None), {}))
    made = make_dataset(results)
    with xarray.open_datatree(tmp_path / "results.h5", engine="h5netcdf") as stored:
        paths = {f"{group.path}/{name}" for group in stored.subtree for name in group.data_vars}
        assert paths - {"/frame_edge"} == {f"{group.path}/{name}" for group in made.subtree for name in group.data_vars}
        for path in sorted(paths):
            assert made[path].dims == stored[path].dims
            assert made[path].attrs.get("units") == stored[path].attrs.get("units")
            values = stored[path].values
            if stored[path].dtype.kind in "OTU":
                assert made[path].values.tolist() == values.tolist(), path
            else:
                np.testing.assert_allclose(np.asarray(made[path].values, float), np.asarray(values, float), 1e-6)
        for name in stored.coords:
            assert made.coords[name].values.tolist() == stored.coords[name].values.tolist()


def test_rows_of_contacts_have_their_frame():
    results = make_full_results()
    tree = make_dataset(results)
    counts = [frame.contacts.count for frame in results.frames]
    assert tree["forces/fn"]["frame_of_contact"].values.tolist() == np.repeat(range(len(counts)), counts).tolist()
    assert "frame_of_contact" not in tree["tracks"].coords
