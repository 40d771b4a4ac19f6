from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from rodsight.exchange.vtk_polydata import write_polydata


def arrays(file: Path, element: str) -> dict[str, np.ndarray]:
    """Read the arrays of an element of a file."""
    part = ET.parse(file).getroot().find(f"PolyData/Piece/{element}")
    assert part is not None
    found = {}
    for each in part.findall("DataArray"):
        values = np.array((each.text or "").split(), float)
        width = int(each.get("NumberOfComponents", "1"))
        found[str(each.get("Name"))] = values.reshape(-1, width) if width > 1 else values
    return found


def test_contacts_read_back_with_every_digit(results, tmp_path):
    write_polydata(results, tmp_path)
    for frame, forces in enumerate(results.frames):
        file = tmp_path / f"contacts_{frame:04d}.vtp"
        piece = ET.parse(file).getroot().find("PolyData/Piece")
        assert piece is not None
        assert piece.get("NumberOfLines") == str(forces.contacts.count)
        data = arrays(file, "CellData")
        assert np.array_equal(data["fn"], forces.fn)
        assert np.array_equal(data["ft"], forces.ft)
        points, lines = arrays(file, "Points")["points"], arrays(file, "Lines")
        assert points.shape == (2 * forces.contacts.count, 3)
        ends = points[lines["connectivity"].astype(int).reshape(-1, 2), :2]
        assert np.array_equal(ends[:, 0], results.tracks.position[frame][forces.contacts.i])
        assert lines["offsets"].tolist() == (2 * np.arange(1, forces.contacts.count + 1)).tolist()
        branch = ends[:, 1] - ends[:, 0]
        along = np.einsum("ck,ck->c", branch, forces.contacts.normal)
        assert np.all(along > 0.0)


def test_tubes_of_forces_lie_in_front_of_the_spheres_of_rods_and_have_point_data(results, tmp_path):
    """Lines within a sphere would be hidden, and the filter Tube scales by point data."""
    write_polydata(results, tmp_path)
    file = tmp_path / "contacts_0003.vtp"
    position, fn = arrays(file, "Points")["points"], arrays(file, "PointData")["fn"]
    lines = arrays(file, "Lines")["connectivity"].astype(int).reshape(-1, 2)
    assert np.array_equal(fn[lines], np.repeat(results.frames[3].fn[:, None], 2, axis=1))
    grains = tmp_path / "grains_0003.vtp"
    top = arrays(grains, "Points")["points"][:, 2] + arrays(grains, "PointData")["radius"]
    assert position[:, 2].min() >= top.max()


def test_grains_that_are_lost_are_not_drawn(with_a_loss, tmp_path):
    write_polydata(with_a_loss, tmp_path)
    ids = arrays(tmp_path / "grains_0002.vtp", "PointData")["id"]
    assert with_a_loss.tracks.id[3] not in ids
    assert len(ids) == with_a_loss.grains.count - 1
    assert np.isfinite(arrays(tmp_path / "grains_0002.vtp", "Points")["points"]).all()


def test_the_collections_have_the_times_and_name_existing_files(results, tmp_path):
    for collection in write_polydata(results, tmp_path):
        rows = ET.parse(collection).getroot().findall("Collection/DataSet")
        assert [float(row.get("timestep", "nan")) for row in rows] == results.tracks.time.tolist()
        assert all((tmp_path / str(row.get("file"))).is_file() for row in rows)


def test_one_animation_shows_grains_contacts_and_walls(results, tmp_path):
    """Read the files with pyvista, which uses ParaView's reader."""
    pyvista = pytest.importorskip("pyvista", reason="pyvista, ParaView's reader, is not installed")
    write_polydata(results, tmp_path)
    reader = pyvista.get_reader(tmp_path / "packing.pvd")
    assert reader.time_values == results.tracks.time.tolist()
    reader.set_active_time_value(reader.time_values[3])
    (blocks,) = reader.read()
    forces = results.frames[3]
    assert blocks.keys() == ["grains", "contacts", "walls"]
    assert blocks["grains"].n_points == results.grains.count
    assert blocks["contacts"].n_lines == forces.contacts.count
    assert np.array_equal(blocks["contacts"]["fn"], forces.fn)
    vectors = np.einsum("ck,ck->c", blocks["contacts"]["force"][:, :2], forces.contacts.normal)
    np.testing.assert_allclose(vectors, forces.fn, atol=1e-9)
    assert blocks["grains"]["stress"].shape == (results.grains.count, 9)
    assert blocks["walls"].n_lines == results.walls.count
