"""python -m tests.app.inference.diagnosis.smoothing_study: how often smoothed tracks are named, and their r and T.

Every scenario is examined as given and smoothed, tracks and walls alike. `--solve` also solves those scenarios.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.diagnosis.smoothed_tracks import find_smoothing
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.inputs import Inputs
from rodsight.study.scenarios.scenario_score import true_forces
from rodsight.synthetic.scenarios.scenario_folder import make_scenario
from rodsight.synthetic.scenarios.scenario_table import SCENARIOS

from tests.app.inference.diagnosis.test_smoothed_tracks import exponential, moving_average
from tests.app.inference.scenarios import SequenceKeeper, agreement, read_inputs


def cubic(values: np.ndarray) -> np.ndarray:
    """Cubic fits in time of values (f, …)."""
    time = np.linspace(-1.0, 1.0, len(values))
    flat = values.reshape(len(values), -1)
    fitted = np.full_like(flat, np.nan)
    for column, fit in zip(flat.T, fitted.T, strict=True):
        known = np.isfinite(column)
        if known.sum() > 3:
            fit[known] = np.polyval(np.polyfit(time[known], column[known], 3), time[known])
    return fitted.reshape(values.shape)


OVERSTATED = {"exact, 10 µm stated": 0.0, "1 µm, 10 µm stated": 1e-6, "2 µm, 10 µm stated": 2e-6}  # noise [m]
STATED = 1e-5  # [m] precision
FILTERS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "as given": lambda values: values,
    "average of 3": partial(moving_average, count=3),
    "average of 5": partial(moving_average, count=5),
    "exponential .25": partial(exponential, weight=0.25),
    "exponential .4": partial(exponential, weight=0.4),
    "cubic": cubic,
}


def smooth_inputs(inputs: Inputs, smooth: Callable[[np.ndarray], np.ndarray]) -> Inputs:
    """Inputs with smoothed tracks and walls; poses that were lost stay so."""
    present = inputs.tracks.present
    position = np.where(present[..., None], smooth(inputs.tracks.position), np.nan)
    rotation = np.where(present, smooth(inputs.tracks.rotation), np.nan)
    tracks = replace(inputs.tracks, position=position, rotation=rotation)
    return replace(inputs, tracks=tracks, walls=replace(inputs.walls, endpoints=smooth(inputs.walls.endpoints)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[42, 43])
    parser.add_argument("--scenarios", nargs="+", default=list(SCENARIOS))
    parser.add_argument("--solve", nargs="*", default=[], help="scenarios to solve, too")
    parser.add_argument("--grains", type=int, default=200)
    parser.add_argument("--cache", type=Path, help="folder of simulated truths")
    options = parser.parse_args()
    named: dict[str, list[str]] = defaultdict(list)
    unnamed: dict[str, list[str]] = defaultdict(list)
    scores: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for seed in options.seeds:
        for name in options.scenarios:
            with tempfile.TemporaryDirectory() as folder:
                made = make_scenario(Path(folder), name, seed, grains=options.grains, cache=options.cache)
                for way, noise in OVERSTATED.items():
                    exact = make_scenario(
                        Path(folder) / way, name, seed, grains=options.grains, noise=noise, cache=options.cache
                    ).folder
                    tracks = read_inputs(load_experiment(exact, (f"tracks.precision={STATED}",))).tracks
                    (named if find_smoothing(tracks) else unnamed)[way].append(f"{name} {seed}")
                experiment = load_experiment(made.folder, ())
                inputs = read_inputs(experiment)
                for way, smooth in FILTERS.items():
                    changed = smooth_inputs(inputs, smooth)
                    found = find_smoothing(changed.tracks) is not None
                    (named if found else unnamed)[way].append(f"{name} {seed}")
                    if name in options.solve and (found or way == "as given"):
                        keeper = SequenceKeeper()
                        results = infer_sequence(changed, keeper)
                        scores[way] += score(results.frames, true_forces(experiment, keeper.sequence))
    for way in (*OVERSTATED, *FILTERS):
        count = len(named[way]) + len(unnamed[way])
        wrong = named[way] if way == "as given" or way in OVERSTATED else unnamed[way]
        print(f"{way}: {len(named[way])} of {count} named; wrongly named or not: {', '.join(wrong) or 'none'}")
        if scores[way]:
            r, trust = np.array(scores[way]).T
            print(
                f"  r median {np.median(r):.2f}, a twentieth below {np.quantile(r, 0.05):.2f}; T at most "
                f"{trust.max():.2f}, above r + .03 in {100.0 * np.mean(trust > r + 0.03):.1f} % of {len(r)} frames"
            )


def score(frames, true) -> list[tuple[float, float]]:  # type: ignore[no-untyped-def]
    """r(f_n) and T of frames."""
    return [(agreement(frame, each), frame.trust) for frame, each in zip(frames, true, strict=True)]


if __name__ == "__main__":
    main()
