"""Figures for papers: each is drawn at the width of a column, with units."""

from dataclasses import replace
from typing import get_args

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from rodsight.drawing.accumulated_strain import accumulated_strains
from rodsight.figures.contact_sheet import sheet_frames
from rodsight.figures.figure_style import COLOURS, WIDTHS
from rodsight.figures.force_network import branch_lines
from rodsight.figures.gallery import NEED_TRUTH, FigureName, default_frame, draw_figure, write_figures
from rodsight.notebook.run import Run
from rodsight.solver.frame_forces import FrameStatus
from rodsight.solver.kinematics.sequence_kinematics import measure_kinematics

from tests.app.recording.fake_results import make_results, make_truth, with_fringes
from tests.app.recording.look.colour_vision import VISIONS, cie76

VISIBLE = 20.0  # CIE76 difference from the paper


@pytest.fixture(scope="module")
def results():
    made = make_results(4, 8, 7, sweeps=2)
    tracks = made.tracks
    found = measure_kinematics(tracks.position, tracks.rotation, tracks.radius, tracks.sigma)
    return with_fringes(replace(made, read_kinematics=lambda: found))


def test_fringes_that_are_not_there_are_not_drawn(results):
    with pytest.raises(ValueError, match="no fringes"):
        draw_figure(replace(results, fringes=None), "fringes")


@pytest.mark.slow
def test_every_figure_has_the_width_of_a_column_and_units(results):
    truth = make_truth(results, np.random.default_rng(0))
    before = dict(matplotlib.rcParams)
    for name in get_args(FigureName):
        for width in ("single", "double"):
            figure = draw_figure(results, name, 2, width=width, truth=truth)
            assert figure.get_size_inches()[0] * 25.4 == pytest.approx(WIDTHS[width])
    labels = [axes.get_xlabel() + axes.get_ylabel() for axes in draw_figure(results, "stress", 2).axes]
    assert all("[kPa]" in each for each in labels)
    assert dict(matplotlib.rcParams) == before  # the settings of the user are unchanged


def test_forces_of_open_scale_have_no_newtons(results):
    walls = replace(results.walls, pressure=np.full(results.walls.count, np.nan))
    axes, bar = draw_figure(replace(results, walls=walls), "forces", 3).axes
    assert bar.get_ylabel().endswith("[a.u.]")
    assert [each.get_text() for each in axes.texts if each.get_text().endswith(" a.u.")]


def test_the_network_shows_every_contact_that_bears_force_and_its_length(results):
    axes, bar = draw_figure(results, "forces", 3).axes
    assert bar.get_ylabel().endswith("[N]")
    lines = next(each for each in axes.collections if isinstance(each, LineCollection))
    fn = results.frames[3].fn
    assert len(lines.get_segments()) == np.count_nonzero(fn > 0)
    width = np.asarray(lines.get_linewidths())
    assert np.all(np.diff(width) >= 0)  # strong forces are drawn last
    assert any("mm" in text.get_text() for text in axes.texts)


def test_a_figure_that_cannot_be_drawn_raises(results):
    with pytest.raises(ValueError, match="no truth"):
        draw_figure(results, "truth")
    with pytest.raises(ValueError, match="forces, density"):
        draw_figure(results, "network")
    with pytest.raises(IndexError, match="from 0 to 3"):
        draw_figure(results, "forces", 4)
    with pytest.raises(ValueError, match="no kinematics"):
        draw_figure(replace(results, read_kinematics=lambda: None), "kinematics")


def test_the_default_frame_is_the_last_settled_one(results):
    status = [each.status for each in results.frames]
    assert status[default_frame(results)] is FrameStatus.SETTLED
    assert FrameStatus.SETTLED not in status[default_frame(results) + 1 :]


@pytest.mark.slow
def test_files_are_written_for_all_figures_with_data(results, tmp_path):
    files = write_figures(results, tmp_path / "figures", ("pdf", "svg"))
    assert {each.name for each in files} == {
        f"{name}.{kind}" for name in get_args(FigureName) if name not in NEED_TRUTH for kind in ("pdf", "svg")
    }
    earlier = write_figures(replace(results, read_kinematics=lambda: None), tmp_path / "earlier", ("png",))
    assert "kinematics.png" not in {each.name for each in earlier}
    assert (tmp_path / "figures" / "forces.pdf").read_bytes().startswith(b"%PDF")
    text = (tmp_path / "figures" / "density.svg").read_text()
    assert "<text" in text  # texts are not converted to outlines
    assert COLOURS[0].lower() in text


def test_a_run_gives_its_figures(results):
    assert Run(results).figure("rose", frame=1).axes[0].name == "polar"


def test_the_network_states_time_shear_status_trust_and_the_force_of_a_line(results):
    axes = draw_figure(results, "forces", 3).axes[0]
    forces = results.frames[3]
    title = axes.get_title(loc="left")
    assert f"{results.tracks.time[3]:.4g} s" in title
    assert forces.status.name.lower() in title
    assert f"trust {forces.trust:.2f}" in title
    shown = [text.get_text() for text in axes.texts]
    assert any(text.endswith(" N") for text in shown)
    assert any(text.endswith("mm") for text in shown)


@pytest.fixture(scope="module")
def colours_of_lines(results):
    """Relative deviations of bearing contacts, and the colours along the lines of the drawn picture (c, 81, 3)."""
    forces = results.frames[3]
    bearing = forces.fn > 0
    sd = np.zeros_like(forces.fn)
    relative = np.random.default_rng(5).permutation(np.geomspace(0.08, 1.2, int(bearing.sum())))  # as on the sample
    sd[bearing] = relative * forces.fn[bearing]
    frames = [replace(each, fn_sd=sd) if each is forces else each for each in results.frames]
    figure = draw_figure(replace(results, frames=frames), "forces", 3, width="double")
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    axes = figure.axes[0]
    fraction = np.linspace(0.1, 0.9, 81)[:, None]
    colours = []
    for start, end in branch_lines(results, 3, forces.contacts)[bearing]:
        x, y = np.rint(axes.transData.transform(start + fraction * (end - start))).astype(int).T
        colours.append(picture[len(picture) - 1 - y, x])
    return relative, np.array(colours)


@pytest.mark.parametrize("vision", VISIONS)
def test_the_surest_and_the_least_sure_third_differ_at_a_glance(colours_of_lines, vision):
    """In the drawn picture itself, along its lines, in grey and every kind of colour vision."""
    relative, colours = colours_of_lines
    ink = np.array(
        [np.mean([cie76(tuple(c), (255, 255, 255), vision) > VISIBLE for c in line]) for line in colours.tolist()]
    )
    order = np.argsort(relative)
    third = len(order) // 3
    surest, least = ink[order[:third]], ink[order[-third:]]
    separated = np.mean(surest[:, None] > least[None, :])
    assert separated > 0.95
    assert np.median(surest) - np.median(least) > 0.35  # at a glance


def test_the_difference_of_two_fields_is_a_map(results):
    truth = make_truth(results, np.random.default_rng(0))
    axes = draw_figure(results, "difference", 2, truth=truth).axes[0]
    drawn = [each for each in axes.collections if isinstance(each, LineCollection)]
    assert len({tuple(colour) for colour in drawn[0].get_colors()}) == 2  # more and less
    assert "r(f" in axes.get_title(loc="left")
    same = draw_figure(results, "difference", 2, against=results).axes[0]
    widths = [each.get_linewidths() for each in same.collections if isinstance(each, LineCollection)]
    assert np.ptp(widths[0]) == 0.0  # no difference


def test_the_contact_sheet_shows_every_beginning_of_an_event_and_evenly_spaced_frames(results):
    kinds = [FrameStatus.SETTLED] * 40
    for k in (0, 17, 18, 31):
        kinds[k] = FrameStatus.SUSPECT
    kinds[5] = FrameStatus.FAILED
    frames = [replace(results.frames[1], frame=k, status=kind) for k, kind in enumerate(kinds)]
    chosen = sheet_frames(replace(results, frames=frames), 10)
    assert {0, 17, 31} <= set(chosen)
    assert 18 not in chosen or len(chosen) == 10
    assert 5 not in chosen
    assert len(chosen) == 10
    assert max(np.diff(chosen)) < 10


def test_the_curves_have_an_axis_of_strain(results):
    axes = draw_figure(results, "time", 2).axes[0]
    (top,) = axes.child_axes
    assert top.get_xlabel() == "accumulated strain [%]"
    strains = 100.0 * np.array(accumulated_strains([each.strain for each in results.frames]))
    of_time = top._functions[0]  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(of_time(results.tracks.time), strains, atol=1e-6)
    assert of_time(results.tracks.time[0] - 1.0) < 0.0
