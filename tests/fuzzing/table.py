"""What the last full run counted, kept from test to test, and the table of it in app/docs/robustness.md.

`pytest -m slow tests/fuzzing` fills it, `python -m tests.fuzzing` prints it and writes the page.
"""

from __future__ import annotations

import json
import platform
from datetime import UTC, datetime
from pathlib import Path

MUTATIONS, KILLS, FAULTS, REQUESTS = 10_000, 100, 40, 800  # of a full run, at least
FRAMES, GROWTH = 1000, 0.05  # of the long run, and by how much its memory may grow from frame 50 on
FILE = Path(__file__).with_name("last_run.json")
PAGE = Path(__file__).parents[2] / "app" / "docs" / "robustness.md"

_ROWS = {
    "mutations": ("spoiled inputs", "tracebacks, hangs, half-written files, second lines", "test_fuzzing"),
    "kills": ("kills (SIGKILL)", "runs that lost frames, or whose results differ in a bit", "test_kills"),
    "faults": ("refused reads and writes", "ends without their one line", "test_faults"),
    "frames": ("photographs of one long run", "stages whose memory grows by more than 5 % from frame 50 on",
               "test_long_runs"),
    "scrubbed": ("photographs of one recording", "pictures that took more than 20 s", "test_scrubbing"),
    "requests": ("hostile requests", "let in, or answered with a traceback", "test_hostile_requests"),
}  # fmt: skip

_HEAD = """# Robustness, counted

The last runs of `pytest -m slow tests/fuzzing` counted this, the spoiled inputs in pieces (`python -m tests.fuzzing
--pieces`); `python -m tests.fuzzing` prints it and writes this page. A full run is 10 000 spoiled inputs, 100 kills, 40
refusals, 800 requests, 1000 photographs and a recording of 10 000 at least. What went wrong is mended after it was
counted, and counted again by the next run. What strangers may try is in [threats](threats.md).

"""


def note(name: str, *, tried: int, wrong: int, **more: float | str) -> None:
    """Keep what a campaign counted."""
    told = _read()
    told[name] = {
        "tried": tried, "wrong": wrong, **more, "day": datetime.now(UTC).date().isoformat(),
        "python": platform.python_version(),
    }  # fmt: skip
    FILE.write_text(json.dumps(told, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def render() -> str:
    """The page."""
    rows = ["| tried | how many | went wrong | what that means | more | test | day |", "|---|---|---|---|---|---|---|"]
    found = _read()
    for name, (what, meaning, test) in _ROWS.items():
        told = found.get(name)
        if told is None:
            rows.append(f"| {what} | not counted yet | | {meaning} | | `{test}` | |")
            continue
        more = "; ".join(
            f"{key} {value}" for key, value in told.items() if key not in ("tried", "wrong", "day", "python")
        )
        rows.append(f"| {what} | {told['tried']} | {told['wrong']} | {meaning} | {more} | `{test}` | {told['day']} |")
    return _HEAD + "\n".join(rows) + "\n"


def _read() -> dict[str, dict]:
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}
