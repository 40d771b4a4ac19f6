"""How long work tells that it goes on: a callable that stages call, whatever shows it."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    def __call__(self, stage: str, done: int, total: int) -> None:
        """`done` of `total` steps of a stage are finished."""


def silent(stage: str, done: int, total: int) -> None:
    """Show nothing."""
