"""Read the size of a photograph from its header, before memory is allocated for its pixels."""

from __future__ import annotations

import struct

# Markers of a JPEG frame, which holds the size: SOF0 … SOF15 without those of other meaning.
FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
STANDALONE = frozenset((0x01, *range(0xD0, 0xD9)))  # markers without a length
WIDTH, HEIGHT = 256, 257  # tags of a TIFF
MOST_PAGES = 100_000  # of a TIFF that are counted
SHORT = 3  # a TIFF's type of 16 bits


def claimed_size(content: bytes) -> tuple[int, int] | None:
    """Return the width and height [px] in the header of a PNG, JPEG or TIFF; None where they cannot be read."""
    try:
        if content.startswith(b"\x89PNG\r\n\x1a\n"):
            return struct.unpack(">II", content[16:24])
        if content.startswith(b"\xff\xd8"):
            return _size_of_jpeg(content)
        if content[:4] in (b"II*\0", b"MM\0*"):
            return _size_of_tiff(content)
    except (struct.error, IndexError):  # truncated: the decoder reports it
        return None
    return None


def _size_of_jpeg(content: bytes) -> tuple[int, int] | None:
    at = 2
    while content[at] == 0xFF:
        marker = content[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
        elif marker in STANDALONE:
            at += 2
        elif marker in FRAMES:
            height, width = struct.unpack(">HH", content[at + 5 : at + 9])
            return width, height
        else:
            at += 2 + struct.unpack(">H", content[at + 2 : at + 4])[0]
    return None


def pages_alike(content: bytes) -> int:
    """Return the number of pages of a TIFF that are as large as the first; 1 for other files."""
    if content[:4] not in (b"II*\0", b"MM\0*"):
        return 1
    order, sizes = "<" if content.startswith(b"II") else ">", []
    try:
        (at,) = struct.unpack(order + "I", content[4:8])
        while at and len(sizes) < MOST_PAGES:
            sizes.append(_size_of_page(content, order, at))
            (count,) = struct.unpack(order + "H", content[at : at + 2])
            (at,) = struct.unpack(order + "I", content[at + 2 + 12 * count : at + 6 + 12 * count])
    except struct.error:  # truncated: the decoder reports it
        pass
    return max(sizes.count(sizes[0]), 1) if sizes else 1


def _size_of_tiff(content: bytes) -> tuple[int, int] | None:
    order = "<" if content.startswith(b"II") else ">"
    (at,) = struct.unpack(order + "I", content[4:8])
    return _size_of_page(content, order, at)


def _size_of_page(content: bytes, order: str, at: int) -> tuple[int, int] | None:
    (count,) = struct.unpack(order + "H", content[at : at + 2])
    found: dict[int, int] = {}
    for entry in range(at + 2, at + 2 + 12 * count, 12):
        tag, kind = struct.unpack(order + "HH", content[entry : entry + 4])
        form, size = ("H", 2) if kind == SHORT else ("I", 4)
        if tag in (WIDTH, HEIGHT):
            (found[tag],) = struct.unpack(order + form, content[entry + 8 : entry + 8 + size])
    return (found[WIDTH], found[HEIGHT]) if len(found) == 2 else None
