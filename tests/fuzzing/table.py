"""Counts of the last full run, stored between tests, and their table in app/docs/robustness.md.

`pytest -m slow tests/fuzzing` fills it, `python -m tests.fuzzing` prints it and writes the page.
"""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime
from pathlib import Path

MUTATIONS, KILLS, FAULTS, REQUESTS = 10_000, 100, 40, 800  # of a full run, at least
FRAMES, GROWTH = 1000, 0.05  # of the long run, and limit of the relative growth of its memory from frame 50 on
PEAK_GROWTH = 0.02  # [MB] a photograph of 250 rods, of whole commands from 100 photographs on, at most
FILE = Path(__file__).with_name("last_run.json")
PAGE = Path(__file__).parents[2] / "app" / "docs" / "robustness.md"

_ROWS = {
    "mutations": ("corrupted inputs", "tracebacks, hangs, partial files, messages of several lines", "test_fuzzing"),
    "kills": ("kills (SIGKILL)", "runs that lost frames, or whose results differ in a bit", "test_kills"),
    "faults": ("failing reads and writes", "ends without a single message", "test_faults"),
    "frames": ("photographs of one long run", "stages whose memory grows by more than 5 % from frame 50 on",
               "test_long_runs"),
    "peak": ("photographs of whole commands",
             f"commands whose peak memory grows by more than {PEAK_GROWTH:g} MB a photograph of 250 rods, from 100 on",
             "test_peak_memory"),
    "scrubbed": ("photographs of one recording", "pictures that took more than 20 s", "test_scrubbing"),
    "requests": ("hostile requests", "admitted, or answered with a traceback", "test_hostile_requests"),
    "values": ("hostile values in requests of the page itself", "answered with a traceback", "test_hostile_values"),
}  # fmt: skip

_HEAD = """# Robustness, counted

Counts of the last runs of `pytest -m slow tests/fuzzing`, for corrupted inputs of `python -m tests.fuzzing --pieces`;
`python -m tests.fuzzing` prints the table and writes this page. A full run has at least 10 000 corrupted inputs, 100
kills, 40 faults, 800 requests of each server and 9600 of the page itself, 1000 photographs and a recording of 10 000.
Failures are corrected after they were counted, and counted again by the next run; inputs that failed once, such as
times of 1e17 s or an experiment file with a hole of 3 GB, are repeated one by one by `test_earlier_failures`.
[Threats](threats.md) lists the attacks.

"""


def note(name: str, *, tried: int, wrong: int, **more: float | str) -> None:
    """Store the counts of a campaign."""
    stored = _read()
    stored[name] = {
        "tried": tried, "wrong": wrong, **more, "day": datetime.now(UTC).date().isoformat(),
        "python": platform.python_version(),
    }  # fmt: skip
    FILE.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def render() -> str:
    """Return the page."""
    rows = ["| input | number | failures | failure means | more | test | day |", "|---|---|---|---|---|---|---|"]
    stored = _read()
    for name, (label, meaning, test) in _ROWS.items():
        found = stored.get(name)
        if found is None:
            rows.append(f"| {label} | not counted yet | | {meaning} | | `{test}` | |")
            continue
        more = "; ".join(
            f"{key} {value}" for key, value in found.items() if key not in ("tried", "wrong", "day", "python")
        )
        rows.append(
            f"| {label} | {found['tried']} | {found['wrong']} | {meaning} | {more} | `{test}` | {found['day']} |"
        )
    return _HEAD + "\n".join(rows) + "\n"


def _read() -> dict[str, dict]:
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
