from __future__ import annotations

import hashlib
import json
from dataclasses import replace

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from rodsight.cli.main import main
from rodsight.exchange.tidy_tables import make_events, make_tables, write_tables
from rodsight.solver.frame_forces import FrameStatus

from tests.app.results.full_results import make_full_results


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_tables_read_back_with_every_digit(results, tmp_path, kind):
    write_tables(results, tmp_path, kind)
    read = pyarrow.csv.read_csv if kind == "csv" else pyarrow.parquet.read_table
    contacts = read(tmp_path / f"contacts.{kind}")
    for name in ("fn", "ft", "gap", "nlgs_fn"):
        column = contacts.column(name).to_numpy()
        part = [getattr(f, name, None) if name != "gap" else f.contacts.gap for f in results.frames]
        assert np.array_equal(column, np.concatenate(part))
    grains = read(tmp_path / f"grains.{kind}")
    assert np.array_equal(grains.column("x").to_numpy(), results.tracks.position[:, :, 0].ravel())
    frames = read(tmp_path / f"frames.{kind}")
    assert np.array_equal(frames.column("pressure").to_numpy(), [s.pressure for s in results.statistics])
    assert frames.column("status").to_pylist() == [f.status.name.lower() for f in results.frames]


def test_unknown_values_are_null(with_a_loss):
    tables = make_tables(with_a_loss)
    lost = tables["grains"].column("x").is_null().to_numpy()
    assert np.flatnonzero(lost).tolist() == [2 * 40 + 3, 3 * 40 + 3]
    assert tables["frames"].column("old_unbalance").null_count == 1  # of frame 0


def test_walls_have_their_names_and_columns_their_units(results):
    table = make_tables(results)["contacts"]
    j, wall = np.array(table.column("j")), np.array(table.column("wall").to_pylist())
    assert set(wall[j == -1]) <= set(results.walls.name)
    assert set(wall[j != -1]) == {""}
    assert set(j[j != -1]) <= set(results.tracks.id.tolist())
    assert table.schema.field("fn").metadata == {b"unit": b"N", b"meaning": b"normal force, compression positive"}
    frames = make_tables(results)["frames"]
    force = np.array(frames.column("wall_force_top_y"))
    top = results.walls.name.index("top")
    assert np.array_equal(force, [s.wall_force[top, 1] for s in results.statistics])


def test_recorded_and_inferred_wall_forces_have_different_columns():
    results = make_full_results()
    tables = make_tables(results)
    assert "force_top_x" not in tables["frames"].column_names
    walls = tables["walls"]
    assert results.walls.force is not None
    assert np.array_equal(np.array(walls.column("force_y")), results.walls.force[:, :, 1].ravel())
    inferred = np.concatenate([each.wall_force[:, 1] for each in results.statistics])
    assert np.array_equal(np.array(walls.column("wall_force_y")), inferred)
    assert walls.column("wall").to_pylist()[:4] == list(results.walls.name)


@pytest.mark.slow
def test_the_command_writes_beside_the_results(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    for arguments in (
        ["solve", str(tracked), "--out", str(out), "--set", "solver.sweeps=20", "--quiet"],
        ["export", "tables", str(out)],
        ["export", "vtk", str(out)],
    ):
        with pytest.raises(SystemExit) as end:
            main(arguments)
        assert not end.value.code
    names = {
        "contacts.csv",
        "grains.csv",
        "frames.csv",
        "walls.csv",
        "events.csv",
        "strain_windows.csv",
        "columns.csv",
        "datapackage.json",
        "ro-crate-metadata.json",
    }
    assert {file.name for file in (out / "tables").iterdir()} == names
    crate = json.loads((out / "tables" / "ro-crate-metadata.json").read_text())
    entities = {each["@id"]: each for each in crate["@graph"]}
    assert entities["ro-crate-metadata.json"]["about"] == {"@id": "./"}
    assert {each["@id"] for each in entities["./"]["hasPart"]} == names - {"ro-crate-metadata.json"}
    table = entities["contacts.csv"]
    assert table["sha256"] == hashlib.sha256((out / "tables" / "contacts.csv").read_bytes()).hexdigest()
    assert all(each["@id"] in entities for each in entities["./"]["hasPart"])
    assert (out / "vtk" / "contacts.pvd").is_file()
    with pytest.raises(SystemExit) as end:
        main(["export", "dic", str(out)])
    assert end.value.code == 2
    assert "--pixel-size" in capsys.readouterr().err


def test_kinematics_are_columns_of_rods_and_frames_and_a_table_of_windows(tmp_path):
    results = make_full_results()
    found = results.kinematics
    assert found is not None
    tables = make_tables(results)
    grains = tables["grains"]
    np.testing.assert_array_equal(np.array(grains.column("window_fluctuation_y")), found.fluctuation[..., 1].ravel())
    np.testing.assert_array_equal(np.array(grains.column("window_rotation")), found.rotation.ravel())
    assert grains.schema.field("window_d2min").metadata[b"unit"] == b"m2"
    np.testing.assert_array_equal(np.array(tables["frames"].column("window_gradient_xy")), found.gradient[:, 0, 1])
    write_tables(results, tmp_path)
    windows = pyarrow.csv.read_csv(tmp_path / "strain_windows.csv")
    np.testing.assert_array_equal(np.array(windows.column("window_frames")), found.window_frames)
    np.testing.assert_allclose(np.array(windows.column("window_rms")), found.window_rms)
    assert "strain_windows.csv" in (tmp_path / "columns.csv").read_text()


def test_events_are_listed_with_their_ends_and_reasons(results):
    status = [FrameStatus.RESET, FrameStatus.SETTLING, FrameStatus.SUSPECT, FrameStatus.SUSPECT]
    frames = [
        replace(each, status=kind, reason=kind.name) for each, kind in zip(results.frames[:4], status, strict=True)
    ]
    events = make_events(replace(results, frames=frames))
    assert events.column("frame").to_pylist() == [0, 2]
    assert events.column("last").to_pylist() == [0, 3]
    assert events.column("status").to_pylist() == ["reset", "suspect"]
    assert events.column("reason").to_pylist() == ["RESET", "SUSPECT"]
    steady = [replace(each, status=FrameStatus.SETTLED) for each in results.frames]
    assert len(make_events(replace(results, frames=steady))) == 0
