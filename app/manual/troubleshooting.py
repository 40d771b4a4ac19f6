"""app/docs/troubleshooting.md: every message with what to do about it; `python -m rodsight.manual.troubleshooting`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..atomic import write_atomically
from .contents import FOLDER
from .messages import Message, find_messages

PAGE = FOLDER / "troubleshooting.md"
FIRST = Path(__file__).parent / "troubleshooting_first.md"  # what people ask most, written by hand
FIRST_LINE = "<!-- Generated: run `python -m rodsight.manual.troubleshooting` to write it anew. -->"
CURES = Path(__file__).parent / "cures.toml"


@dataclass(frozen=True, slots=True)
class Topic:
    """What messages are about, and what cures them."""

    title: str
    files: tuple[str, ...]
    cures: tuple[tuple[str, str], ...]  # pattern, cure

    def cure(self, message: Message) -> str | None:
        """What to do about a message; None: nothing is known."""
        return next((cure for pattern, cure in self.cures if re.search(pattern, message.text)), None)


@cache
def topics() -> tuple[Topic, ...]:
    """The topics in their order."""
    told = tomllib.loads(CURES.read_text(encoding="utf-8"))["topic"]
    return tuple(Topic(each["title"], tuple(each["files"]), tuple((p, c) for p, c in each["cures"])) for each in told)


def topic_of(message: Message) -> Topic | None:
    """The topic of a message."""
    return next((each for each in topics() if message.source.startswith(each.files)), None)


def troubleshooting_page() -> str:
    """The whole page, Markdown."""
    parts = [FIRST_LINE, FIRST.read_text(encoding="utf-8").strip()]
    messages = find_messages()
    for topic in topics():
        own = [each for each in messages if topic_of(each) is topic]
        if own:
            parts += [f"### {topic.title}", _table(topic, own)]
    return "\n\n".join(parts) + "\n"


def _table(topic: Topic, messages: Sequence[Message]) -> str:
    """Messages with the same cure in one row."""
    by_cure: dict[str, list[str]] = {}
    for message in messages:
        by_cure.setdefault(topic.cure(message) or "", []).append(message.text)
    rows = ["| message | what to do |", "|---|---|"]
    for cure, texts in by_cure.items():
        shown = "<br>".join(f"`{_cell(text)}`" for text in dict.fromkeys(texts))
        rows.append(f"| {shown} | {cure} |")
    return "\n".join(rows)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("`", "'")


if __name__ == "__main__":
    write_atomically(PAGE, troubleshooting_page().encode())
