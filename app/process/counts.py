"""Numbers of things in sentences."""

from __future__ import annotations


def state_count(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless there is one.

    Examples
    --------
    >>> state_count(1, "frame"), state_count(0, "frame")
    ('1 frame', '0 frames')
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
