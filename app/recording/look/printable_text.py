"""Restricts texts to the characters that the viewer can draw.

Its two built-in fonts have Latin, Greek, Cyrillic and common signs. The viewer ends with an error at a character that
one of them lacks. Every text from outside is therefore converted by `printable`.
"""

from __future__ import annotations

import unicodedata

REPLACEMENT = "?"

_RANGES = (
    (0x20, 0x7E),
    (0xA1, 0xAC),
    (0xAE, 0x148),
    (0x14A, 0x17E),
    (0x391, 0x3A1),
    (0x3A3, 0x3A9),
    (0x3B1, 0x3C9),
    (0x410, 0x44F),
)
_SIGNS = frozenset("\n–—‘’“”…•·′″→←−≈≠≤≥∞⁰⁴⁵⁶⁷⁸⁹₀₁₂₃₄₅₆₇₈₉√")
_SUBSTITUTES = {"\t": "    ", "\r": "", "⟨": "<", "⟩": ">"}


def printable(text: str) -> str:
    """Return the text with every character that the viewer cannot draw replaced by a question mark."""
    composed = unicodedata.normalize("NFC", text)
    return "".join(_SUBSTITUTES.get(c, c if _is_printable(c) else REPLACEMENT) for c in composed)


def _is_printable(character: str) -> bool:
    code = ord(character)
    return character in _SIGNS or any(low <= code <= high for low, high in _RANGES)
