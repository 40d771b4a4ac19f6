"""Texts that the viewer can draw.

Its two built-in fonts have Latin, Greek, Cyrillic and common signs. A character that one of them lacks does not
show as a box: it ends the viewer. So every text that comes from outside passes through here.
"""

from __future__ import annotations

import unicodedata

STAND_IN = "?"

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
_ALIKE = {"\t": "    ", "\r": "", "⟨": "<", "⟩": ">"}


def printable(text: str) -> str:
    """The text with every character that the viewer cannot draw replaced by a question mark."""
    composed = unicodedata.normalize("NFC", text)
    return "".join(_ALIKE.get(c, c if _known(c) else STAND_IN) for c in composed)


def _known(character: str) -> bool:
    code = ord(character)
    return character in _SIGNS or any(low <= code <= high for low, high in _RANGES)
