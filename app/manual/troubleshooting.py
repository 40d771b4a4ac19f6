"""The page app/docs/troubleshooting.md: every message with its cure; `python -m rodsight.manual.troubleshooting`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..process.atomic import write_atomically
from .contents import FOLDER
from .messages import Message, find_messages

PAGE = FOLDER / "troubleshooting.md"
QUESTIONS = Path(__file__).parent / "troubleshooting_first.md"  # frequent questions, written by hand
FIRST_LINE = "<!-- Generated: run `python -m rodsight.manual.troubleshooting` to write it anew. -->"
CURES = Path(__file__).parent / "cures.toml"


@dataclass(frozen=True, slots=True)
class Topic:
    """A group of messages by their source files, and their cures."""

    title: str
    files: tuple[str, ...]
    cures: tuple[tuple[str, str], ...]  # pattern, cure

    def cure(self, message: Message) -> str | None:
        """Return the cure of a message, None where no pattern matches."""
        return next((cure for pattern, cure in self.cures if re.search(pattern, message.text)), None)


@cache
def topics() -> tuple[Topic, ...]:
    """Return the topics in the order of the page."""
    tables = tomllib.loads(CURES.read_text(encoding="utf-8"))["topic"]
    return tuple(Topic(each["title"], tuple(each["files"]), tuple((p, c) for p, c in each["cures"])) for each in tables)


def topic_of(message: Message) -> Topic | None:
    """Return the topic of a message."""
    return next((each for each in topics() if message.source.startswith(each.files)), None)


def troubleshooting_page() -> str:
    """Return the page as Markdown."""
    parts = [FIRST_LINE, QUESTIONS.read_text(encoding="utf-8").strip()]
    messages = find_messages()
    for topic in topics():
        own = [each for each in messages if topic_of(each) is topic]
        if own:
            parts += [f"### {topic.title}", _table(topic, own)]
    return "\n\n".join(parts) + "\n"


def _table(topic: Topic, messages: Sequence[Message]) -> str:
    """Return a Markdown table with one row per cure."""
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
