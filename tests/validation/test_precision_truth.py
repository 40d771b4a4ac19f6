"""Inputs whose noise is great, or not what is stated: the gaps tell, and the forces stay good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.inference import infer_frames
from rodsight.study.truths import agreement_of, observe, simulate, starts_of

from solver.dem.simulation import DemTruth

GRAINS, SEED, TURN, WINDOW = 250, 41, 5.0, 8
NOISE = 4e-5  # [m]
LEAST_R = 0.93  # mean over the frames that a motion leads to
MISSTATED = 0.5  # stated over true standard deviation
LOSS = 0.02  # of r, at most, for stating it so

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def truth(tmp_path_factory) -> DemTruth:
    return simulate(SEED, grains=GRAINS, folder=tmp_path_factory.mktemp("truth"), turn=TURN)


def solved(truth: DemTruth, stated: float) -> tuple[float, str]:
    """Mean r(f_n), and what is said of the first frame."""
    start = starts_of(truth, WINDOW)[0]
    inputs = observe(truth, range(start, start + WINDOW), NOISE, np.random.default_rng(1))
    inputs = replace(inputs, tracks=replace(inputs.tracks, sigma=stated * inputs.tracks.sigma))
    frames = [solved.forces for solved in infer_frames(inputs)]
    return float(np.mean([agreement_of(f, truth, start + f.frame).r_fn for f in frames[1:]])), frames[0].reason


def test_forces_survive_great_noise_and_a_wrong_statement_of_it(truth):
    r, told = solved(truth, 1.0)
    misstated, contradicted = solved(truth, MISSTATED)
    assert r >= LEAST_R
    assert misstated >= r - LOSS
    assert "stated precision" not in told
    assert "times the stated precision" in contradicted
