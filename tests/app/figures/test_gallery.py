"""Figures for papers: every one is drawn, at the width of a column, and says its units."""

from typing import get_args

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from rodsight.figures.gallery import FigureName, draw_figure, usual_frame, write_figures
from rodsight.figures.page import COLOURS, WIDTHS
from rodsight.notebook.run import Run

from solver.sequence.frame_forces import FrameStatus
from tests.app.recording.fake_results import make_results, make_truth


@pytest.fixture(scope="module")
def results():
    return make_results(4, 8, 7, sweeps=2)


def test_every_figure_has_the_width_of_a_column_and_units(results):
    truth = make_truth(results, np.random.default_rng(0))
    before = dict(matplotlib.rcParams)
    for name in get_args(FigureName):
        for width in ("single", "double"):
            figure = draw_figure(results, name, 2, width=width, truth=truth)
            assert figure.get_size_inches()[0] * 25.4 == pytest.approx(WIDTHS[width])
    labels = [axes.get_xlabel() + axes.get_ylabel() for axes in draw_figure(results, "stress", 2).axes]
    assert all("[kPa]" in each for each in labels)
    assert dict(matplotlib.rcParams) == before  # the user's own settings stay


def test_the_network_shows_every_contact_that_bears_force_and_its_length(results):
    axes, bar = draw_figure(results, "forces", 3).axes
    assert bar.get_ylabel().endswith("[N]")
    (lines,) = (each for each in axes.collections if isinstance(each, LineCollection))
    fn = results.frames[3].fn
    assert len(lines.get_segments()) == np.count_nonzero(fn > 0)
    width = np.asarray(lines.get_linewidths())
    assert np.all(np.diff(width) >= 0)  # strong ones are drawn last
    assert any("mm" in text.get_text() for text in axes.texts)


def test_what_cannot_be_drawn_is_said(results):
    with pytest.raises(ValueError, match="no truth"):
        draw_figure(results, "truth")
    with pytest.raises(ValueError, match="forces, density"):
        draw_figure(results, "network")
    with pytest.raises(IndexError, match="from 0 to 3"):
        draw_figure(results, "forces", 4)


def test_the_usual_frame_is_the_last_settled_one(results):
    status = [each.status for each in results.frames]
    assert status[usual_frame(results)] is FrameStatus.SETTLED
    assert FrameStatus.SETTLED not in status[usual_frame(results) + 1 :]


def test_files_are_written_for_all_that_has_data(results, tmp_path):
    files = write_figures(results, tmp_path / "figures", ("pdf", "svg"))
    assert {each.name for each in files} == {
        f"{name}.{kind}" for name in get_args(FigureName) if name != "truth" for kind in ("pdf", "svg")
    }
    assert (tmp_path / "figures" / "forces.pdf").read_bytes().startswith(b"%PDF")
    text = (tmp_path / "figures" / "density.svg").read_text()
    assert "<text" in text  # letters stay letters
    assert COLOURS[0].lower() in text


def test_a_run_gives_its_figures(results):
    assert Run(results).figure("rose", frame=1).axes[0].name == "polar"
