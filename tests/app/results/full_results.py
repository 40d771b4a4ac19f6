"""Invented results with values for every dataset of results.h5."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rodsight.results.results import Results
from rodsight.solver.assessment.fringe_pressures import FringePressures
from rodsight.solver.assessment.intervals.statistic_intervals import CONSTANT
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT
from rodsight.solver.boundary.bars import Bars
from rodsight.solver.boundary.boundary_correction import Boundary
from rodsight.solver.boundary.camera_distortion import CameraDistortion
from rodsight.solver.boundary.camera_pose import CameraPose
from rodsight.solver.calibration.calibrate import Calibration
from rodsight.solver.calibration.gap_statistics import GapStatistics
from rodsight.solver.calibration.priors import CalibrationPriors
from rodsight.solver.convex.friction_check import FrictionCheck
from rodsight.solver.frame_forces import ERROR_PARTS, MEMBERS, FrameForces
from rodsight.solver.kinematics.mean_field import FLUCTUATION_BINS
from rodsight.solver.kinematics.sequence_kinematics import SequenceKinematics
from rodsight.solver.kinematics.spatial_correlation import DISTANCE_BINS
from rodsight.solver.nlgs.start_residuals import COLD_SWEEPS

from tests.app.recording.fake_results import make_results, make_tuning

CELL = np.array([[0.3, 0.01], [0.02, 0.4]])  # [m]
WORLD = {"columns": 4, "rows": 3, "sweeps": 6}


def make_full_results(frame_count: int = 3, seed: int = 3, **options) -> Results:
    """Return a small run in which every value differs from its neighbours."""
    rng = np.random.default_rng(seed)
    results = make_results(frame_count, seed=seed, **(WORLD | options))
    f, n, w = results.tracks.frame_count, results.grains.count, results.walls.count
    tracks = replace(
        results.tracks,
        id=rng.permutation(n).astype(np.int64) + 100,
        sigma=rng.random((f, n)),
        zncc=rng.random((f, n)),
        centre_sigma=rng.random(n),
        second_zncc=rng.random((f, n)),
        fringes=np.arange(1.0, 1.0 + f * n).reshape(f, n),
        given_id=np.arange(f * n).reshape(f, n),
        reference_frame=rng.integers(0, f, (f, n)).astype(np.int32),
        inferred=np.arange(n) > n - 3,
        boundary=np.arange(n) % 4 == 1,
        status=rng.integers(0, 7, (f, n)).astype(np.uint8),
        failed_reason=tuple(f"photograph {k} was black" for k in range(f)),
    )
    walls = replace(
        results.walls,
        force=rng.random((f, w, 2)),
        sigma=rng.random((f, w)),
        end_kind=np.arange(w, dtype=np.int8) % 3 - 1,
        side=np.where(np.arange(w) == 3, OUT, STRAIGHT).astype(np.int8),
        plate=np.where(np.arange(w) == 3, 2, -1).astype(np.int32),
        load=np.where(np.arange(w) == 1, 40.0, np.nan) * np.ones((f, 1)),
        cell=CELL + 0.01 * np.arange(4 * f).reshape(f, 2, 2),
    )
    tuning = make_tuning()
    tuning = replace(tuning, frame_coordination_number=np.repeat(tuning.frame_coordination_number, f, axis=1))
    return replace(
        results,
        tracks=tracks,
        grains=replace(results.grains, boundary=tracks.boundary),
        walls=walls,
        frames=[_full_frame(frame, rng) for frame in results.frames],
        statistics=[_varied(each, rng) for each in results.statistics],
        calibration=_calibration(n, w, rng),
        friction_check=FrictionCheck(
            0.25, 0.24, 0.2, 0.28, 0, f - 1, True, rng.random(5), rng.random(5), 0.2, 0.15, 0.24
        ),
        radius_tuning=tuning,
        boundary=_boundary(f, w, np.random.default_rng(seed + 1)),
        lens=_lens(np.random.default_rng(seed + 3)),
        fringes=FringePressures(
            *np.random.default_rng(seed + 4).random((2, f, n)),
            np.linspace(0.2, 0.9, f),
            np.arange(3.0),
            np.arange(3.0) ** 2,
        ),
        read_kinematics=lambda: _kinematics(f, n, np.random.default_rng(seed + 2)),
        ensemble_size=2,
    )


def _kinematics(f: int, n: int, rng: np.random.Generator) -> SequenceKinematics:
    windows = 2
    return SequenceKinematics(
        2, rng.random((f, 2, 2)), rng.random((f, n, 2)), *rng.random((5, f, n)), rng.random((f, n)) < 0.5,
        *rng.random((3, f)), 2 ** np.arange(windows), *rng.random((4, windows)),
        rng.random((windows, FLUCTUATION_BINS)), rng.random((windows, DISTANCE_BINS)), rng.random(windows),
    )  # fmt: skip


def _boundary(f: int, w: int, rng: np.random.Generator) -> Boundary:
    bars = Bars(rng.random((f, w)), rng.random(w) < 0.5, rng.random(w), rng.random(w))
    camera = CameraPose(
        rng.random((f, 2)), rng.random(f), rng.random(f), rng.random((f, 2)), rng.random(2), 7.0, applied=True
    )
    return Boundary(bars, camera, rng.random((w, 2)))


def _lens(rng: np.random.Generator) -> CameraDistortion:
    value, sd = rng.random((2, 10))
    return CameraDistortion(
        value, sd, 0.1, rng.random(2), *rng.random(3), True, 0.2, rng.random(2), 0.3, *rng.random((3, 2))
    )


def _full_frame(frame: FrameForces, rng: np.random.Generator) -> FrameForces:
    c = frame.contacts.count
    history = frame.history
    residuals = {name: getattr(history, name).copy() for name in ("force_change", "natural_map", "unbalance")}
    for values in residuals.values():
        values[1::2] = np.nan  # measured every other sweep
    return replace(
        frame,
        contacts=replace(frame.contacts, shift=(np.arange(c) % 5 == 3)[:, None] * CELL[0]),
        history=replace(history, **residuals),
        **{name: rng.random(c) for name in ("nlgs_fn", "nlgs_ft", "un", "ut", "probability", "fn_sd", "ft_sd")},
        age=rng.integers(0, 9, c).astype(np.int32),
        source=rng.integers(0, 3, c).astype(np.uint8),
        member_force=rng.random((c, len(MEMBERS), 2)),
        start_difference=float(rng.random()),
        unseen_grains=int(rng.integers(1, 9)),
        hidden_fraction=float(rng.random()),
        similarity=float(rng.random()),
        new_contact_count=float(rng.integers(1, 9)),
        lost_contact_count=float(rng.integers(1, 9)),
        trust_penalties=f"frame {frame.frame} is unreliable",
        force_change=0.125 + 0.01 * frame.frame,
        strain=np.array([[0.1, 0.02], [0.02, -0.1]]) * (1 + frame.frame),
        shear=0.2 + frame.frame,
        shear_step=0.3 + frame.frame,
        warm_residual=float(rng.random()),
        cold_residual=rng.random(len(COLD_SWEEPS)),
        sweeps_saved=float(rng.random()),
        grain_unbalance=rng.random(frame.contacts.grain_count),
        expected_correlation=0.75 + 0.01 * frame.frame,
        friction=np.linspace(0.2, 0.5, c),
        bearing_probability=np.linspace(0.2, 0.8, c),
        sliding_probability=np.linspace(0.9, 0.1, c),
        overlap=0.25 + frame.frame,
        position_weight=0.5 + 0.01 * frame.frame,
        soft=frame.frame % 2,
        error_budget=np.linspace(0.0, 1.0, len(ERROR_PARTS)) / (1 + frame.frame),
        relative_error=0.15 + 0.01 * frame.frame,
    )


DEVIATIONS = tuple(f"{name}_sd" for name in CONSTANT)
# Fields that are newer than the stored file of test_earlier_files, which was made without them.
SINCE = ("wall_normal_force", "wall_tangential_force", *DEVIATIONS)


def _varied(statistics, rng: np.random.Generator):
    fields = [name for name in statistics.__dataclass_fields__ if name not in SINCE]
    named = {name: np.asarray(getattr(statistics, name)) for name in fields}
    return replace(
        statistics,
        **{
            name: int(rng.integers(100)) if value.dtype.kind == "i" else _like(value, rng)
            for name, value in named.items()
        },
        **{name: 0.01 * (1 + row) for row, name in enumerate(DEVIATIONS)},
    )


def _like(value: np.ndarray, rng: np.random.Generator):
    return rng.random(value.shape) if value.ndim else float(rng.random())


def _calibration(n: int, w: int, rng: np.random.Generator) -> Calibration:
    return Calibration(
        offset=rng.random((n, 2)), radius=rng.random(n), wall=rng.random(w), wall_tilt=rng.random(w), pixel_size=0.01,
        lens=0.02, walls_follow=True, offset_sd=rng.random((n, 2)), radius_sd=rng.random(n), wall_sd=rng.random(w),
        wall_tilt_sd=rng.random(w), radius_offset=0.06, radius_offset_sd=0.07, pixel_size_sd=0.03, lens_sd=0.04,
        gap_sd=0.05,
        priors=CalibrationPriors(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7), noise_factor=1.5,
        before=GapStatistics(*rng.random(5).tolist()), after=GapStatistics(*rng.random(5).tolist()), rounds=3,
        applied=True, verdict="was applied: it is “better” ≤ ½",
    )  # fmt: skip
