"""Raw files of cameras through rawpy: a small uncompressed DNG is written tag by tag and read back."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.photographs import Photographs
from rodsight.experiment.pictures.picture_file import read_photograph

pytest.importorskip("rawpy")

HEIGHT, WIDTH = 96, 128
BLACK, WHITE = 512, 16383  # of a 14-bit sensor
# Interior pixels, where demosaicing sees a whole neighbourhood.
INSIDE = (slice(8, -8), slice(8, -8))
# [grey] rounding of 14 bits to 16 and of the colour matrices, on values up to 255
ROUNDING = 0.3

BYTE, ASCII, SHORT, LONG, RATIONAL, SIGNED_RATIONAL = 1, 2, 3, 4, 5, 10
XYZ_OF_SRGB = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def rationals(values: np.ndarray, kind: str) -> bytes:
    return b"".join(struct.pack(f"<{kind}{kind}", round(float(v) * 10000), 10000) for v in np.ravel(values))


def write_dng(file: Path, sensor: np.ndarray, orientation: int = 1) -> Path:
    """A little-endian DNG of one uncompressed strip; sensor (H, W) uint16 behind red, green / green, blue filters."""
    height, width = sensor.shape
    matrix = np.linalg.inv(XYZ_OF_SRGB)  # a camera whose own colours are those of sRGB
    tags: list[tuple[int, int, int, bytes]] = [
        (254, LONG, 1, struct.pack("<I", 0)),  # a full picture
        (256, LONG, 1, struct.pack("<I", width)),
        (257, LONG, 1, struct.pack("<I", height)),
        (258, SHORT, 1, struct.pack("<H", 16)),  # bits
        (259, SHORT, 1, struct.pack("<H", 1)),  # not compressed
        (262, SHORT, 1, struct.pack("<H", 32803)),  # a colour filter array
        (271, ASCII, 5, b"Test\0"),  # maker
        (272, ASCII, 5, b"Test\0"),  # model
        (273, LONG, 1, b"\0\0\0\0"),  # offset of the strip: filled in below
        (274, SHORT, 1, struct.pack("<H", orientation)),
        (277, SHORT, 1, struct.pack("<H", 1)),  # samples a pixel
        (278, LONG, 1, struct.pack("<I", height)),  # rows in the strip
        (279, LONG, 1, struct.pack("<I", 2 * sensor.size)),  # bytes in the strip
        (284, SHORT, 1, struct.pack("<H", 1)),  # chunky
        (33421, SHORT, 2, struct.pack("<HH", 2, 2)),  # the filters repeat every 2 x 2 pixels
        (33422, BYTE, 4, bytes([0, 1, 1, 2])),  # red, green, green, blue
        (50706, BYTE, 4, bytes([1, 4, 0, 0])),  # DNG version
        (50708, ASCII, 10, b"Test Test\0"),  # unique model
        (50714, LONG, 1, struct.pack("<I", BLACK)),
        (50717, LONG, 1, struct.pack("<I", WHITE)),
        (50721, SIGNED_RATIONAL, 9, rationals(matrix, "i")),  # colour matrix
        (50728, RATIONAL, 3, rationals(np.ones(3), "I")),  # neutral: equal values are grey
        (50778, SHORT, 1, struct.pack("<H", 21)),  # D65
    ]
    size = 2 + 12 * len(tags) + 4
    at = 8 + size
    entries, beyond = b"", b""
    strip = at + sum(len(value) + len(value) % 2 for *_, value in tags if len(value) > 4)
    for tag, kind, count, value in tags:
        content = struct.pack("<I", strip) if tag == 273 else value
        if len(content) > 4:
            place = struct.pack("<I", at + len(beyond))
            beyond += content + b"\0" * (len(content) % 2)
        else:
            place = content.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, kind, count) + place
    header = b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", len(tags))
    file.write_bytes(header + entries + struct.pack("<I", 0) + beyond + sensor.astype("<u2").tobytes())
    return file


def exposed(fraction: np.ndarray | float) -> np.ndarray:
    """Return the sensor's counts (H, W) under a fraction of the full light."""
    light = np.broadcast_to(np.asarray(fraction, dtype=np.float64), (HEIGHT, WIDTH))
    return np.rint(BLACK + light * (WHITE - BLACK)).astype(np.uint16)


def test_no_light_is_black_and_full_light_is_white(tmp_path: Path) -> None:
    dark = read_photograph(write_dng(tmp_path / "dark.dng", exposed(0.0)))
    full = read_photograph(write_dng(tmp_path / "full.dng", exposed(1.0)))
    assert dark.shape == (HEIGHT, WIDTH)
    assert np.abs(dark[INSIDE]).max() < ROUNDING
    assert np.abs(full[INSIDE] - 255.0).max() < ROUNDING


def test_more_than_eight_bits_are_kept(tmp_path: Path) -> None:
    ramp = np.linspace(0.40, 0.42, WIDTH)[None, :] * np.ones((HEIGHT, 1))
    image = read_photograph(write_dng(tmp_path / "ramp.dng", exposed(ramp)))
    row = image[HEIGHT // 2, 8:-8]
    assert (np.diff(row) > 0.0).all()
    # Every column has its own level although the ramp rises by less than five of 255.
    assert row[-1] - row[0] < 5.0


def test_photographs_of_one_scene_in_dimmer_light_stay_dimmer(tmp_path: Path) -> None:
    """Brightness is not adapted to a photograph's content: a darker one stays darker."""
    spots = np.where(np.add.outer(np.arange(HEIGHT) // 16, np.arange(WIDTH) // 16) % 2 == 0, 0.3, 0.6)
    bright = read_photograph(write_dng(tmp_path / "a.dng", exposed(spots)))
    dim = read_photograph(write_dng(tmp_path / "b.dng", exposed(0.5 * spots)))
    assert dim[24, 24] < bright[24, 24] - 10.0
    assert dim[24, 24] == pytest.approx(
        read_photograph(write_dng(tmp_path / "c.dng", exposed(0.5 * spots[24, 24])))[24, 24], abs=ROUNDING
    )


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_the_orientation_tag_is_ignored(tmp_path: Path, orientation: int) -> None:
    light = np.full((HEIGHT, WIDTH), 0.2)
    light[: HEIGHT // 4, : WIDTH // 4] = 0.8  # top left on the sensor
    image = read_photograph(write_dng(tmp_path / "turned.dng", exposed(light), orientation))
    assert image.shape == (HEIGHT, WIDTH)
    assert image[HEIGHT // 8, WIDTH // 8] > image[-HEIGHT // 8, -WIDTH // 8] + 50.0
    assert image[HEIGHT // 8, WIDTH // 8] > image[HEIGHT // 8, -WIDTH // 8] + 50.0


def test_raw_files_are_found_as_photographs(tmp_path: Path) -> None:
    for k in range(2):
        write_dng(tmp_path / f"img{k}.dng", exposed(0.4))
    photographs = Photographs.matching(tmp_path, "*.dng")
    assert len(photographs) == 2
    assert photographs.shape == (HEIGHT, WIDTH)
