"""The callback of long work: progress of its stages."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    def __call__(self, stage: str, done: int, total: int) -> None:
        """Receive that `done` of `total` steps of a stage are finished."""


def no_progress(stage: str, done: int, total: int) -> None:
    """Show nothing."""
