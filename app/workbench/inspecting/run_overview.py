"""A run in a few words: its frames, and the reasons not to take its forces as they are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...results.finding import Finding
from ...run_folder import RESULTS, SUMMARY, TRACKS, UNFINISHED
from .run_data import first_photograph

LISTED = 5  # photographs that a sentence names
UNUSABLE = ("suspect", "failed")


def run_overview(folder: Path, outdated: Sequence[str] = ()) -> dict[str, Any] | None:
    """Summarise the run in a folder; None where there is none.

    Parameters
    ----------
    folder : Path
        The run's folder.
    outdated : sequence of str
        The reasons for which its results are out of date.

    Returns
    -------
    dict or None
        `faults`: sentences about results that are out of date, causes of wrong forces that the diagnosis found, failed
        photographs, and runs without a settled frame; `corrected`: causes that the run has corrected itself.
    """
    unfinished = (folder / UNFINISHED).is_dir()
    try:
        summary = json.loads((folder / SUMMARY).read_bytes())
    except (OSError, ValueError):
        present = unfinished or (folder / TRACKS).is_file()
        return {"unfinished": unfinished, "out_of_date": [], "faults": [], "corrected": []} if present else None
    found = _findings(summary.get("diagnosis"))
    wrong = [each.sentence() for each in found if not each.corrected]
    trust = [each for each in summary.get("trust", []) if isinstance(each, int | float)]
    return {
        "unfinished": unfinished,
        "frames": summary.get("frame_count"),
        "rods": summary.get("grain_count"),
        "status": summary.get("status_count", {}),
        "trust": min(trust) if trust else None,
        "lost": summary.get("lost_grains"),
        "force_unit": summary.get("force_unit", "N"),  # of earlier runs
        "finished_at": (folder / SUMMARY).stat().st_mtime,
        "out_of_date": list(outdated),
        "causes": len(wrong),
        "corrected": [each.statement() for each in found if each.corrected],
        "faults": [
            *_outdated(outdated),
            *wrong,
            *_failures(folder, summary.get("failures")),
            *_unusable(summary.get("status_count")),
        ],
    }


def _outdated(reasons: Sequence[str]) -> list[str]:
    return [f"Out of date: {'; '.join(reasons)}. Run again."] if reasons else []


def _findings(diagnosis: Any) -> list[Finding]:
    """Read what the diagnosis found from the summary of a run; nothing where an earlier version wrote it."""
    try:
        return [Finding.of_plain(each) for each in diagnosis or []]
    except TypeError:
        return []


def _failures(folder: Path, failures: Any) -> list[str]:
    """State the photographs that have no forces, each with its reason."""
    if not isinstance(failures, dict) or not failures:
        return []
    first = first_photograph(folder / RESULTS) if (folder / RESULTS).is_file() else 0
    listed = [(first + int(frame), reason) for frame, reason in failures.items()][:LISTED]
    stated = [f"Photograph {number} has no forces: {reason}." for number, reason in listed]
    return [*stated, f"{len(failures) - LISTED} more have none."] if len(failures) > LISTED else stated


def _unusable(counts: Any) -> list[str]:
    """State that every frame is suspect or failed."""
    if not isinstance(counts, dict) or not counts or any(name not in UNUSABLE and name != "reset" for name in counts):
        return []
    if not any(name in UNUSABLE for name in counts):  # one frame alone
        return []
    return ["Every frame is suspect: the forces of no photograph agree with motion and load."]
