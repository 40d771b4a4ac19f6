"""Files and folders appear whole or not at all; errors of the disk name what the user gave."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from rodsight.process.atomic import replacing, replacing_folder


def refuse(place: Path) -> None:
    raise OSError(errno.EACCES, "Permission denied", str(place))


@pytest.mark.parametrize("suffix", ["", ".loose.rrd"])
def test_an_error_names_the_file_that_was_to_be_written(suffix, tmp_path):
    with pytest.raises(PermissionError) as raised, replacing(tmp_path / "film.mp4") as part:
        refuse(part.with_name(part.name + suffix))
    assert raised.value.filename == str(tmp_path / "film.mp4")
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("inner", ["", "walls.csv"])
def test_an_error_names_the_folder_that_was_to_be_made(inner, tmp_path):
    with pytest.raises(PermissionError) as raised, replacing_folder(tmp_path / "out") as part:
        refuse(part / inner)
    assert raised.value.filename == str(tmp_path / "out" / inner)
    assert not any(tmp_path.iterdir())


def test_other_files_keep_their_names_in_errors(tmp_path):
    with pytest.raises(PermissionError) as raised, replacing(tmp_path / "film.mp4"):
        refuse(tmp_path / "photo.jpg")
    assert raised.value.filename == str(tmp_path / "photo.jpg")
    with pytest.raises(OSError, match=r"^no name$"), replacing(tmp_path / "film.mp4"):
        raise OSError("no name")
