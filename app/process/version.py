"""The version of the installed package, or of a source tree by its last tag.

A tag v1.2.3 is version 1.2.3, the fifth commit after it 1.2.4.dev5. Trees without tags or git
have a version, too.
"""

from __future__ import annotations

import re
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, metadata, version
from pathlib import Path

NEXT = "0.1.0"  # the next version while there is no tag
TREE = Path(__file__).resolve().parents[2]
LIBRARIES = {  # that results depend on: their names, and those of the distributions that contain them
    "numpy": ("numpy",),
    "numba": ("numba",),
    "scipy": ("scipy",),
    "OpenCV": ("opencv-python-headless", "opencv-python", "opencv-contrib-python-headless", "opencv-contrib-python"),
    "h5py": ("h5py",),
}
DESCRIBED = re.compile(r"v(\d+)\.(\d+)\.(\d+)-(\d+)-g[0-9a-f]+")


def version_in_use() -> str:
    """Return the version of the installed package, or of the source tree where none is installed."""
    try:
        return metadata("rodsight")["Version"]
    except PackageNotFoundError:
        return version_of_tree()


@cache
def library_versions() -> dict[str, str]:
    """Return the versions of the libraries that results depend on, by their names; empty where one is unknown."""
    return {name: next(filter(None, map(_installed, named)), "") for name, named in LIBRARIES.items()}


def _installed(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


def version_of_tree(tree: Path = TREE) -> str:
    """Return the version of a source tree: that in its PKG-INFO (source archives), else that of its last tag."""
    archive = tree / "PKG-INFO"
    if archive.is_file():
        stated = re.search(r"^Version: (\S+)$", archive.read_text(encoding="utf-8"), re.MULTILINE)
        if stated is not None:
            return stated[1]
    return _after_tag(_describe(tree)) if (tree / ".git").exists() else f"{NEXT}.dev0"


def _after_tag(described: str) -> str:
    """Return the version for an output of `git describe`, which is empty without a tag."""
    found = DESCRIBED.fullmatch(described)
    if found is None:
        return f"{NEXT}.dev0"
    major, minor, patch, since = map(int, found.groups())
    return f"{major}.{minor}.{patch + 1}.dev{since}" if since else f"{major}.{minor}.{patch}"


def _describe(tree: Path) -> str:
    command = ("git", "describe", "--tags", "--long", "--match", "v[0-9]*.[0-9]*.[0-9]*")
    try:
        return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:  # git is not installed
        return ""
