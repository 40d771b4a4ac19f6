"""A mutant: one small, wrong change of the mechanics, and the tests that must notice it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


class StaleMutantError(ValueError):
    """A mutant's text is not found exactly once: the table must be renewed."""


@dataclass(frozen=True, slots=True)
class Mutant:
    place: str  # a file, or a room in one of whose Python files the text stands
    old: str  # text that stands there exactly once
    new: str
    tests: tuple[str, ...]  # nearest tests: files or folders

    @property
    def room(self) -> str:
        return str(Path(self.place).parent) if Path(self.place).suffix else self.place

    def locate(self, root: Path) -> Path:
        """The file that the text stands in, relative to the root of a tree."""
        place = root / self.place
        files = [each for each in ([place] if place.suffix else sorted(place.rglob("*.py"))) if each.is_file()]
        found = [file for file in files for _ in range(file.read_text(encoding="utf-8").count(self.old))]
        if len(found) != 1:
            raise StaleMutantError(f"{self.place}: {self.old!r} is found {len(found)} times, not once")
        return found[0].relative_to(root)


def mutants_of(place: str, tests: str | tuple[str, ...], *changes: tuple[str, str]) -> list[Mutant]:
    """Mutants of one file or room with the same nearest tests, given as (old, new)."""
    tests = (tests,) if isinstance(tests, str) else tests
    return [Mutant(place, old, new, tests) for old, new in changes]
