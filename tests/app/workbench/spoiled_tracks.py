"""An experiment whose tracks have one rod in a wrong place in one photograph, and without a place in the next."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.reading.tables import read_table
from rodsight.experiment.scaling import make_scale
from rodsight.results.hdf5.store import origin_of, save_tracks
from rodsight.run_folder import TRACKS
from rodsight.tracks import TrackStatus
from rodsight.workbench.setup.draft import Draft

ROD, WRONG, GONE = 7, 2, 3  # a rod, the photograph in which it is taken for another, and the one without it


def spoil(root: Path) -> None:
    """Track root/mine, and spoil the tracks."""
    Draft(root / "mine").set_keys("named as the truth names them", {"photographs.grains": "grains.csv"})
    experiment = load_experiment(root / "mine")
    run = pipeline.Run(experiment, root / "runs" / experiment.name)
    tracks, walls = pipeline.track(run)
    position, rotation, status = tracks.position.copy(), tracks.rotation.copy(), tracks.status.copy()
    position[WRONG, ROD] += 60.0 * pixel_of(root)
    status[WRONG, ROD] = TrackStatus.SUSPECT
    position[GONE, ROD], rotation[GONE, ROD], status[GONE, ROD] = np.nan, np.nan, TrackStatus.LOST
    wrong = replace(tracks, position=position, rotation=rotation, status=status)
    origin = origin_of(run.file(TRACKS))
    save_tracks(run.file(TRACKS), experiment.name, wrong, walls, origin)
    run.write_manifest()
    run.manifest.add(TRACKS, origin.fingerprint)


def pixel_of(root: Path) -> float:
    section = load_experiment(root / "mine").config.photographs
    assert section is not None
    return section.pixel_size


def true_poses(root: Path) -> np.ndarray:
    """Of every photograph and rod (4, 30, 3): x, y [px], angle [rad] of the world."""
    experiment = load_experiment(root / "mine")
    scale = make_scale(experiment.config.photographs, experiment.photographs().shape[0])
    table = read_table(root / "mine" / "truth_tracks.csv", ("frame", "id", "x", "y", "theta"))
    place = scale.to_pixels(np.stack([table.numbers("x"), table.numbers("y")], axis=1))
    return np.column_stack([place, table.numbers("theta")]).reshape(4, -1, 3)
