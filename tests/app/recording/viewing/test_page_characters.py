"""Bytes are encoded in a page as characters that no browser alters."""

import numpy as np
from rodsight.recording.viewing.single_page import as_characters


def test_bytes_are_recovered_from_characters_that_html_does_not_alter():
    data = np.arange(1 << 16, dtype="<u2").tobytes() + b"<"  # every pair of bytes, and a single one
    text = as_characters(data)
    assert not set("\0\r<") & set(text)
    units, flipped = [], False
    for unit in text.encode("utf-16-le").decode("utf-16-le"):  # raises at an invalid character
        if unit == "=":
            flipped = True
            continue
        units.append(ord(unit) ^ (0x8000 if flipped else 0))
        flipped = False
    assert np.array(units, "<u2").tobytes()[: len(data)] == data
    assert len(text) < 1.04 * len(data) / 2
