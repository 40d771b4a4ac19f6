"""Distribution of the fast tests over two processes, by folder: tests of a folder share fixtures and kernels."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pytest

# Folders that begin first, because they compile most kernels: the first two share none.
FIRST = ("tests/app/tracking", "tests/solver", "tests/reference")


def folder_of(nodeid: str) -> str:
    """Return the folder of a test in tests/, tests/app/ or tests/solver/."""
    return "/".join(PurePosixPath(nodeid.split("::")[0]).parent.parts[:3])


def rank_of(nodeid: str) -> int:
    """Return the position of a test's folder in FIRST, or its length."""
    return next((k for k, start in enumerate(FIRST) if nodeid.startswith(f"{start}/")), len(FIRST))


def schedule_by_folder(config: pytest.Config, log: Any) -> Any:
    """Return pytest-xdist's scheduler that gives all tests of a folder to one process, in the order of collection."""
    from xdist.scheduler import LoadScopeScheduling  # imported where tests are distributed alone

    class FolderScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return folder_of(nodeid)

    config.option.loadscopereorder = False
    return FolderScheduling(config, log)
