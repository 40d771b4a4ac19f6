"""Every input file counts under its own name, wherever it lies."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from rodsight.experiment.experiment import Experiment, checksums, load_experiment
from rodsight.pipeline import TRACKING
from rodsight.run_folder import Run
from rodsight.workbench.setup.draft import stamp_of

from tests.app.experiment.tables import edit


@pytest.fixture
def folders(made_photographs: Path, tmp_path: Path) -> Path:
    """An experiment whose photographs lie in two folders elsewhere, which have the same name."""
    folder = Path(shutil.copytree(made_photographs, tmp_path / "mine"))
    files = sorted((folder / "photos").iterdir())
    for half, names in (("first", files[:2]), ("second", files[2:])):
        (tmp_path / half / "photos").mkdir(parents=True)
        for number, file in enumerate(names):
            shutil.move(file, tmp_path / half / "photos" / f"{number}{file.suffix}")
    return folder


def loaded(folder: Path) -> Experiment:
    pattern = f"{folder.parent}/*/photos/*.*"
    return load_experiment(folder, (f'photographs.files="{pattern}"',))


def fingerprint(folder: Path) -> str:
    return Run(loaded(folder), folder / "out").origin(TRACKING).fingerprint


def photographs_of(folder: Path) -> list[Path]:
    return sorted(folder.parent.glob("*/photos/*.*"))


def test_photographs_of_several_folders_have_a_checksum_each(folders):
    names = [name for name in checksums(loaded(folders)) if name.startswith("elsewhere/")]
    assert len(names) == len(photographs_of(folders)) == 4
    assert not [name for name in names if str(folders.parent) in name or "first" in name]


def test_each_of_them_changes_the_fingerprint(folders):
    found = {fingerprint(folders)}
    for file in photographs_of(folders):
        file.write_bytes(file.read_bytes() + b"more")
        found.add(fingerprint(folders))
    assert len(found) == 5


def test_files_exchanged_with_the_same_size_and_time_change_the_fingerprint_and_the_stamps_of_a_page(folders):
    one, other = photographs_of(folders)[0], photographs_of(folders)[2]
    size = max(one.stat().st_size, other.stat().st_size)
    for file in (one, other):
        file.write_bytes(file.read_bytes().ljust(size, b"\0"))
        os.utime(file, (1e9, 1e9))
    before, stamps = fingerprint(folders), [stamp_of(one), stamp_of(other)]
    between = one.with_suffix(".kept")
    one.rename(between)
    other.rename(one)
    between.rename(other)
    assert [stamp[1:3] for stamp in stamps] == [stamp_of(one)[1:3], stamp_of(other)[1:3]]
    assert [stamp_of(one), stamp_of(other)] != stamps
    assert fingerprint(folders) != before


def test_a_link_counts_under_its_own_name_with_the_content_it_leads_to(folders):
    for number, file in enumerate(photographs_of(folders)):
        (folders / "photos" / f"{number}{file.suffix}").symlink_to(file)
    names = checksums(load_experiment(folders))
    assert len([name for name in names if name.startswith("photos/")]) == 4
    target = photographs_of(folders)[3]
    target.write_bytes(target.read_bytes() + b"more")
    assert checksums(load_experiment(folders)) != names


def test_an_absolute_pattern_inside_the_folder_gives_the_names_of_a_relative_one(made_photographs, monkeypatch):
    monkeypatch.chdir(made_photographs.parent)
    relative = load_experiment(Path(made_photographs.name))
    pattern = f"{made_photographs}/{relative.config.photographs.files}"
    assert checksums(load_experiment(Path(made_photographs.name), (f'photographs.files="{pattern}"',))) == checksums(
        relative
    )


def test_tables_of_one_name_in_two_folders_are_both_listed(tracked, tmp_path):
    for name, table in (("one", "tracks.csv"), ("two", "times.csv")):
        (tmp_path / name / "tables").mkdir(parents=True)
        shutil.move(tracked / table, tmp_path / name / "tables" / "table.csv")
        edit(tracked / "experiment.toml", f'"{table}"', f'"{tmp_path / name / "tables" / "table.csv"}"')
    assert {"elsewhere/tables/table.csv", "elsewhere/tables (2)/table.csv"} <= set(checksums(load_experiment(tracked)))
