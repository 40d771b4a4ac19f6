import numpy as np
import pytest
from rodsight.solver.bodies.packing import Material
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve, sweeps
from rodsight.solver.nlgs.sweep_record import SweepRecorder, recorded_sweeps

from tests.packings import squeezed_heap

SWEEPS = 150  # of a sub-step
ROUNDING = 1e-6  # relative, of single precision


@pytest.fixture(scope="module")
def steps():
    """Problems of two sub-steps, the second with fewer contacts."""
    grains, state, walls = squeezed_heap(np.random.default_rng(4), columns=9, rows=9)
    contacts = detect_contacts(grains, state.position, state.present, walls, 2e-4)
    rng = np.random.default_rng(0)
    fewer = contacts.select(rng.random(contacts.count) < 0.9)
    return [(assemble(grains, state, walls, of, Material(0.3, 0.2), grains.mass * 1e3), of) for of in (contacts, fewer)]


def record(steps, keep):
    recorder = SweepRecorder(len(steps) * SWEEPS, keep)
    for problem, contacts in steps:
        recorder.begin(problem, contacts)
        settings = NlgsSettings(sweeps=SWEEPS)
        solve(problem, settings, observer=recorder.on_sweep, every=recorder.strides(), measured=recorder.measured)
    return recorder.history(steps[-1][1])


@pytest.fixture(scope="module")
def every_sweep(steps):
    """Residuals (s, 3) of every sweep, and forces by contact key."""
    residuals, forces = [], []
    for problem, contacts in steps:
        for sweep in sweeps(problem, NlgsSettings(), every=[1] * SWEEPS):
            residuals.append(sweep.residuals[0])
            forces.append(dict(zip(contacts.key[problem.rows].tolist(), sweep.force.tolist(), strict=True)))
    return np.array(residuals), forces


@pytest.mark.parametrize("keep", ["log", "all", "none"])
def test_every_sweep_has_a_row_of_exact_residuals_or_nan(steps, every_sweep, keep):
    history, (expected, _) = record(steps, keep), every_sweep
    found = np.column_stack([history.force_change, history.natural_map, history.unbalance])
    assert found.shape == expected.shape
    known = np.isfinite(found).all(axis=1)
    assert np.array_equal(known, np.isfinite(found).any(axis=1))
    assert np.array_equal(found[known], expected[known])
    number = np.tile(np.arange(1, SWEEPS + 1), len(steps))
    assert known[number == SWEEPS].all()
    assert known[history.recorded].all()
    apart = np.diff(np.flatnonzero(known)).max()  # sweeps between two measured ones
    assert apart <= {"all": 1, "log": 10, "none": SWEEPS}[keep]


@pytest.mark.parametrize("keep", ["log", "all", "none"])
def test_kept_forces_are_those_of_the_recorded_sweeps(steps, every_sweep, keep):
    history, (_, forces) = record(steps, keep), every_sweep
    assert np.array_equal(history.recorded, recorded_sweeps(len(steps) * SWEEPS, keep))
    found = np.stack([history.fn, history.ft], axis=2)
    key = steps[-1][1].key.tolist()
    expected = np.array([[forces[row].get(k, (0.0, 0.0)) for k in key] for row in history.recorded])
    assert found == pytest.approx(expected, rel=ROUNDING)
    assert history.fn.dtype == np.float32


def test_contacts_that_a_sub_step_lacks_have_zero_force_in_it(steps):
    history = record(steps[::-1], "all")
    key = steps[1][1].key
    unknown = ~np.isin(steps[0][1].key, key)
    assert unknown.any()
    assert np.all(history.fn[:SWEEPS, unknown] == 0)
    assert np.any(history.fn[SWEEPS:, unknown] > 0)


def test_without_sweeps_the_history_is_empty(steps):
    history = SweepRecorder(0, "log").history(steps[0][1])
    assert history.count == len(history.recorded) == 0
    assert history.fn.shape == (0, steps[0][1].count)
