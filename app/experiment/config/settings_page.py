"""The settings page of the documentation, generated from the descriptions of the keys."""

from __future__ import annotations

from .experiment_file import ExperimentFile
from .keys import Key, KeySection, list_sections

FIRST_LINE = "<!-- Generated: rodsight settings --markdown > app/docs/settings.md -->"
INTRODUCTION = """# Settings

All keys of an `experiment.toml`. On the command line `--set SECTION.KEY=VALUE` overrides a key of the file for one run,
and `rodsight settings SECTION` prints a part of this page. An unknown key, a value out of range, and a key that the
chosen estimator does not use are refused with one line that names them.
"""


def settings_page() -> str:
    """Return the page as Markdown."""
    parts = [FIRST_LINE, INTRODUCTION, *(_section(each) for each in list_sections(ExperimentFile) if each.keys)]
    return "\n".join(parts).rstrip() + "\n"


def _section(section: KeySection) -> str:
    title = f"## `[{section.name}]`" if section.name else "## The file itself"
    rows = ["| key | values | unit | default | meaning |", "|---|---|---|---|---|"]
    rows += [_row(key) for key in section.keys]
    return "\n".join([title, "", section.meaning, "", *rows, ""])


def _row(key: Key) -> str:
    default = "required" if key.required else f"`{key.default}`" if key.default else "–"
    name = key.name.rpartition(".")[2]
    return f"| `{name}` | {key.kind} | {key.unit} | {default} | {key.meaning.replace('|', chr(92) + '|')} |"
