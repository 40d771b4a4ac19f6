"""Generator of app/docs/commands.md, the help of all commands: `python -m rodsight.cli.commands_page`."""

from __future__ import annotations

import inspect
import io
import os
import re
import textwrap
from contextlib import redirect_stdout, suppress
from unittest.mock import patch

from ..manual.contents import FOLDER
from ..process.atomic import write_atomically
from .command_list import GROUPS, Command, command_line, name_of, overview

PAGE = FOLDER / "commands.md"
FIRST_LINE = "<!-- Generated: run `python -m rodsight.cli.commands_page` to write it again. -->"
TITLE = "Rodsight"  # without version, so that the page does not change with it
NAMES, WIDTH = 26, 100  # [columns] of names, and of a line
ROW = re.compile(r"^(?:│ |  )(.*?) *│?$")  # of the tables of options, with their frames on a terminal


def commands_page() -> str:
    """Return the page as Markdown."""
    parts = [FIRST_LINE, "# Commands", f"```text\n{overview(TITLE)}\n```"]
    for group, commands in GROUPS.items():
        parts.append(f"## {group}")
        parts += [part for command in commands for part in _section(command)]
    return "\n\n".join(parts) + "\n"


def _section(command: Command) -> list[str]:
    text, _, example = inspect.cleandoc(command.__doc__ or "").rpartition("Example: ")
    options = "\n".join(_row(name, meaning) for name, meaning in _options(command))
    return [
        f"### {name_of(command)}",
        *(" ".join(each.split()) for each in text.split("\n\n") if each.strip()),
        f"```sh\n{' '.join(example.split())}\n```",
        f"```text\n{options}\n```",
    ]


def _row(name: str, meaning: str) -> str:
    """Format one option; the meaning of a long name goes below it."""
    name = name.replace(",", ", ") if len(name) > NAMES else name
    head = textwrap.fill(name, WIDTH, subsequent_indent=" ", break_long_words=False, break_on_hyphens=False)
    below = textwrap.fill(
        meaning, WIDTH, initial_indent=" " * NAMES, subsequent_indent=" " * NAMES, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return f"{head}\n{below}" if len(head) >= NAMES else f"{head:<{NAMES}}{below[NAMES:]}".rstrip()


def _options(command: Command) -> list[tuple[str, str]]:
    """Return arguments and options with their meaning in the help."""
    output = io.StringIO()
    # A wide terminal avoids line breaks within words.
    with patch.dict(os.environ, COLUMNS="4000"), redirect_stdout(output), suppress(SystemExit):
        command_line().cli(prog="rodsight", args=[name_of(command), "--help"])
    found: list[tuple[str, str]] = []
    for line in output.getvalue().splitlines():
        row = ROW.match(line)
        if row is None or not row[1].strip():
            continue
        text = row[1].strip()
        if found and found[-1][0].count("{") > found[-1][0].count("}"):  # a list of choices that goes on
            found[-1] = (found[-1][0] + text, "")
        elif not row[1].startswith(" "):
            name, _, meaning = row[1].partition("  ")
            found.append((name.strip(), meaning.strip()))
        elif found:
            found[-1] = (found[-1][0], f"{found[-1][1]} {text}".strip())
    return [each for each in found if each[0] != "-h, --help"]


if __name__ == "__main__":
    write_atomically(PAGE, commands_page().encode())
