"""The version of a tree is that of its last tag; a tree without tags can be built, too."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import rodsight
from rodsight.process.version import NEXT, version_of_tree

NOBODY = ("-c", "user.name=nobody", "-c", "user.email=nobody@example.org", "-c", "tag.gpgSign=false")


def git(tree: Path, *words: str) -> None:
    subprocess.run(["git", *NOBODY, *words], cwd=tree, check=True, capture_output=True)


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "one")
    return tmp_path


def test_a_tag_is_the_version_and_later_commits_count_towards_the_next(tree):
    assert version_of_tree(tree) == f"{NEXT}.dev0"
    git(tree, "tag", "v1.2.3")
    git(tree, "tag", "notes-4")
    assert version_of_tree(tree) == "1.2.3"
    for _ in range(2):
        git(tree, "commit", "-q", "--allow-empty", "-m", "more")
    assert version_of_tree(tree) == "1.2.4.dev2"


def test_a_tree_without_git_has_the_version_of_its_archive_or_the_next(tmp_path, monkeypatch):
    assert version_of_tree(tmp_path) == f"{NEXT}.dev0"
    (tmp_path / "PKG-INFO").write_text("Metadata-Version: 2.4\nName: rodsight\nVersion: 3.1.0\n\nVersion: 9\n")
    assert version_of_tree(tmp_path) == "3.1.0"


def test_a_machine_without_git_builds_as_well(tree, monkeypatch):
    monkeypatch.setenv("PATH", str(tree))
    assert version_of_tree(tree) == f"{NEXT}.dev0"


def test_the_installed_package_has_a_version():
    assert rodsight.__version__.split(".")[0].isdigit()
    assert "__version__" in dir(rodsight)
