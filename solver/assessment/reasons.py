"""Several reasons in one text, from which each can be recovered."""

from __future__ import annotations

import re

SEPARATOR = " · "  # no reason contains it: a reason and its cure may be joined by a semicolon


def join_reasons(*reasons: str) -> str:
    """Join reasons, or texts of several, to one text; empty ones are left out."""
    return SEPARATOR.join(filter(None, reasons))


def split_reasons(text: str) -> list[str]:
    """Return the single reasons of a text."""
    return [each for each in text.split(SEPARATOR) if each]


def without_numbers(reason: str) -> str:
    """Return what a reason has in common with the same one of other frames, whose numbers differ."""
    return re.sub(r"\d+(\.\d+)?(e[+-]?\d+)?", "0", reason)
