"""Inputs with large or misstated noise: the gaps show it, and the forces stay accurate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.solver.dem.dem_truth import DemTruth
from rodsight.study.truths import agreement_of, observe, simulate, window_starts

GRAINS, SEED, REVERSAL_ANGLE, WINDOW = 250, 41, 5.0, 8
NOISE = 4e-5  # [m]
LEAST_R = 0.93  # mean over all frames but the first
MISSTATED = 0.5  # stated over true standard deviation
LOSS = 0.02  # greatest decrease of r by the misstatement

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def truth(tmp_path_factory) -> DemTruth:
    return simulate(SEED, grains=GRAINS, folder=tmp_path_factory.mktemp("truth"), reversal_angle=REVERSAL_ANGLE)


def solved(truth: DemTruth, stated: float) -> tuple[float, str]:
    """Mean r(f_n), and the reason stated for the first frame."""
    start = window_starts(truth, WINDOW)[0]
    inputs = observe(truth, range(start, start + WINDOW), NOISE, np.random.default_rng(1))
    inputs = replace(inputs, tracks=replace(inputs.tracks, sigma=stated * inputs.tracks.sigma))
    frames = list(infer_sequence(inputs).frames)
    return float(np.mean([agreement_of(f, truth, start + f.frame).r_fn for f in frames[1:]])), frames[0].reason


def test_forces_stay_accurate_at_large_and_misstated_noise(truth):
    r, reason = solved(truth, 1.0)
    misstated, contradicted = solved(truth, MISSTATED)
    assert r >= LEAST_R
    assert misstated >= r - LOSS
    assert "stated precision" not in reason
    assert "times the stated precision" in contradicted
