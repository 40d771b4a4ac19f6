"""Ranges of frames as a user writes them: A:B."""

from __future__ import annotations

from ..errors import InputError


def parse_frames(text: str | None) -> tuple[int, int | None]:
    """First frame and end (None: to the last) of a range A:B; either side may be left out. Raises InputError."""
    if text is None:
        return 0, None
    first, colon, last = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return int(first or 0), int(last) if last else None
    except ValueError:
        raise InputError("--frames", text, "is not A:B, such as 0:12") from None
