"""Find keys that the chosen estimator or preset does not use, and refuse them where they are set."""

from __future__ import annotations

from pathlib import Path

from ...process.errors import InputError
from .tuning_sections import InferenceSections

ENSEMBLE = (
    'has no effect on the ensemble, which uses contact probabilities: leave it out, or set solver.estimator = "nlgs"'
)
ONE_CHAIN = 'has no effect on estimator "nlgs", a single chain without an ensemble: leave it out, or set "ensemble"'
PAPER = 'is fixed by solver.preset = "paper": leave it out, or leave out the preset'
# Values of keys under the paper's preset; None: no value of the key has this effect.
PAPER_VALUES = {
    "estimator": "nlgs", "kappa": None, "substeps": None, "spin_up": None, "precision": "stated",
    "reset": "rearrangement",
}  # fmt: skip


def unused_keys(config: InferenceSections) -> dict[str, str]:
    """Return the keys without an effect in this configuration, each with the reason."""
    solver, contacts = config.solver, config.contacts
    paper = solver.preset == "paper"
    found: dict[str, str] = {}
    if paper:
        for key, value in PAPER_VALUES.items():
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
        why = 'has no effect without automatic resets: leave it out, or set solver.reset = "rearrangement"'
        found["solver.kept_frames"] = why
    return found


def refuse_unused_keys(config: InferenceSections, file: Path | str) -> None:
    """Raise InputError if a key was set that has no effect; defaults are always accepted."""
    for name, why in unused_keys(config).items():
        section, key = name.split(".")
        if key in getattr(config, section).model_fields_set:
            raise InputError(file, f"key {name} = {getattr(getattr(config, section), key)!r}", why)
