"""xarray opens results.h5 with the names and labels of its dimensions, with both of its engines."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from rodsight.results.hdf5.store import Provenance, save_results, save_tracks
from rodsight.results.schema import entries
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.quantity import columns

from tests.app.results.full_results import make_full_results

ORIGIN = Provenance("fingerprint", "experiment.toml", (0, None), {"walls.csv": "c3d4"})


@pytest.fixture(params=["h5netcdf", "netcdf4"])
def engine(request) -> str:
    return request.param


def open_tree(file: Path, engine: str) -> xarray.DataTree:
    with xarray.open_datatree(file, engine=engine) as tree:
        return tree.load()


@pytest.mark.thorough
def test_every_dataset_is_a_variable_with_its_dimensions(engine, tmp_path):
    results = make_full_results()
    save_results(tmp_path / "results.h5", results, ORIGIN)
    tree = open_tree(tmp_path / "results.h5", engine)
    for each in entries():
        assert tree[each.path].dims == each.dims, each.path
    position = tree["tracks/position"].sel(frame=1, grain=results.tracks.id[4])
    assert np.array_equal(position.sel(xy=["x", "y"]), results.tracks.position[1, 4])
    top = results.walls.name.index("top")
    force = tree["statistics/wall_force"].sel(wall="top", xy="y")
    assert np.array_equal(force, [each.wall_force[top, 1] for each in results.statistics])
    stiff = tree["members/force"].sel(member="stiff", component="ft")
    assert np.array_equal(stiff, np.concatenate([frame.member_force[:, 1, 1] for frame in results.frames]))
    assert tree["forces/fn"].attrs["units"] == "N"
    assert tree["frames/status"].attrs["flag_meanings"].split()[:2] == ["reset", "suspect"]
    assert tree["frames/reason"].values.tolist() == [frame.reason for frame in results.frames]
    assert bool(tree["calibration/applied"])


@pytest.mark.thorough
def test_a_run_without_any_contact_opens(engine, tmp_path):
    results = make_full_results()
    frames = []
    for frame in results.frames:
        none = np.zeros(frame.contacts.count, bool)
        empty = {name: getattr(frame, name)[none] for name in columns(FrameForces, "contact")}
        history = replace(frame.history, fn=frame.history.fn[:, none], ft=frame.history.ft[:, none])
        frames.append(replace(frame, contacts=frame.contacts.select(none), history=history, **empty))
    save_results(tmp_path / "results.h5", replace(results, frames=frames), ORIGIN)
    tree = open_tree(tmp_path / "results.h5", engine)
    assert tree["forces/fn"].shape == (0,)
    assert tree["contacts/normal"].shape == (0, 2)
    assert tree["contacts/normal"].dims == ("contact", "xy")


@pytest.mark.thorough
def test_a_file_of_tracks_opens(engine, tmp_path):
    results = make_full_results()
    save_tracks(tmp_path / "tracks.h5", "fake", results.tracks, None, ORIGIN)
    tree = open_tree(tmp_path / "tracks.h5", engine)
    assert tree["tracks/position"].dims == ("frame", "grain", "xy")
    assert tree["grain"].values.tolist() == results.tracks.id.tolist()
