"""The boundary of a packing is drawn: a periodic cell with contacts in two halves, and boundary grains."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.look.colours import BOUNDARY, packed_one
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.tracks import WallTracks

from tests.app.recording.fake_results import RADIUS, make_results
from tests.app.recording.rows import latest


@pytest.fixture(scope="module")
def in_cell():
    """Return the synthetic packing in a cell of its size, with contacts across the edges."""
    results = make_results(2, sweeps=0, recorded=np.empty(0, int))
    f = results.tracks.frame_count
    extent = np.ptp(results.tracks.position[0], axis=0) + 2.0 * RADIUS
    cell = np.repeat(np.diag(extent)[None], f, axis=0)
    cell[:, 1, 0] = np.arange(f) * 0.1 * RADIUS
    walls = WallTracks((), np.empty((f, 0, 2, 2)), np.empty(0), cell=cell)
    frames = []
    for k, frame in enumerate(results.frames):
        fixed = Walls.at_rest(np.empty((0, 2, 2)), cell=cell[k])
        found = detect_contacts(
            results.grains, results.tracks.position[k], results.tracks.present[k], fixed, 0.5 * RADIUS
        )
        rows = np.arange(found.count) % frame.contacts.count
        columns = {
            name: getattr(frame, name)[rows]
            for name in ("fn", "ft", "nlgs_fn", "nlgs_ft", "un", "ut", "state", "age", "source", "probability", "fn_sd",
                         "ft_sd")
        }  # fmt: skip
        history = replace(frame.history, fn=np.empty((0, found.count)), ft=np.empty((0, found.count)))
        frames.append(replace(frame, contacts=found, history=history, bearing_probability=None, **columns))
    no_walls = {"wall_force": np.empty((0, 2)), "wall_normal_force": np.empty(0), "wall_tangential_force": np.empty(0)}
    statistics = [replace(each, **no_walls) for each in results.statistics]
    return replace(results, walls=walls, frames=frames, statistics=statistics)


def test_contacts_across_the_edge_are_two_halves_and_no_line_crosses_the_picture(in_cell, tmp_path):
    write_recording(in_cell, tmp_path / "cell.rrd")
    longest = 0.0
    for entity in (entities.FORCES, entities.FORCES_ACROSS):
        strips = np.array(latest(tmp_path / "cell.rrd", entity, entities.FRAME, 1)["LineStrips2D:strips"])
        longest = max(longest, float(np.linalg.norm(strips[:, 1] - strips[:, 0], axis=1).max()))
    shift = in_cell.frames[1].contacts.shift
    assert len(strips) >= np.any(shift != 0.0, axis=1).sum() > 0
    outline = np.array(latest(tmp_path / "cell.rrd", entities.CELL, entities.FRAME, 1)["LineStrips2D:strips"])[0]
    assert outline.shape == (5, 2)
    assert longest < 0.5 * np.ptp(outline, axis=0).max()


def test_boundary_grains_have_a_distinct_colour(tmp_path):
    results = make_results(1, sweeps=0, recorded=np.empty(0, int))
    boundary = np.arange(results.grains.count) % 3 == 0
    write_recording(replace(results, tracks=replace(results.tracks, boundary=boundary)), tmp_path / "b.rrd")
    colours = np.array(latest(tmp_path / "b.rrd", entities.GRAINS, entities.FRAME, 0)["Ellipses2D:colors"])
    assert ((colours == packed_one(BOUNDARY)) == (boundary & results.tracks.present[0])).all()
