"""Error bars from an ensemble of sequences: the forces stay, their standard deviations change."""

from dataclasses import replace

import h5py
import numpy as np
import pytest
from rodsight.results.checkpoint import Checkpoint
from rodsight.results.hdf5.store import load_results
from rodsight.robustness import ensemble_sd
from rodsight.robustness.design import Case
from rodsight.robustness.ensemble_sd import (
    RANGES,
    SD_WEIGHTS,
    make_members,
    measure_ensemble_sd,
    solve_member,
    solve_members,
)

from tests.app.robustness.conftest import FEW
from tests.program import rodsight

SET = tuple(part for setting in FEW for part in ("--set", setting))


def test_absent_contacts_enter_the_ensemble_sd_as_zero():
    key = np.array([3, 1, 7])
    force = np.array([[1.0, 0.0], [2.0, 0.5], [0.0, 0.0]])
    members = [
        (
            np.array([1, 3, 9]),
            np.array([[2.0, 0.5], [3.0, 0.0], [5.0, 5.0]]),
        ),  # 7 is absent, 9 is not in the nominal run
        (np.array([7, 1]), np.array([[1.0, 1.0], [2.0, -0.5]])),  # 3 is absent
    ]
    found = measure_ensemble_sd(key, force, members)
    assert found.fn == pytest.approx(np.sqrt([(4.0 + 1.0) / 2, 0.0, 1.0 / 2]))
    assert found.ft == pytest.approx(np.sqrt([0.0, 1.0 / 2, 1.0 / 2]))


def test_an_empty_network_has_an_empty_ensemble_sd():
    none = np.empty(0, np.int64), np.empty((0, 2))
    assert measure_ensemble_sd(*none, [none]).fn.shape == (0,)


def test_members_vary_every_uncertain_input():
    members = make_members(8)
    assert len({each.key for each in members}) == 8
    assert [each.key for each in make_members(8)] == [each.key for each in members]
    for name, (low, high) in RANGES.items():
        values = [dict(each.values)[name] for each in members]
        assert low <= min(values) < 1.0 < max(values) <= high
    assert all(dict(each.values)["position_noise"] == 1.0 for each in members)
    assert all(dict(each.values)["wall_friction"] == dict(each.values)["friction"] for each in members)


@pytest.mark.slow
def test_an_ensemble_changes_the_error_bars_and_never_the_forces(made_tracks, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("rodsight.pipeline.available_cores", lambda: 1)
    out, free = tmp_path / "out", tmp_path / "free"
    assert rodsight("solve", made_tracks, "--out", free, *SET) == 0
    assert rodsight("solve", made_tracks, "--out", out, *SET, "--ensemble", 2) == 0
    with h5py.File(free / "results.h5") as a, h5py.File(out / "results.h5") as b:
        for name in ("fn", "ft", "nlgs_fn", "nlgs_ft"):
            assert np.array_equal(a[f"forces/{name}"], b[f"forces/{name}"])
        for component, name in enumerate(("fn_sd", "ft_sd")):
            least = SD_WEIGHTS["ensemble"][component][1] * a[f"forces/{name}"][()]
            assert np.all(b[f"forces/{name}"][()] >= least * (1 - 1e-12))
            assert "formula" in a[f"forces/{name}"].attrs["source"]
            assert "2 sequences" in b[f"forces/{name}"].attrs["source"]
        assert not np.array_equal(a["forces/fn_sd"], b["forces/fn_sd"])
    assert load_results(out / "results.h5").ensemble_size == 2
    before = (out / "results.h5").stat().st_mtime_ns
    assert rodsight("solve", made_tracks, "--out", out, *SET, "--ensemble", 2) == 0
    assert (
        rodsight("solve", made_tracks, "--out", out, *SET) == 0
    )  # without an ensemble requested, the stored results stay
    assert (out / "results.h5").stat().st_mtime_ns == before
    # Error bars added to finished results are the same, also when the number of members changes.
    assert rodsight("solve", made_tracks, "--out", free, *SET, "--ensemble", 3) == 0
    assert rodsight("solve", made_tracks, "--out", free, *SET, "--ensemble", 2) == 0
    with h5py.File(free / "results.h5") as a, h5py.File(out / "results.h5") as b:
        assert np.array_equal(a["forces/fn_sd"], b["forces/fn_sd"])
    assert not (out / ".unfinished").exists()
    capsys.readouterr()


@pytest.mark.slow
def test_stored_members_are_not_solved_again(nominal, tmp_path, monkeypatch):
    checkpoint = Checkpoint(tmp_path / "ensemble", "x")
    whole = solve_members(nominal.inputs, 2)
    solved = []

    def stop_at_the_second(inputs, case):
        if len(solved) == 1:
            raise KeyboardInterrupt
        solved.append(case)
        return solve_member(inputs, case)

    monkeypatch.setattr(ensemble_sd, "solve_member", stop_at_the_second)
    with pytest.raises(KeyboardInterrupt):
        solve_members(nominal.inputs, 2, checkpoint)
    solved.clear()
    again = solve_members(nominal.inputs, 2, checkpoint)
    assert [each.key for each in solved] == [make_members(2)[1].key]
    for one, other in zip(whole, again, strict=True):
        assert np.array_equal(one.force, other.force)
        assert np.array_equal(one.key, other.key)


def test_constant_errors_of_centres_rotate_with_their_grains(nominal, monkeypatch):
    tracks = nominal.inputs.tracks
    rotation = np.linspace(0.0, np.pi, tracks.frame_count)[:, None] + np.zeros(tracks.grain_count)
    seen = []
    monkeypatch.setattr(ensemble_sd, "infer", seen.append)
    for sigma in (None, np.full(tracks.grain_count, 5e-5)):
        rotating = replace(tracks, rotation=rotation, centre_sigma=sigma)
        solve_member(replace(nominal.inputs, tracks=rotating), Case(()))
    offset = seen[1].tracks.position - seen[0].tracks.position
    assert offset[0].std() == pytest.approx(5e-5, rel=0.3)  # 80 draws
    assert np.allclose(offset[-1], -offset[0], atol=1e-12)
    assert np.allclose(offset[2], np.stack([-offset[0, :, 1], offset[0, :, 0]], axis=1), atol=1e-12)  # 90°


@pytest.mark.parametrize("size", ["-1", "1.5"])
def test_an_impossible_ensemble_is_refused(size, made_tracks, tmp_path, capsys):
    assert rodsight("solve", made_tracks, "--out", tmp_path / "out", "--set", f"solver.ensemble_size={size}") == 2
    printed = capsys.readouterr().err
    assert "solver.ensemble_size" in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "out").exists()
