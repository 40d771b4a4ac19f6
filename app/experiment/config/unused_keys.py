"""Keys that the chosen estimator or preset does not use: refused by name where they were set."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from .experiment_file import InferenceSections

ENSEMBLE = 'has no effect on the ensemble, which weighs probabilities: leave it out, or set solver.estimator = "nlgs"'
ONE_CHAIN = 'has no effect on estimator "nlgs", a single chain without members: leave it out, or set "ensemble"'
PAPER = 'is fixed by solver.preset = "paper": leave it out, or leave out the preset'
# What the paper's preset makes of keys; None: no value of the key says it.
OF_THE_PAPER = {
    "estimator": "nlgs", "kappa": None, "substeps": None, "spin_up": None, "precision": "stated",
    "reset": "rearrangement",
}  # fmt: skip


def unused_keys(config: InferenceSections) -> dict[str, str]:
    """Keys that change nothing in this configuration, and why."""
    solver, contacts = config.solver, config.contacts
    paper = solver.preset == "paper"
    found: dict[str, str] = {}
    if paper:
        for key, value in OF_THE_PAPER.items():
            if value is None or getattr(solver, key) != value:
                found[f"solver.{key}"] = PAPER
    if paper or solver.estimator == "nlgs":
        found["solver.keep_members"] = ONE_CHAIN
        found["solver.positions"] = ONE_CHAIN
        if contacts.threshold is not None:
            found["contacts.threshold_sigmas"] = "has no effect beside contacts.threshold: leave out one of them"
    else:
        found["contacts.threshold"] = found["contacts.threshold_sigmas"] = ENSEMBLE
    if not paper and solver.reset == "never":
        why = 'has no effect where nothing is reset by itself: leave it out, or set solver.reset = "rearrangement"'
        found["solver.kept_frames"] = why
    return found


def refuse_unused_keys(config: InferenceSections, file: Path | str) -> None:
    """Raise InputError if a key was set that changes nothing; a default is never complained about."""
    for name, why in unused_keys(config).items():
        section, key = name.split(".")
        if key in getattr(config, section).model_fields_set:
            raise InputError(file, f"key {name} = {getattr(getattr(config, section), key)!r}", why)
