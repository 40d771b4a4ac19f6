"""One cause that a diagnosis found, as results and summaries hold it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any


@dataclass(frozen=True, slots=True)
class Finding:
    """A cause of wrong forces that the evidence supports."""

    cause: str  # a name of the documented list
    evidence: str  # in a clause
    effect: str
    cure: str
    corrected: bool = False  # by the run itself, whose forces then do not suffer

    def sentence(self) -> str:
        """State cause, evidence, effect and cure."""
        name = self.cause.replace("_", " ")
        return f"{name[0].upper()}{name[1:]}: {self.evidence}; {self.effect}. Cure: {self.cure}."

    def statement(self) -> str:
        """State the sentence, and that the run has corrected this cause where it has."""
        return f"Corrected by the run: {self.sentence()}" if self.corrected else self.sentence()

    def as_plain(self) -> dict[str, str | bool]:
        """Return the values of summary.json."""
        return asdict(self)

    @classmethod
    def of_plain(cls, values: Mapping[str, Any]) -> Finding:
        """Return the finding that values of summary.json describe; earlier summaries lack `corrected`."""
        return cls(**{each.name: values[each.name] for each in fields(cls) if each.name in values})
