"""The figures of the paper, from results whose stress and true forces are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import AxesImage
from rodsight.figures.gallery import write_paper_set
from rodsight.figures.paper.paper_set import Picture, draw_apparatus, draw_recorded, draw_strip
from rodsight.figures.paper.recorded_stress import recorded_stress
from rodsight.inference.zero_start import solve_from_zero
from rodsight.results.results import Results, TruthContacts
from rodsight.solver.statistics.stress import friction_angle, love_weber_stress, principal_stresses

from tests.app.recording.fake_results import make_results, make_truth

CONFIGURATION = """
name = "fake"
[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
[walls]
file = "walls.csv"
[walls.top]
pressure = 5e4
"""


@pytest.fixture(scope="module")
def results() -> Results:
    return replace(make_results(6, 8, 7, sweeps=2), configuration=CONFIGURATION)


@pytest.fixture(scope="module")
def truth(results) -> TruthContacts:
    return make_truth(results, np.random.default_rng(0))


@pytest.mark.slow
def test_all_four_figures_are_written(results, truth, tmp_path):
    files = write_paper_set(results, tmp_path / "paper", ("png",), truth=truth)
    assert [each.name for each in files] == ["apparatus.png", "zero_forces.png", "networks.png", "recorded.png"]
    with pytest.raises(IndexError, match="from 0 to 5"):
        write_paper_set(results, tmp_path / "none", ("png",), frame=6)
    assert not (tmp_path / "none").exists()


def test_frames_swept_from_zero_are_in_equilibrium_and_named(results):
    found = list(solve_from_zero(results, [1, 4]))
    assert [each.frame for each in found] == [1, 4]
    for each in found:
        assert each.fn.shape == (each.contacts.count,)
        assert (each.fn >= 0.0).all()
        assert each.fn.any()
        assert -1.0 <= each.agreement <= 1.0


def test_recorded_stress_of_true_forces_is_that_of_the_results(results):
    rows = [(f.frame, f.contacts.i, f.contacts.j, f.fn, f.ft) for f in results.frames]
    own = TruthContacts(
        np.repeat([k for k, *_ in rows], [len(i) for _, i, *_ in rows]).astype(np.int64),
        *(np.concatenate([row[part] for row in rows]).astype(np.int64) for part in (1, 2)),
        *(np.concatenate([row[part] for row in rows]) for part in (3, 4)),
    )
    found = recorded_stress(results, own)
    assert found is not None
    assert found.source == "true forces"
    for each, angle, direction in zip(results.frames, found.friction_angle, found.principal_direction, strict=True):
        position = results.tracks.position[each.frame]
        stress = love_weber_stress(each.contacts, each.fn, each.ft, position, 2.0, 3.0)
        assert angle == pytest.approx(friction_angle(stress), abs=1e-9)
        assert direction == pytest.approx(principal_stresses(stress)[2], abs=1e-9)


def test_forces_on_the_walls_give_the_recorded_stress(results):
    count, walls = len(results.frames), results.walls
    normal = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
    ends = np.array([[[0, 0], [2, 0]], [[2, 0], [2, 1]], [[2, 1], [0, 1]], [[0, 1], [0, 0]]], float)
    stress = np.diag([1.0, 3.0])  # compression: friction angle asin(1/2), σ₁ upright
    length = np.array([2.0, 1.0, 2.0, 1.0])
    force = np.broadcast_to((normal @ stress) * length[:, None], (count, 4, 2))
    square = replace(
        walls, name=("bottom", "right", "top", "left"), endpoints=np.broadcast_to(ends, (count, 4, 2, 2)), force=force,
        pressure=np.full(4, np.nan), load=None, side=None, end_kind=None, sigma=None, plate=None,
    )  # fmt: skip
    found = recorded_stress(replace(results, walls=square), None)
    assert found is not None
    np.testing.assert_allclose(np.rad2deg(found.friction_angle), 30.0)
    np.testing.assert_allclose(np.abs(np.rad2deg(found.principal_direction)), 90.0)
    assert recorded_stress(replace(results, walls=replace(square, force=None)), None) is None


def test_recorded_curves_lie_beside_the_identified_ones(results, truth):
    density, angle, _direction = draw_recorded(results, truth, 3, "double").axes
    assert [text.get_text() for text in angle.get_legend().get_texts()] == ["identified", "true forces"]
    assert "true" in [text.get_text() for text in density.get_legend().get_texts()]
    alone = draw_recorded(results, None, 3, "single").axes[1]
    assert [text.get_text() for text in alone.get_legend().get_texts()] == ["identified"]


def test_photographs_are_shown_with_a_rod_enlarged(results):
    grey = np.linspace(0.0, 1.0, 300).reshape(15, 20)
    pictures = [Picture(frame, grey, (0.0, 0.2, 0.0, 0.15)) for frame in (0, 5)]
    axes = draw_apparatus(results, pictures, "double").axes
    assert sum(isinstance(child, AxesImage) for each in axes for child in each.get_children()) == 3
    assert axes[2].get_title(loc="left").startswith("rod ")
    assert len(draw_apparatus(results, [], "single").axes) == 3


def test_consecutive_networks_end_with_the_frame(results):
    titles = [each.get_title(loc="left") for each in draw_strip(results, 4, "double").axes]
    assert [title.split("\n")[0] for title in titles] == [f"frame {k}" for k in range(5)]
