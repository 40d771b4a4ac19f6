"""Forces of every sweep are stored in less than a byte per contact and sweep, and look as if they were exact."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import rodsight
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.force_style import ForceRange, ForceStyle
from rodsight.recording.packing_layers.forces.network import SweepChoice, chosen_sweeps
from rodsight.results.hdf5.store import Provenance, load_results, save_results
from rodsight.results.hdf5.sweep_precision import STEPS, round_sweeps
from rodsight.results.results import Results
from rodsight.solver.nlgs.sweep_record import SweepHistory, recorded_sweeps

from tests.app.recording.fake_results import make_results

SWEEPS = 1500


def converging(recorded: np.ndarray | None = None) -> Results:
    """One frame whose forces settle over the sweeps as those of a solver do: contacts at very unequal rates."""
    results = make_results(1, columns=16, rows=16, sweeps=SWEEPS, recorded=recorded)
    forces, rng = results.frames[0], np.random.default_rng(4)
    sweep = forces.history.recorded[:, None]
    count = forces.contacts.count
    rest = np.exp(-sweep / 10 ** rng.uniform(0.5, 2.0, count)) * np.cos(sweep / rng.uniform(2.0, 9.0, count))
    fn = np.maximum(forces.fn + forces.fn.mean() * rest, 0.0).astype(np.float32)
    ft = (forces.ft + 0.3 * forces.fn.mean() * rest).astype(np.float32)
    return replace(results, frames=[replace(forces, history=replace(forces.history, fn=fn, ft=ft))])


@pytest.fixture(scope="module")
def exact() -> SweepHistory:
    return converging().frames[0].history


@pytest.fixture(scope="module")
def stored(tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("every sweep") / "results.h5"
    save_results(file, converging(), Provenance("print", "experiment.toml", (0, None), {}))
    return file


@pytest.mark.thorough  # five frames with every sweep
def test_a_contact_and_sweep_of_a_solved_run_take_less_than_a_byte(made_tracks, tmp_path):
    run = rodsight.run(made_tracks, out=tmp_path, settings={"recording.sweeps": "all"})
    with h5py.File(run.file) as file:
        size = sum(file[f"sweeps/{name}"].id.get_storage_size() for name in ("fn", "ft"))
        count = file["sweeps/fn"].size
    assert size < count


def test_the_error_is_at_most_half_a_step_and_spaced_sweeps_are_exact(stored, exact):
    read = load_results(stored).frames[0].history
    mean = exact.fn[-1][exact.fn[-1] > 0.0].mean()
    for name in ("fn", "ft"):
        error = np.abs(getattr(read, name) - getattr(exact, name))
        assert 0.0 < error.max() <= mean / (2 * STEPS)
        assert not error[recorded_sweeps(SWEEPS, "log")].any()


def test_a_stored_history_is_stored_again_without_further_rounding(exact):
    once = round_sweeps(exact)
    again = round_sweeps(once)
    np.testing.assert_array_equal(once.fn, again.fn)


def test_spaced_sweeps_alone_are_not_rounded():
    for kept in (recorded_sweeps(SWEEPS, "log"), np.array([3, 700, 1200])):
        history = converging(kept).frames[0].history
        assert round_sweeps(history) is history


def test_widths_and_colours_are_those_of_exact_forces_or_their_neighbours(exact):
    results, rounded = converging(), round_sweeps(exact)
    style = ForceStyle.on(Canvas.around(results.tracks, None), ForceRange.of(results.frames))
    np.testing.assert_allclose(style.radii(rounded.fn), style.radii(exact.fn), atol=1.01 * style.quantum)
    steps = len(np.unique(style.colours(np.linspace(style.range.weak, style.range.top, 100_000))))
    assert abs(rounded.fn - exact.fn).max() <= (style.range.top - style.range.weak) / steps


def test_maps_of_residuals_use_exact_sweeps_alone(exact):
    chosen = chosen_sweeps(exact, SweepChoice.LOG, 20)
    assert len(chosen) <= 20
    assert set(exact.recorded[chosen]) <= set(recorded_sweeps(SWEEPS, "log"))
    np.testing.assert_array_equal(round_sweeps(exact).fn[chosen], exact.fn[chosen])
