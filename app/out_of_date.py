"""Whether the results in a run's folder still belong to their experiment: input, settings, verdicts and code."""

from __future__ import annotations

from pathlib import Path

from .experiment.experiment import Experiment, load_experiment, named_inputs
from .process.errors import InputError, RunError
from .process.sources import hash_of_code
from .process.version import library_versions
from .results.manifest import Manifest
from .run_folder import RESULTS, input_stamps, owner_of, settings_in_file
from .stages import FORCES
from .verdicts.decisions import fingerprint
from .verdicts.log import VERDICTS, VerdictLog

LISTED = 3  # files that a reason names


def out_of_date(folder: Path, root: Path | None = None) -> list[str]:
    """Return the reasons for which the results of a run's folder are out of date.

    Files of unchanged size, number and times are not read.

    Parameters
    ----------
    folder : Path
        The run's folder.
    root : Path, optional
        Folder outside of which no file of the experiment is read.

    Returns
    -------
    list of str
        Clauses such as "walls.csv has changed"; empty where nothing has changed, or where the folder holds no results,
        or the experiment is not at hand.
    """
    manifest, owner = Manifest(folder), owner_of(folder)
    piece = manifest.piece(RESULTS)
    files = piece.get("files")
    if owner is None or not owner.is_file() or not isinstance(files, dict):
        return []
    reasons = []
    if settings_in_file(owner) != piece.get("file_settings"):
        reasons.append(f"{owner.name} has changed")
    try:
        reasons += _changed_inputs(load_experiment(owner, root=root), files, piece.get("stamps"))
    except (InputError, RunError, OSError) as error:
        reasons.append(f"its input cannot be read: {error}")
    if fingerprint(VerdictLog(folder / VERDICTS).snapshot()) != piece.get("verdicts"):
        reasons.append("verdicts have changed")
    if piece.get("code") != hash_of_code(FORCES.code, FORCES.alone) or piece.get("libraries") != library_versions():
        reasons.append("other code or libraries made it")
    return reasons


def _changed_inputs(experiment: Experiment, listed: dict[str, str], stamps: object) -> list[str]:
    """Return reasons for changed, new and missing input files."""
    former = stamps if isinstance(stamps, dict) else {}
    now, names = input_stamps(experiment), named_inputs(experiment)
    changed = [
        name
        for file, name in names.items()
        if name in now
        and name in listed
        and now[name] != former.get(name)
        and experiment.inputs.checksum(file) != listed[name]
    ]
    reasons = []
    for files, state in (
        (changed, "changed"), (sorted(now.keys() - listed.keys()), "been added"),
        (sorted(listed.keys() - now.keys()), "been removed"),
    ):  # fmt: skip
        if files:
            more = f" and {len(files) - LISTED} more" if len(files) > LISTED else ""
            verb = "has" if len(files) == 1 else "have"
            reasons.append(f"{', '.join(files[:LISTED])}{more} {verb} {state}")
    return reasons
