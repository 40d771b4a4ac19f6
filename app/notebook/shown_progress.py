"""Progress of long work in a notebook: one line below the cell, which renews itself."""

from __future__ import annotations

import time
from typing import Any

from ..process.progress import Progress, no_progress
from .inline import in_notebook

INTERVAL = 0.5  # [s] between renewals


def shown_progress() -> Progress:
    """Return the progress of a notebook's cell; outside notebooks nothing is shown."""
    return _CellProgress() if in_notebook() else no_progress


class _CellProgress:
    """One line with every stage begun so far, such as `tracking 3/15 · solving 2/15`."""

    def __init__(self) -> None:
        self._stages: dict[str, tuple[int, int]] = {}
        self._line: Any = None
        self._renewed = 0.0

    def __call__(self, stage: str, done: int, total: int) -> None:
        from IPython.display import display  # pyright: ignore[reportMissingImports]

        self._stages[stage] = (done, total)
        now = time.monotonic()
        if done < total and now - self._renewed < INTERVAL:
            return
        self._renewed = now
        text = {"text/plain": " · ".join(f"{name} {k}/{n}" for name, (k, n) in self._stages.items())}
        if self._line is None:
            self._line = display(text, raw=True, display_id=True)
        else:
            self._line.update(text, raw=True)
