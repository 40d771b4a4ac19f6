"""A PNG is complete where no part is missing and every checksum is right."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.png_chunks import OVERHEAD, is_whole_png

PICTURE = np.random.default_rng(0).integers(0, 255, (40, 60), dtype=np.uint8)
WHOLE = cv2.imencode(".png", PICTURE)[1].tobytes()
END = len(WHOLE) - OVERHEAD


def test_an_encoded_png_is_complete():
    assert is_whole_png(WHOLE)
    assert is_whole_png(WHOLE + b"bytes after the end are ignored")


@pytest.mark.parametrize("content", [b"", b"text", WHOLE[:8], WHOLE[1:], WHOLE[:-1], WHOLE[:END], WHOLE[:100]])
def test_a_truncated_png_is_incomplete(content):
    assert not is_whole_png(content)


@pytest.mark.parametrize("at", [8, 12, 20, 30, 45, len(WHOLE) // 2, END - 1, END, END + 5, len(WHOLE) - 1])
def test_a_single_wrong_bit_is_found(at):
    content = bytearray(WHOLE)
    content[at] ^= 1
    assert not is_whole_png(bytes(content))


def test_a_png_without_data_is_incomplete():
    header = WHOLE[: 8 + OVERHEAD + 13]
    assert not is_whole_png(header + WHOLE[END:])
