"""Several reasons in one text, from which each can be had again."""

from __future__ import annotations

SEPARATOR = " · "  # no reason contains it: a reason and its cure may be joined by a semicolon


def join_reasons(*reasons: str) -> str:
    """Join reasons, or texts of several, to one text; empty ones are left out."""
    return SEPARATOR.join(filter(None, reasons))


def split_reasons(text: str) -> list[str]:
    """Return the single reasons of a text."""
    return [each for each in text.split(SEPARATOR) if each]
