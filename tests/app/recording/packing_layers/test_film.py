from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.drawing.force_range import ForceRange
from rodsight.recording.archive.share import share_recording
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.film import (
    LONGEST_JOIN,
    PICTURES,
    STRONG,
    STRONG_SWEEPS,
    SWEEP_COLUMNS,
    SWEEP_PICTURES,
    film_bounds,
    film_frames,
    step_across,
)
from rodsight.recording.tabs.layout_property import read_layout

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest, rows

OUTLINE = 8  # lines around the walls, the last ones of a picture


def test_pictures_are_few_and_cover_the_run():
    assert film_frames(3).tolist() == [0, 1, 2]
    chosen = film_frames(200)
    assert len(chosen) == PICTURES
    assert (chosen[0], chosen[-1]) == (0, 199)
    assert np.ptp(np.diff(chosen)) <= 1


def test_columns_leave_space_for_the_names_of_narrow_pictures(recording):
    canvas = read_layout(recording.path).canvas
    narrow = replace(canvas, left=0.0, right=0.2 * canvas.height)
    assert step_across(narrow, 3) == 1.5 * canvas.height
    wide = replace(canvas, left=0.0, right=4.0 * canvas.height)
    assert step_across(wide, 3) == wide.width


def test_a_picture_shows_the_strong_forces_of_its_frame_beside_earlier_pictures(recording, results):
    strong = STRONG * ForceRange.of(results.frames).mean
    (left, right), (top, bottom) = film_bounds(read_layout(recording.path).canvas, 3)
    middles = []
    for frame in range(4):
        picture = rows(recording.path, f"{entities.FILM_FRAMES}/{frame}")[-1]
        lines = np.array(picture["LineStrips2D:strips"])
        assert len(lines) - OUTLINE == np.sum(results.frames[frame].fn > strong)
        when, strain, trust = picture["Points2D:labels"]
        assert when == f"frame {frame} · {results.tracks.time[frame]:.4g} s"
        assert strain
        assert trust.startswith(results.frames[frame].status.name.lower())
        assert lines[..., 0].min() > left
        assert lines[..., 0].max() < right
        assert lines[..., 1].min() > top
        assert lines[..., 1].max() < bottom
        middles.append(lines[-OUTLINE:].mean(axis=(0, 1)))
        here = latest(recording.path, entities.FILM_PLACE, entities.FRAME, frame)["LineStrips2D:strips"]
        assert np.allclose(np.array(here), lines[-OUTLINE:])
    across, down = (np.diff(np.array(middles), axis=0)).T
    assert np.all(across[:2] > 0.3 * (right - left) * 0.9)  # three in a row
    assert np.allclose(down[:2], 0.0, atol=1.0)
    assert down[2] > 0.8 * (bottom - top) / 3  # the fourth is below the first


def test_the_film_of_sweeps_ends_with_the_reported_forces(recording, results):
    shown = latest(recording.path, entities.FILM_SWEEPS, entities.FRAME, 1)
    assert shown["Points2D:labels"][-1] == "reported"
    assert len(shown["Points2D:labels"]) == SWEEP_PICTURES
    strong = STRONG_SWEEPS * ForceRange.of(results.frames).mean
    below = np.array(shown["Points2D:positions"])[-1]
    lines = np.array(shown["LineStrips2D:strips"][: -OUTLINE * SWEEP_PICTURES])
    across = step_across(read_layout(recording.path).canvas, SWEEP_COLUMNS)
    inside = (lines[..., 1] > below[1]) & (np.abs(lines[..., 0] - below[0]) < 0.5 * across)
    assert inside.all(axis=1).sum() == np.sum(results.frames[1].fn > strong)


@pytest.mark.thorough
def test_a_shared_recording_has_only_the_pictures_of_its_frames(recording, tmp_path):
    path = share_recording(recording.path, tmp_path / "small.rrd", first=1, stop=3).path
    there = [frame for frame in range(4) if rows(path, f"{entities.FILM_FRAMES}/{frame}")]
    assert there == [1, 2]


@pytest.mark.thorough
def test_the_films_are_small(tmp_path):
    results = make_results(6, 16, 14, sweeps=300)
    path = write_recording(results, tmp_path / "run.rrd").path
    stacked = sum(
        np.asarray(row[name]).nbytes
        for entity in (entities.FILM_SWEEPS, *(f"{entities.FILM_FRAMES}/{k}" for k in range(6)))
        for row in rows(path, entity)
        for name in ("LineStrips2D:radii", "LineStrips2D:colors")
        if name in row
    )
    drawn = sum(
        np.asarray(row["LineStrips2D:radii"]).nbytes
        for row in rows(path, entities.FORCES)
        if "LineStrips2D:radii" in row
    )
    assert stacked < 0.2 * drawn


def test_walls_that_do_not_follow_one_another_are_not_joined_across_the_packing(tmp_path):
    results = make_results()
    order = np.array([0, 2, 1, 3])  # bottom, top, right, left: as the halves of a shear box, in no ring
    walls = replace(results.walls, endpoints=results.walls.endpoints[:, order])
    write_recording(replace(results, walls=walls), tmp_path / "run.rrd")
    lines = np.array(latest(tmp_path / "run.rrd", entities.FILM_PLACE, entities.FRAME, 0)["LineStrips2D:strips"])
    length = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    assert np.sum(length > LONGEST_JOIN * read_layout(tmp_path / "run.rrd").canvas.grain_radius) == 4
