"""Freed memory is kept while forces are computed only where it is returned otherwise, and returned again after it."""

from __future__ import annotations

import pytest
from rodsight.process.machine import free_memory

pytestmark = pytest.mark.unit


@pytest.fixture
def settings(monkeypatch) -> list[object]:
    """Note what is set instead of setting it."""
    found: list[object] = []
    monkeypatch.setattr(free_memory, "_returning", False)
    monkeypatch.setattr(free_memory, "_set", found.append)
    monkeypatch.setattr(free_memory, "release_free_memory", lambda: found.append("released"))
    return found


def fail() -> None:
    raise ZeroDivisionError


def test_freed_blocks_are_kept_for_a_while_and_returned_again(settings) -> None:
    free_memory.return_large_blocks()
    with free_memory.keep_freed_blocks():
        assert settings == [free_memory.RETURNED, free_memory.KEPT]
    assert settings[2:] == [free_memory.RETURNED, "released"]
    assert all(free_memory.KEPT[name] > size for name, size in free_memory.RETURNED.items())
    with pytest.raises(ZeroDivisionError):
        free_memory.keep_freed_blocks()(fail)()
    assert settings[-2:] == [free_memory.RETURNED, "released"]


def test_the_setting_of_a_program_that_returns_nothing_stays(settings) -> None:
    with free_memory.keep_freed_blocks():
        assert not settings
    assert not settings
