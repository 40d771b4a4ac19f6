"""Files for OVITO follow the rules of its reader, and are read by the package where it is installed."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from rodsight.exchange.ovito_files import write_ovito

from tests.app.exchange.test_vtk_polydata import arrays


def test_both_ends_of_every_contact_are_consecutive_particles(with_a_loss, tmp_path):
    files = write_ovito(with_a_loss, tmp_path)
    assert len(files) == len(with_a_loss.frames)
    for frame in range(len(files)):
        particles = tmp_path / f"particles_{frame:04d}.vtp"
        points, ids = arrays(particles, "Points")["points"], arrays(particles, "PointData")["id"]
        assert len(set(ids)) == len(ids)
        position = dict(zip(ids, points[:, :2], strict=True))
        contacts = tmp_path / f"contacts_{frame:04d}.vtp"
        ends = arrays(contacts, "Points")["points"].reshape(-1, 2, 3)
        data = arrays(contacts, "CellData")
        for k, (one, two) in enumerate(zip(data["id1"], data["id2"], strict=True)):
            assert np.array_equal(ends[k, 0, :2], position[one])
            assert np.array_equal(ends[k, 1, :2], position[two])
    lost = with_a_loss.tracks.id[3]
    assert lost not in arrays(tmp_path / "particles_0002.vtp", "PointData")["id"]


def test_the_piece_is_the_first_element(results, tmp_path):
    for file in write_ovito(results, tmp_path):
        for each in ET.parse(file).getroot().iter("DataSet"):
            part = ET.parse(tmp_path / str(each.get("file"))).getroot().find("PolyData")
            assert part is not None
            assert part[0].tag == "Piece"


def test_ovito_shows_grains_and_forces(results, tmp_path):
    ovito = pytest.importorskip("ovito.io", reason="the ovito package is not installed")
    write_ovito(results, tmp_path)
    pipeline = ovito.import_file(str(tmp_path / "frame_*.vtm"))
    assert pipeline.source.num_frames == len(results.frames)
    data = pipeline.compute(3)
    forces = results.frames[3]
    grains = data.particles["wall_contact"][...] == 0
    assert np.array_equal(data.particles["Particle Identifier"][...][grains], results.tracks.id)
    np.testing.assert_allclose(data.particles["Radius"][...][grains], results.tracks.radius, rtol=1e-6)
    (lines,) = data.lines.values()
    np.testing.assert_allclose(lines["fn"][...][::2], forces.fn, rtol=1e-6)  # of both ends of every line
    size = np.linalg.norm(lines["contact_force"][...][::2], axis=1)
    np.testing.assert_allclose(size, np.hypot(forces.fn, forces.ft), rtol=1e-6, atol=1e-9)
