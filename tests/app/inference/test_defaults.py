"""The defaults of the solver are those of the command."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.inference.correction.correct_sequence import correct_sequence
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.inference.inputs import Inputs
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings

FRAMES = 2


def test_the_solvers_defaults_give_the_commands_forces_bit_for_bit(made_tracks: Path) -> None:
    experiment = load_experiment(made_tracks, ("calibration.enabled=false",))
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    assert walls is not None
    corrected = correct_sequence(Inputs(tracks, walls, material_of(experiment.config), settings_of(experiment.config)))

    def solved(settings: SequenceSettings) -> list[FrameForces]:
        return [frame for frame, _ in solve_sequence(corrected.packing, corrected.snapshots[:FRAMES], settings)]

    for ours, theirs in zip(solved(SequenceSettings()), solved(corrected.settings), strict=True):
        for name in ("fn", "ft", "nlgs_fn", "nlgs_ft", "probability", "fn_sd", "ft_sd", "trust"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
        np.testing.assert_array_equal(ours.contacts.key, theirs.contacts.key)
