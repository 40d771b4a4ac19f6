"""The command that describes the experiment file: settings."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from ...process.errors import InputError
from ..arguments import AsJson, Flag
from ..terminal import table_console

if TYPE_CHECKING:
    from rich.console import Console

    from ...experiment.config.keys import Key, KeySection


def settings(
    which: Annotated[str | None, Positional, arg(metavar="SECTION|KEY", help="default: every section")] = None,
    /,
    markdown: Annotated[Flag, arg(help="print all as a page of documentation")] = False,
    as_json: AsJson = False,
) -> int:
    """List the keys of experiment.toml and --set: default, unit, meaning.

    Example: rodsight settings solver
    """
    from ...experiment.config.experiment_file import ExperimentFile
    from ...experiment.config.keys import find_key, list_sections, nearest_key
    from ...experiment.config.settings_page import settings_page

    if markdown:
        print(settings_page(), end="")
        return 0
    console = table_console()
    sections = list_sections(ExperimentFile)
    if which is not None:
        name = which.strip("[]")
        found = find_key(ExperimentFile, name)
        if found is not None and as_json:
            print(json.dumps([_plain(found)], indent=1))
            return 0
        if found is not None:
            _print_key(console, found)
            return 0
        sections = tuple(each for each in sections if each.name == name or each.name.startswith(f"{name}."))
        if not sections:
            other = nearest_key(ExperimentFile, name)
            hint = f": did you mean {other}?" if other else ": rodsight settings lists all"
            raise InputError("settings", which, f"is neither a section nor a key of experiment.toml{hint}")
    if as_json:
        print(json.dumps([_plain(key) for section in sections for key in section.keys], indent=1))
        return 0
    for section in sections:
        _print_section(console, section)
    return 0


def _plain(key: Key) -> dict[str, str | bool]:
    """Return a key of the experiment file for JSON; its default as TOML, empty where there is none."""
    return {
        "key": key.name, "kind": key.kind, "unit": key.unit, "default": key.default, "required": key.required,
        "meaning": key.meaning,
    }  # fmt: skip


def _print_key(console: Console, key: Key) -> None:
    given = "must be given" if key.required else f"default {key.default}" if key.default else "absent by default"
    unit = f" [{key.unit}]" if key.unit else ""
    console.print(f"{key.name}: {key.kind}{unit}, {given}", markup=False, highlight=False)
    console.print(key.meaning, markup=False, highlight=False)


def _print_section(console: Console, section: KeySection) -> None:
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("key", "default", "unit", "meaning"):
        table.add_column(heading, no_wrap=heading != "meaning", overflow="fold")
    for key in section.keys:
        default = "(required)" if key.required else key.default or "–"
        table.add_row(*(Text(cell) for cell in (key.name.rpartition(".")[2], default, key.unit, key.meaning)))
    title = f"[{section.name}]" if section.name else "experiment.toml"
    console.print(f"{title} {section.meaning}", markup=False, highlight=False)
    if section.keys:
        console.print(table)
    console.print()
