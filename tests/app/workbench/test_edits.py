"""What a click makes of a rod."""

from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.experiment.experiment import GrainGuess
from rodsight.tracking.detection.clicked_circle import fit_clicked
from rodsight.tracking.walls.inner_edge import Edge
from rodsight.workbench.setup.edits import fit_rod
from rodsight.workbench.setup.walls import bars

SIZE, MIDDLE, LARGE, SMALL = 240, 119.5, 44.0, 32.0
CLASSES = [0.008, 0.011]
PIXEL = CLASSES[1] / LARGE


@pytest.fixture
def disc():
    """A photograph of one bright disc of the larger class."""
    row, column = np.mgrid[:SIZE, :SIZE]
    return (40.0 + 160.0 * np.clip(LARGE + 0.5 - np.hypot(column - MIDDLE, row - MIDDLE), 0.0, 1.0)).astype(np.float32)


def validated(*rods: tuple[float, float, float]):
    columns = np.array(rods, dtype=np.float64).reshape(-1, 3).T
    return SimpleNamespace(
        data={"photographs": {"radii": CLASSES}},
        scale=SimpleNamespace(mean_size=PIXEL),
        rods=GrainGuess(np.arange(len(rods)), *columns) if rods else None,
    )


def test_a_rod_has_the_radius_whose_rim_is_seen(disc):
    x, y, radius = fit_rod(disc, validated(), MIDDLE + 1.0, MIDDLE - 1.0, SMALL)  # type: ignore[arg-type]
    assert (x, y, radius) == pytest.approx((MIDDLE, MIDDLE, LARGE), abs=0.1)


@pytest.mark.parametrize(("gap", "expected"), [(SMALL, SMALL), (LARGE - 2.0, LARGE)])
def test_a_rod_that_is_added_leaves_its_neighbours_room(disc, gap, expected):
    """What is seen farther out is the rim of something else."""
    found = validated((MIDDLE + gap + 30.0, MIDDLE, 30.0))
    assert fit_rod(disc, found, MIDDLE, MIDDLE, LARGE)[2] == pytest.approx(expected, abs=0.1)  # type: ignore[arg-type]


def test_edges_that_no_rod_touches_or_that_cut_rods_are_no_walls(monkeypatch):
    column, row = (each.ravel() for each in np.meshgrid(np.arange(5), np.arange(4)))
    rods = GrainGuess(np.arange(20), 30.0 + 20.0 * column, 30.0 + 20.0 * row, np.full(20, 10.0))
    found = SimpleNamespace(rods=rods, steps={"rods": SimpleNamespace(errors=[])})
    shift = iter([0.5, 6.0, -6.0, 0.5])  # [px] of the edges beyond the rods

    def snap(image, line, reach):
        along = line[1] - line[0]
        outward = np.array([-along[1], along[0]]) / np.hypot(*along)
        return Edge(line + next(shift) * outward, 1.0, np.full(2, 0.1), 100.0)

    monkeypatch.setattr(bars, "find_edge", snap)
    lines = bars.find_walls(np.zeros((130, 150), np.float32), found)
    sides = np.array([float(np.mean(lines[w, :, 1 - w % 2])) for w in range(4)])
    assert np.abs(sides - [100.0, 120.0, 20.0, 20.0]) == pytest.approx([0.5, 0.0, 0.0, 0.5], abs=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("enlarged", [1, 2])
def test_a_circle_drawn_beside_its_rim_snaps_to_it_on_a_large_photograph_too(disc, enlarged):
    large = np.kron(disc, np.ones((enlarged, enlarged), np.float32))
    middle, radius = enlarged * (MIDDLE + 0.5) - 0.5, enlarged * LARGE
    drawn = middle + 0.1 * radius, middle - 0.08 * radius, 0.88 * radius
    near = 0.02 * radius  # sharp edges of whole pixels; the circle was drawn 12 % off
    assert fit_clicked(large, drawn) == pytest.approx((middle, middle, radius), abs=near)
    assert fit_clicked(large, drawn, [0.8 * radius, radius]) == pytest.approx((middle, middle, radius), abs=near)


def test_where_there_is_no_rim_a_circle_stays_as_drawn_and_that_is_known(disc):
    empty = np.full_like(disc, 40.0)
    assert fit_clicked(empty, (MIDDLE, MIDDLE, LARGE)) is None
    assert fit_rod(empty, validated(), MIDDLE, MIDDLE, 40.0) == (MIDDLE, MIDDLE, LARGE)  # type: ignore[arg-type]
