from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.forces.contact_colours import COLOURINGS
from rodsight.recording.packing_layers.grain_maps.kinematic_maps import ARROW, MICRO
from rodsight.recording.packing_layers.residual_maps import changes_per_sweep, residual_colours
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.statistics.balance import grain_unbalance, resultant_norms

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest, rows

ROUNDING = 1e-12
DIGITS = 0.01  # relative error of two numbers of three digits


def test_the_unbalance_of_every_sweep_is_that_of_its_forces():
    results = make_results(1, sweeps=5)
    forces = results.frames[0]
    weightless, present = np.zeros((results.grains.count, 2)), np.ones(results.grains.count, bool)
    found = resultant_norms(forces.contacts, forces.history.fn, forces.history.ft, weightless)
    for row in range(5):
        fn, ft = forces.history.fn[row].astype(float), forces.history.ft[row].astype(float)
        alone = grain_unbalance(forces.contacts, fn, ft, weightless, present)
        assert np.allclose(found[row] / fn[fn > 0].mean(), alone, rtol=ROUNDING)


def test_a_compressed_grain_is_dark_and_its_neighbours_are_bright():
    contacts = Contacts(
        np.array([0, 1], np.int32), np.array([1, 2], np.int32), np.zeros(2), np.array([[1.0, 0.0], [1.0, 0.0]]),
        np.zeros((2, 2)), 3, 0,
    )  # fmt: skip
    found = resultant_norms(contacts, np.array([[7.0, 7.0]]), np.zeros((1, 2)), np.zeros((3, 2)))
    assert found.tolist() == [[7.0, 0.0, 7.0]]
    dark, bright = residual_colours(np.array([0.0, 1.0]))
    assert dark != bright


def test_greater_residuals_are_brighter_and_unknown_ones_faint():
    colours = residual_colours(np.array([1e-9, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 9.0, np.nan]))
    assert colours[0] == colours[1]
    assert colours[5] == colours[6]
    assert len(set(colours[:6].tolist())) == 5
    assert colours[7] & 0xFF < 255
    red, green, blue = (colours[1:6] >> shift & 0xFF for shift in (24, 16, 8))
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    assert np.all(np.diff(luminance) > 0)


def test_maps_change_with_the_sweeps_and_end_with_the_reported_field(tmp_path):
    results = make_results(2, sweeps=40)
    path = write_recording(results, tmp_path / "run.rrd").path
    frame = results.frames[0]
    early = latest(path, entities.CHANGE_MAP, entities.SWEEP, 1)["LineStrips2D:colors"]
    late = latest(path, entities.CHANGE_MAP, entities.SWEEP, 39)["LineStrips2D:colors"]
    end = latest(path, entities.CHANGE_MAP, entities.SWEEP, 40)["LineStrips2D:colors"]
    assert early != late
    mean, history = frame.fn[frame.fn > 0].mean(), frame.history
    step = np.hypot(history.fn[39] - history.fn[38], history.ft[39] - history.ft[38]) / mean
    assert late == end == residual_colours(100.0 * step).tolist()  # a hundredth of the range of the unbalance
    grains = latest(path, entities.UNBALANCE_MAP, entities.FRAME, 0)["Points2D:colors"]
    weightless, present = np.zeros((results.grains.count, 2)), results.tracks.present[0]
    unbalance = grain_unbalance(frame.contacts, frame.fn, frame.ft, weightless, present)
    assert grains == residual_colours(unbalance).tolist()


def test_a_change_between_distant_sweeps_is_the_mean_per_sweep():
    fn = np.array([[1.0, 5.0], [4.0, 5.0], [4.0, 15.0]])
    ft = np.array([[0.0, 2.0], [4.0, 2.0], [4.0, 2.0]])
    found = changes_per_sweep(np.array([0, 1, 11]), fn, ft)
    assert found.tolist() == [[5.0, 0.0], [0.0, 1.0]]


def test_probabilities_are_shown_per_contact_and_counted(tmp_path):
    results = make_results(1)
    frame = results.frames[0]
    probability = np.linspace(0.0, 1.0, frame.contacts.count)
    path = write_recording(
        replace(results, frames=[replace(frame, probability=probability)]), tmp_path / "run.rrd"
    ).path
    shown = latest(path, entities.FORCES, entities.FRAME, 0)
    assert shown["by_touching:colors"] == COLOURINGS["touching"].colours(probability).tolist()
    assert np.allclose(shown["probability"], probability, atol=1e-7)  # float32
    expected = latest(path, entities.EXPECTED_COUNT, entities.FRAME, 0)["Scalars:scalars"]
    assert expected == pytest.approx([probability.sum()])


def test_every_wall_has_one_curve_with_its_name(recording, results):
    shown = latest(recording.path, entities.WALL_NORMAL_FORCE, entities.FRAME, 1)
    names = [
        row["SeriesLines:names"]
        for row in rows(recording.path, entities.WALL_NORMAL_FORCE)
        if "SeriesLines:names" in row
    ]
    assert list(results.walls.name) in names
    assert np.allclose(shown["Scalars:scalars"], results.statistics[1].wall_normal_force)


def test_the_arrows_of_the_fluctuations_state_their_enlargement(recording, results):
    text = rows(recording.path, entities.FLUCTUATION_LEGEND)[-1]["Points2D:labels"][0]
    found = re.fullmatch(r"arrows × ([\d.e+]+), rms ([\d.e+]+) µm", text)
    assert found, text
    enlarged, rms = map(float, found.groups())
    assert enlarged * rms == pytest.approx(ARROW * MICRO * results.tracks.radius.mean(), rel=DIGITS)
