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

LISTED = 3  # files, and settings, that are named
LONGEST = 40  # characters of a value


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
    reasons = _changed_settings(owner, piece.get("file_settings"))
    try:
        reasons += _changed_inputs(load_experiment(owner, root=root), files, piece.get("stamps"))
    except (InputError, RunError, OSError) as error:
        reasons.append(f"its input cannot be read: {error}")
    if fingerprint(VerdictLog(folder / VERDICTS).snapshot()) != piece.get("verdicts"):
        reasons.append("verdicts have changed")
    if piece.get("code") != hash_of_code(FORCES.code, FORCES.alone) or piece.get("libraries") != library_versions():
        reasons.append("other code or libraries made it")
    return reasons


def _changed_settings(file: Path, stored: object) -> list[str]:
    """Return reasons for settings that differ from those of the results."""
    now = settings_in_file(file)
    if now is None or not isinstance(stored, dict):
        return [] if now == stored else [f"{file.name} has changed"]
    changed = sorted(key for key in now.keys() | stored.keys() if now.get(key) != stored.get(key))
    reasons = [_change_of(key, stored.get(key), now.get(key)) for key in changed[:LISTED]]
    rest = len(changed) - LISTED
    return [*reasons, f"{rest} more setting{'s have' if rest > 1 else ' has'} changed"] if rest > 0 else reasons


def _change_of(key: str, before: object, now: object) -> str:
    """Describe the change of one setting; None: it was not, or is no longer given."""
    if before is None:
        return f"{key} was not given and is {_value(now)}"
    return f"{key} was {_value(before)} and is {'no longer given' if now is None else _value(now)}"


def _value(value: object) -> str:
    """A value as a reader takes it in: numbers with their digits, long ones cut."""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} …"


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
