"""The version: of what is installed, or, where it is built, that of the last tag.

A tag v1.2.3 is version 1.2.3, the fifth commit after it 1.2.4.dev5. A tree without tags, or without git, is built, too.
"""

from __future__ import annotations

import re
import subprocess
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

NEXT = "0.1.0"  # the version that is worked on while there is no tag
TREE = Path(__file__).resolve().parents[1]
DESCRIBED = re.compile(r"v(\d+)\.(\d+)\.(\d+)-(\d+)-g[0-9a-f]+")


def version_in_use() -> str:
    """The version that is installed; of a tree that is used without being installed, its own."""
    try:
        return metadata("rodsight")["Version"]
    except PackageNotFoundError:
        return version_of_tree()


def version_of_tree(tree: Path = TREE) -> str:
    """The version of a source tree: of the archive that it came in, or after its last tag."""
    archive = tree / "PKG-INFO"
    if archive.is_file():
        told = re.search(r"^Version: (\S+)$", archive.read_text(encoding="utf-8"), re.MULTILINE)
        if told is not None:
            return told[1]
    return _after_tag(_describe(tree)) if (tree / ".git").exists() else f"{NEXT}.dev0"


def _after_tag(described: str) -> str:
    """The version of what git describes; without a tag it describes nothing."""
    found = DESCRIBED.fullmatch(described)
    if found is None:
        return f"{NEXT}.dev0"
    major, minor, patch, since = map(int, found.groups())
    return f"{major}.{minor}.{patch + 1}.dev{since}" if since else f"{major}.{minor}.{patch}"


def _describe(tree: Path) -> str:
    command = ("git", "describe", "--tags", "--long", "--match", "v[0-9]*.[0-9]*.[0-9]*")
    try:
        return subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:  # there is no git
        return ""
