"""The stages of a run that store results: settings and source files that each of them depends on."""

from __future__ import annotations

from typing import NamedTuple


class Stage(NamedTuple):
    """What the result of a stage depends on beside the input files."""

    sections: tuple[str, ...]  # of the configuration
    code: tuple[str, ...]  # source files, which count with all that they import
    alone: tuple[str, ...] = ()  # source files without what they import


TRACKING = Stage(
    ("photographs", "tracking", "walls", "boundary"),
    ("tracking/stage.py", "tracking/corrected_frames.py", "experiment/boundary.py", "results/hdf5/store.py"),
    alone=("pipeline.py",),
)
FORCES = Stage(
    (
        "photographs", "tracking", "tracks", "walls", "boundary", "calibration", "material", "contacts", "solver",
        "recording",
    ),
    (
        *TRACKING.code, "experiment/experiment.py", "inference/infer_sequence.py", "inference/inference_settings.py",
        "inference/inputs.py", "results/hdf5/store.py", "robustness/ensemble_sd.py", "robustness/error_budget.py",
        "verdicts/decisions.py", "inference/diagnosis/diagnose.py",
    ),
    alone=("pipeline.py", "forces_of_run.py"),
)  # fmt: skip
EFFECTS = Stage((), ("robustness/study.py",))  # of the runs of a sensitivity study
PHOTOGRAPHS_SHOWN = Stage(("photographs",), ("experiment/photographs.py", "experiment/jpeg_photographs.py"))
