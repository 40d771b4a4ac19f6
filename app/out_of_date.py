"""Whether the results in a run's folder still belong to their experiment: input, settings, verdicts and code."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from .experiment.experiment import Experiment, load_experiment, settings_of_file, stamp_of_input
from .process.errors import InputError, RunError
from .process.sources import hash_of_code
from .process.stages import FORCES
from .process.version import library_versions
from .results.manifest import Manifest
from .run_folder import RECORDING, RESULTS, owner_of
from .verdicts.log import VERDICTS, VerdictLog, fingerprint

LISTED = 3  # files, and settings, that are named
LONGEST = 40  # characters of a value
OTHER_CODE = "other code or libraries made it"


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
    if not piece or owner is None or not owner.is_file():
        return []
    files = piece.get("files")
    if not isinstance(files, dict):
        return [f"an earlier version made it, which did not store its input: {OTHER_CODE}"]
    reasons, settings = [], piece.get("file_settings")
    try:
        experiment = load_experiment(owner, root=root)
        reasons = _changed_settings(owner.name, experiment.file_settings, settings)
        reasons += _changed_inputs(experiment, files, piece.get("stamps"))
    except (InputError, RunError, OSError) as error:
        reasons = reasons or _changed_settings(owner.name, _settings_now(owner), settings)
        reasons.append(f"its input cannot be read: {error}")
    if fingerprint(VerdictLog(folder / VERDICTS).snapshot()) != piece.get("verdicts"):
        reasons.append("verdicts have changed")
    if piece.get("code") != hash_of_code(FORCES.code, FORCES.alone) or piece.get("libraries") != library_versions():
        reasons.append(OTHER_CODE)
    return reasons


def _changed_settings(name: str, now: dict[str, Any] | None, stored: object) -> list[str]:
    """Return reasons for settings of an experiment file of this name that differ from those of the results."""
    if now is None or not isinstance(stored, dict):
        return [] if now == stored else [f"{name} has changed"]
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


def recording_out_of_date(folder: Path, root: Path | None = None) -> list[str]:
    """Return the reasons for which a run's folder, with its recording, is out of date; see `out_of_date`."""
    reasons, manifest = out_of_date(folder, root), Manifest(folder)
    made_from, results = manifest.piece(RECORDING).get("results"), manifest.piece(RESULTS).get("sha256")
    if made_from is not None and made_from != results and (folder / RECORDING).is_file():
        reasons.append(f"{RECORDING} shows earlier results")
    return reasons


def state_of_source(path: Path) -> list[str]:
    """Return why a run is out of date, by its folder, results.h5 or recording; empty for other files."""
    folder = path if path.is_dir() else path.parent
    if path.is_dir() or path.name == RESULTS:
        return out_of_date(folder)
    return recording_out_of_date(folder) if path.name == RECORDING else []


def _settings_now(file: Path) -> dict[str, Any] | None:
    with suppress(OSError):
        return settings_of_file(file.read_bytes())
    return None


def _changed_inputs(experiment: Experiment, listed: dict[str, str], stamps: object) -> list[str]:
    """Return reasons for changed, new and missing input files."""
    former = stamps if isinstance(stamps, dict) else {}
    names, now = experiment.named_inputs(), {}
    for file, name in names.items():
        with suppress(OSError):  # it is missing
            now[name] = stamp_of_input(file)
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
