"""Discs that detection has missed are added in the sizes of those found, and nothing else."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.pictures.picture_file import read_photograph
from rodsight.experiment.reading.tables import read_table
from rodsight.tracking.detection.detect import Detection
from rodsight.tracking.outline.missing_discs import add_missing_discs
from rodsight.tracking.outline.rim_image import RimImage
from rodsight.tracking.outline.rim_kernels import QUALITY, VIEW

from tests.app.tracking.outline.discs import KINDS, WHITE, Light, lay_row_by_row, photograph_discs

SAMPLE = Path(__file__).parents[4] / "sample_data" / "shear"
RADII = (13.0, 18.0)  # [px]
SHAPE = (420, 420)
MISSED = np.array([3, 17, 44, 55, 56, 71, 90])


def detection_of(x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> Detection:
    return Detection(x, y, radius, np.full(len(x), 0.1), np.full(len(x), 0.9))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", list(KINDS))
def test_missed_discs_are_added_with_their_sizes(kind: str) -> None:
    x, y, radius = lay_row_by_row(10, 10, RADII)
    force = np.random.default_rng(3).uniform(0.2, 1.5, len(x))
    image = photograph_discs(KINDS[kind], SHAPE, x, y, radius, force, 1)
    known = ~np.isin(np.arange(len(x)), MISSED)
    found = add_missing_discs(image, detection_of(x[known], y[known], radius[known]))
    assert found.count == len(x)
    assert (np.diff(found.y) >= 0.0).all()
    for row in MISSED:
        nearest = np.hypot(found.x - x[row], found.y - y[row]).argmin()
        assert np.hypot(found.x[nearest] - x[row], found.y[nearest] - y[row]) < 1.0
        assert found.radius[nearest] == radius[row]


@pytest.mark.parametrize("kind", list(KINDS))
def test_nothing_is_added_where_no_disc_is(kind: str) -> None:
    x, y, radius = lay_row_by_row(10, 10, RADII)
    there = ~np.isin(np.arange(len(x)), MISSED)  # holes as large as a disc
    discs = x[there], y[there], radius[there]
    image = photograph_discs(KINDS[kind], SHAPE, *discs, np.full(there.sum(), 0.8), 1)
    given = detection_of(*discs)
    found = add_missing_discs(image, given)
    assert found.count == given.count


def test_discs_without_sizes_stay_as_they_are() -> None:
    x, y, _ = lay_row_by_row(10, 10, RADII)
    given = detection_of(x, y, np.linspace(5.0, 20.0, len(x)))
    found = add_missing_discs(np.zeros(SHAPE, np.float32), given)
    for each in fields(Detection):
        np.testing.assert_array_equal(getattr(found, each.name), getattr(given, each.name))


def with_a_hole(faint: float = 0.0) -> tuple[np.ndarray, Detection]:
    """Discs but one, and those detected; faint: contrast of a disc in the hole, as a fraction of the others'."""
    x, y, radius = lay_row_by_row(10, 10, RADII)
    hole = np.arange(len(x)) == MISSED[2]
    image = photograph_discs(WHITE, SHAPE, x[~hole], y[~hole], radius[~hole], np.zeros((~hole).sum()), 1)
    light = Light(WHITE.outside + faint * (WHITE.inside - WHITE.outside), WHITE.outside)
    inside = photograph_discs(light, SHAPE, x[hole], y[hole], radius[hole], np.zeros(1), 2)
    return np.maximum(image, inside), detection_of(x[~hole], y[~hole], radius[~hole])


@pytest.mark.parametrize(("faint", "added"), [(0.95, 1), (0.25, 0)])
def test_a_rim_must_be_nearly_as_strong_as_those_of_its_size(faint: float, added: int) -> None:
    image, given = with_a_hole(faint)
    assert add_missing_discs(image, given).count == given.count + added


@pytest.mark.parametrize(("faint", "added"), [(0.95, 1), (0.25, 0)])
def test_a_weak_ring_is_no_disc_however_complete_its_edge(
    faint: float, added: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    image, given = with_a_hole(faint)
    measure = RimImage.measure

    def complete(self: RimImage, *given: np.ndarray) -> np.ndarray:
        found = np.nan_to_num(measure(self, *given), nan=0.1)
        found[:, [QUALITY, VIEW]] = 1.0
        return found

    monkeypatch.setattr(RimImage, "measure", complete)
    assert add_missing_discs(image, given).count == given.count + added


@pytest.mark.parametrize("column", [QUALITY, VIEW])
def test_a_disc_needs_an_edge_and_a_view_of_its_rim(column: int, monkeypatch: pytest.MonkeyPatch) -> None:
    image, given = with_a_hole(0.95)
    measure = RimImage.measure

    def hidden(self: RimImage, *given: np.ndarray) -> np.ndarray:
        found = measure(self, *given).copy()
        found[:, column] = 0.25
        return found

    monkeypatch.setattr(RimImage, "measure", hidden)
    assert add_missing_discs(image, given).count == given.count


@pytest.mark.thorough
def test_nothing_is_added_to_painted_rods_or_on_painted_bars() -> None:
    image = read_photograph(SAMPLE / "photos" / "0000.jpg")
    table = read_table(SAMPLE / "grains.csv", ("x", "y", "radius"))
    rods = detection_of(*(table.numbers(name) for name in ("x", "y", "radius")))
    assert add_missing_discs(image, rods).count == rods.count == 250
