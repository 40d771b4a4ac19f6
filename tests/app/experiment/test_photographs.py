"""Photographs: order, depth, colour, and errors of files that are not photographs."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_grain_guess, read_times
from rodsight.experiment.photographs import Photographs, PrefetchedPhotographs
from rodsight.experiment.pictures.image import ImageSelection
from rodsight.experiment.pictures.picture_file import read_photograph
from rodsight.experiment.reading.input_files import InputFiles
from rodsight.experiment.reading.photograph_order import in_order
from rodsight.process.errors import InputError, RunError

ROUNDING = 1e-3  # [grey] float32 arithmetic on values up to 255


def write(folder: Path, name: str, pixels: np.ndarray) -> Path:
    file = folder / name
    assert cv2.imwrite(str(file), pixels)
    return file


def test_files_come_in_natural_order(tmp_path: Path) -> None:
    for name in ("img10.png", "img2.png", "img1.png", "img100.png", "IMG3.png"):
        write(tmp_path, name, np.zeros((4, 5), np.uint8))
    photographs = Photographs.matching(tmp_path, "*.png")
    assert [file.name for file in photographs.files] == ["img1.png", "img2.png", "IMG3.png", "img10.png", "img100.png"]


def test_length_shape_and_items(tmp_path: Path) -> None:
    for k in range(3):
        write(tmp_path, f"p{k}.png", np.full((4, 6), 10 * k, np.uint8))
    photographs = Photographs.matching(tmp_path, "p*.png")
    assert len(photographs) == 3
    assert photographs.shape == (4, 6)
    assert [float(image.mean()) for image in photographs] == [0.0, 10.0, 20.0]
    assert photographs[-1].mean() == 20.0
    assert photographs[0].dtype == np.float32


def test_photographs_are_read_on_access(tmp_path: Path) -> None:
    write(tmp_path, "a.png", np.zeros((4, 4), np.uint8))
    (tmp_path / "b.png").write_text("no photograph")
    photographs = Photographs.matching(tmp_path, "*.png")
    assert photographs.shape == (4, 4)
    with pytest.raises(InputError):
        photographs.check()


def test_a_complete_png_is_checked_without_decoding_and_a_damaged_one_is_named(tmp_path: Path, monkeypatch) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8)
    files = [write(tmp_path, f"{k}.png", noise) for k in range(3)]
    decoded = []
    monkeypatch.setattr(cv2, "imdecode", lambda *given, really=cv2.imdecode: decoded.append(1) or really(*given))
    Photographs(files).check()
    assert len(decoded) == 1  # the first, for the size of all
    content = bytearray(files[2].read_bytes())
    content[len(content) // 2] ^= 1
    files[2].write_bytes(bytes(content))
    with pytest.raises(InputError, match=r"2\.png"):
        Photographs(files).check()


def test_check_names_a_photograph_of_another_size(tmp_path: Path) -> None:
    for name, shape in (("a1.png", (4, 6)), ("a2.png", (6, 4))):
        write(tmp_path, name, np.zeros(shape, np.uint8))
    with pytest.raises(InputError, match=r"a2\.png: photograph 1: is 4 x 6 pixels"):
        Photographs.matching(tmp_path, "*.png").check()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits_keep_every_level(tmp_path: Path, suffix: str) -> None:
    levels = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    image = read_photograph(write(tmp_path, "deep" + suffix, levels))
    assert len(np.unique(image)) == 65536
    assert image.max() == pytest.approx(255.0, abs=ROUNDING)


def test_eight_and_sixteen_bits_share_their_full_scale(tmp_path: Path) -> None:
    eight = read_photograph(write(tmp_path, "8.png", np.array([[0, 100, 255]], np.uint8)))
    sixteen = read_photograph(write(tmp_path, "16.png", np.array([[0, 25700, 65535]], np.uint16)))
    assert np.abs(eight - sixteen).max() < ROUNDING


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [3, 4])
def test_colour_becomes_luma(tmp_path: Path, kind: type, channels: int) -> None:
    full = np.iinfo(kind).max
    colour = np.full((3, 3, channels), full, kind)
    colour[..., 0], colour[..., 1], colour[..., 2] = 0, 0, full  # pure red, in OpenCV's order
    image = read_photograph(write(tmp_path, "red.png", colour))
    assert image.shape == (3, 3)
    assert np.abs(image - 0.299 * 255.0).max() < ROUNDING


def test_no_match_names_the_pattern(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\*\.png.*no file matches"):
        Photographs.matching(tmp_path, "*.png")


@pytest.mark.parametrize(
    ("pattern", "meant"),
    [
        ("shots", "../shots/*.png"),
        ("shots/*.png", "../shots/*.png"),
        ("../shots", "../shots/*.png"),
        ("own", "own/*.png"),
    ],
)
def test_what_was_meant_is_named_where_nothing_matches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pattern: str, meant: str
) -> None:
    for name in ("shots", "experiment/own"):
        (tmp_path / name).mkdir(parents=True)
        write(tmp_path, f"{name}/1.png", np.zeros((3, 3), np.uint8))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=rf"no file matches; write '{re.escape(meant)}'$"):
        Photographs.matching(Path("experiment"), pattern)
    assert len(Photographs.matching(Path("experiment"), meant)) == 1


def test_nothing_is_proposed_where_nothing_is_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no file matches$"):
        Photographs.matching(tmp_path, "shots/*.png")


def test_no_files_are_refused() -> None:
    with pytest.raises(InputError, match="no photographs"):
        Photographs([])


@pytest.mark.parametrize("content", [b"", b"text", b"\x89PNG\r\n\x1a\n broken"])
def test_unreadable_file_is_named(tmp_path: Path, content: bytes, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.png").write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.png"):
        Photographs.matching(tmp_path, "*.png").check()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_truncated_file_is_refused(tmp_path: Path, suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8)
    file = write(tmp_path, "cut" + suffix, noise)
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(InputError, match="cut short"):
        read_photograph(file)
    assert capfd.readouterr().err == ""


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.png"):
        Photographs([tmp_path / "gone.png"])[0]


def test_floating_point_depth_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="8 or 16 bits"):
        read_photograph(write(tmp_path, "real.tif", np.zeros((4, 4), np.float32)))


def test_different_size_is_named(tmp_path: Path) -> None:
    write(tmp_path, "a1.png", np.zeros((4, 6), np.uint8))
    write(tmp_path, "a2.png", np.zeros((6, 4), np.uint8))
    photographs = Photographs.matching(tmp_path, "*.png")
    with pytest.raises(InputError, match=r"a2\.png: photograph 1: is 4 x 6 pixels, the first photograph 6 x 4"):
        photographs[1]


def fake_rawpy(pixels: np.ndarray | None, options: dict[str, object]) -> ModuleType:
    """Return a stand-in for the used part of rawpy: red, green, blue `pixels`, or None for an unreadable file."""

    class LibRawError(Exception):
        pass

    class Raw:
        def __enter__(self) -> SimpleNamespace:
            def postprocess(**choices: object) -> np.ndarray:
                options.update(choices)
                assert pixels is not None
                return pixels

            return SimpleNamespace(postprocess=postprocess)

        def __exit__(self, *_: object) -> None:
            pass

    def imread(_: io.BytesIO) -> Raw:
        if pixels is None:
            raise LibRawError("Unsupported file format")
        return Raw()

    module = ModuleType("rawpy")
    module.__dict__.update(LibRawError=LibRawError, imread=imread)
    return module


def test_raw_files_are_developed_alike_and_to_full_depth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    red_green_blue = np.array([[[65535, 0, 0], [0, 65535, 0], [0, 0, 65535], [257, 257, 257]]], np.uint16)
    options: dict[str, object] = {}
    monkeypatch.setitem(sys.modules, "rawpy", fake_rawpy(red_green_blue, options))
    (tmp_path / "a.NEF").write_bytes(b"raw")
    image = read_photograph(tmp_path / "a.NEF")
    assert image[0] == pytest.approx([0.299 * 255, 0.587 * 255, 0.114 * 255, 1.0], abs=ROUNDING)
    assert options["output_bps"] == 16
    assert options["no_auto_bright"] is True
    assert options["user_flip"] == 0


def test_a_raw_file_without_its_reader_names_the_package_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rawpy", None)
    (tmp_path / "a.CR2").write_bytes(b"raw")
    with pytest.raises(InputError, match=r"a\.CR2.*rodsight\[raw\]"):
        read_photograph(tmp_path / "a.CR2")


def test_an_unreadable_raw_file_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rawpy", fake_rawpy(None, {}))
    (tmp_path / "a.dng").write_bytes(b"raw")
    with pytest.raises(InputError, match=r"a\.dng.*Unsupported file format"):
        read_photograph(tmp_path / "a.dng")


def test_a_photograph_that_is_replaced_during_a_run_is_refused(tmp_path: Path) -> None:
    for name in ("0.png", "1.png"):
        cv2.imwrite(str(tmp_path / name), np.full((4, 4), 7, np.uint8))
    photographs = Photographs.matching(tmp_path, "*.png")
    photographs = Photographs(photographs.files, inputs=InputFiles())
    assert photographs[1][0, 0] == 7
    cv2.imwrite(str(tmp_path / "1.png"), np.full((4, 4), 9, np.uint8))
    with pytest.raises(RunError, match=r"1\.png: has changed"):
        photographs[1]
    assert photographs[0][0, 0] == 7


@pytest.fixture
def coloured(tmp_path) -> Path:
    """A photograph of 6 x 8 pixels, blue 10, green 20, red 30, with one bright column."""
    image = np.full((6, 8, 3), (10, 20, 30), np.uint8)
    image[:, 3] = 200
    cv2.imwrite(str(tmp_path / "a.png"), image)
    return tmp_path / "a.png"


@pytest.mark.parametrize(("channel", "level"), [("red", 30), ("green", 20), ("blue", 10)])
def test_one_channel_is_used(coloured, channel, level):
    image = Photographs([coloured], selection=ImageSelection(channel))[0]
    assert image[0, 0] == level
    assert image[0, 3] == 200


def test_all_channels_need_one_decoding(coloured, monkeypatch):
    alone = {
        name: Photographs([coloured], selection=ImageSelection(name))[0] for name in ("grey", "red", "green", "blue")
    }
    photographs = Photographs([coloured], selection=ImageSelection("red"))
    assert photographs.shape == (6, 8)
    decoded = []
    monkeypatch.setattr(cv2, "imdecode", lambda *given, really=cv2.imdecode: decoded.append(1) or really(*given))
    together = photographs.in_channels(0)
    assert len(decoded) == 1
    assert list(together) == list(alone)
    assert all(np.array_equal(together[name], alone[name]) for name in alone)


def test_all_channels_of_a_grey_photograph_are_alike(tmp_path):
    file = write(tmp_path, "a.png", np.arange(12, dtype=np.uint8).reshape(3, 4))
    together = Photographs([file], selection=ImageSelection("red", (1, 0, 2, 2))).in_channels(0)
    assert all(
        np.array_equal(each, Photographs([file], selection=ImageSelection("grey", (1, 0, 2, 2)))[0])
        for each in together.values()
    )


def test_pixels_outside_the_region_are_grey(coloured):
    image = Photographs([coloured], selection=ImageSelection("red", (3, 1, 6, 4)))[0]
    assert image.shape == (6, 8)
    assert np.all(image[1:5, 3] == 200)
    assert np.all(image[[0, 5]] == 30)  # the median grey of the region
    assert np.all(image[:, 7] == 30)


def test_a_region_beyond_the_photograph_is_refused(coloured):
    with pytest.raises(InputError, match=r"photographs\.region = \[0, 0, 8, 4\].*8 x 6 pixels"):
        Photographs([coloured], selection=ImageSelection("grey", (0, 0, 8, 4)))[0]


class RecordingPhotographs:
    """Photographs that record the order of accesses."""

    def __init__(self, broken: int = -1) -> None:
        self.accessed: list[int] = []
        self._broken = broken

    def __getitem__(self, frame: int) -> np.ndarray:
        self.accessed.append(frame)
        if frame == self._broken:
            raise InputError("a.png", "", "is broken")
        return np.full((2, 2), float(frame), np.float32)


def test_the_next_photograph_is_prefetched_once_and_none_beyond_the_last():
    photographs = RecordingPhotographs()
    with PrefetchedPhotographs(photographs, 4) as prefetched:
        assert [float(prefetched[k][0, 0]) for k in range(4)] == [0.0, 1.0, 2.0, 3.0]
    assert photographs.accessed == [0, 1, 2, 3]


def test_an_error_of_prefetching_is_raised_on_access():
    with PrefetchedPhotographs(RecordingPhotographs(broken=2), 4) as prefetched:
        assert prefetched[1][0, 0] == 1.0
        with pytest.raises(InputError, match="broken"):
            prefetched[2]


@pytest.mark.parametrize(
    ("names", "first"),
    [
        (["DSC_9998.jpg", "DSC_9999.jpg", "DSC_0001.jpg", "DSC_0002.jpg"], "DSC_9998.jpg"),
        (["P9991.png", "P9994.png", "P9997.png", "P0000.png", "P0003.png"], "P9991.png"),
        (["DSC_9999.jpg", "DSC_0001.jpg"], "DSC_9999.jpg"),
        (["x0100.png", "x9900.png", "x9950.png"], "x0100.png"), (["a001.png", "a999.png"], "a001.png"),
        (["DSC_9999.jpg", "IMG_0001.jpg"], "DSC_9999.jpg"), (["f10.png", "f9.png"], "f9.png"),
    ],
)  # fmt: skip
def test_a_camera_counter_that_wraps_goes_on(names, first):
    ordered = [file.name for file in in_order(Path(name) for name in reversed(names))]
    assert ordered[0] == first
    assert ordered == (names if first == names[0] else sorted(names, reverse=True))


def test_what_is_masked_shows_nothing(tmp_path):
    image = np.full((40, 50), 100, np.uint8)
    image[10:20, 10:20] = 250
    image[30:35, 30:35] = 5
    cv2.imwrite(str(tmp_path / "a.png"), image)
    over = ((8.0, 8.0), (22.0, 8.0), (22.0, 22.0), (8.0, 22.0))
    seen = Photographs([tmp_path / "a.png"], selection=ImageSelection(mask=(over, over)))[0]
    assert seen.max() == 100.0
    assert seen.min() == 5.0
    both = Photographs([tmp_path / "a.png"], selection=ImageSelection(region=(0, 0, 49, 25), mask=(over,)))[0]
    assert np.unique(both).tolist() == [100.0]


def test_a_mask_can_be_a_picture(tmp_path):
    pixels = np.full((40, 60), 50, np.uint8)
    pixels[10:20, 10:30] = 200
    write(tmp_path, "a.png", pixels)
    mask = np.zeros((40, 60), np.uint8)
    mask[8:22, 8:32] = 255
    write(tmp_path, "mask.png", mask)
    file = tmp_path / "experiment.toml"
    file.write_text(
        'name = "x"\n[photographs]\nfiles = "a.png"\npixel_size = 1e-4\ninterval = 1.0\nmask = "mask.png"\n'
    )
    experiment = load_experiment(tmp_path)
    assert (experiment.photographs()[0] == 50.0).all()
    assert tmp_path / "mask.png" in experiment.input_files()
    write(tmp_path, "mask.png", mask[:-1])
    with pytest.raises(InputError, match="mask: is 60 x 39 pixels, the photographs are 60 x 40"):
        load_experiment(tmp_path).photographs()
    write(tmp_path, "mask.png", np.full_like(mask, 255))
    with pytest.raises(InputError, match="mask: hides every pixel"):
        load_experiment(tmp_path).photographs()


def test_a_link_to_a_missing_photograph_is_named(tmp_path):
    write(tmp_path, "0000.png", np.full((40, 60), 50, np.uint8))
    (tmp_path / "0001.png").symlink_to(tmp_path / "unmounted" / "0001.png")
    with pytest.raises(InputError, match=r"0001\.png: is a link to a file that does not exist"):
        Photographs.matching(tmp_path, "*.png")


@pytest.mark.parametrize("place", ["5000,20", "-200,20", "20,40"])
def test_a_grain_outside_of_the_photograph_is_named(tmp_path, place):
    write(tmp_path, "a.png", np.full((40, 60), 50, np.uint8))
    (tmp_path / "experiment.toml").write_text(
        'name = "x"\n[photographs]\nfiles = "a.png"\npixel_size = 1e-4\ninterval = 1.0\ngrains = "grains.csv"\n'
    )
    (tmp_path / "grains.csv").write_text(f"id,x,y,radius\n0,10,10,8\n999,{place},8\n")
    with pytest.raises(InputError, match=r"grain 999: lies at .* outside of the photograph of 60 x 40 pixels"):
        read_grain_guess(load_experiment(tmp_path))


def test_an_interval_with_times_that_no_time_line_holds_is_refused(tmp_path):
    write(tmp_path, "a.png", np.full((40, 60), 50, np.uint8))
    file = tmp_path / "experiment.toml"
    file.write_text('name = "x"\n[photographs]\nfiles = "a.png"\npixel_size = 1e-4\ninterval = 9e8\n')
    assert read_times(load_experiment(tmp_path), 10)[-1] == 8.1e9
    with pytest.raises(InputError, match=r"interval = 9e\+08: puts the last photograph at 1\.71e\+10 s"):
        read_times(load_experiment(tmp_path), 20)
