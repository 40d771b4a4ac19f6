"""How long work tells that it goes on, and what failed in it: callables that stages call, whatever shows it."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    def __call__(self, stage: str, done: int, total: int) -> None:
        """`done` of `total` steps of a stage are finished."""


def silent(stage: str, done: int, total: int) -> None:
    """Show nothing."""


class Observer(Protocol):
    def __call__(self, stage: str, frame: int, error: Exception) -> None:
        """A frame has failed in a stage for this; the others go on."""


def unheard(stage: str, frame: int, error: Exception) -> None:
    """Hear nothing."""
