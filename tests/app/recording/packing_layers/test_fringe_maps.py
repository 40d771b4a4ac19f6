"""Fringes beside the forces in a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.tabs.blueprint import RecordingLayout, Tab, make_blueprint
from rodsight.recording.tabs.layout_property import read_layout

from tests.app.recording.fake_results import make_results, with_fringes
from tests.app.recording.rows import latest, rows


def colours_of(path, quantity: str, frame: int) -> list[int]:
    return latest(path, f"{entities.FRINGE_MAPS}/{quantity}", entities.FRAME, frame)["Points2D:colors"]


def lightness(colours: list[int]) -> np.ndarray:
    red, green, blue = (np.array(colours) >> shift & 0xFF for shift in (24, 16, 8))
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_discs_are_as_bright_as_their_sums_and_the_residual_shows_which_is_greater(tmp_path):
    results = with_fringes(make_results(3, sweeps=2))
    found = results.fringes
    other = found.measured.copy()
    least, greatest = found.inferred[1].argmin(), found.inferred[1].argmax()
    other[1, least], other[1, greatest] = 3.0 * found.mean, 0.0
    path = write_recording(replace(results, fringes=replace(found, measured=other)), tmp_path / "run.rrd").path
    by_forces = lightness(colours_of(path, entities.BY_FORCES, 1))
    order = np.argsort(found.inferred[1])
    assert by_forces[order[-5:]].min() > by_forces[order[:5]].max()
    residual = lightness(colours_of(path, entities.FRINGE_RESIDUAL, 1))
    assert residual[least] == residual.max()
    assert residual[greatest] == residual.min()


def test_the_plot_has_every_disc_of_its_frame_and_the_curve_its_correlation(tmp_path):
    results = with_fringes(make_results(3, sweeps=2))
    results.tracks.fringes[2, 7] = np.nan
    path = write_recording(results, tmp_path / "run.rrd").path
    count = [len(latest(path, entities.FRINGES_OF_FRAME, entities.FRAME, k)["Points2D:positions"]) for k in (1, 2)]
    assert count == [results.tracks.grain_count, results.tracks.grain_count - 1]
    found = [row["Scalars:scalars"][0] for row in rows(path, entities.FRINGE_CORRELATION) if "Scalars:scalars" in row]
    assert found == pytest.approx(results.fringes.correlation.tolist())


def test_the_fringes_share_the_place_of_the_forces_and_can_be_in_front(tmp_path):
    path = write_recording(with_fringes(make_results(2, sweeps=2)), tmp_path / "run.rrd").path
    layout = read_layout(path)
    assert layout.fringes
    root = make_blueprint(layout, active=Tab.FRINGES).root_container
    names = [each.name for each in root.contents]
    assert Tab.FRINGES not in names
    assert root.active_tab == names.index(Tab.FORCES)
    forces = root.contents[root.active_tab]
    assert forces.contents[forces.active_tab].name == Tab.FRINGES
    plain = replace(layout, fringes=False)
    assert isinstance(plain, RecordingLayout)
    with pytest.raises(ValueError, match="no tab Fringes"):
        make_blueprint(plain, active=Tab.FRINGES)
