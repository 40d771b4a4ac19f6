"""The settings page of the documentation, made of what the keys say of themselves."""

from __future__ import annotations

from .experiment_file import ExperimentFile
from .keys import Key, KeySection, list_sections

FIRST_LINE = "<!-- Generated: rodsight settings --markdown > app/docs/settings.md -->"
INTRODUCTION = """# Settings

Everything that may stand in an `experiment.toml`. On the command line `--set SECTION.KEY=VALUE` lays a setting over the
file for one run, and `rodsight settings SECTION` prints a part of this page. A key that is not known, a value that is
out of range, and a key that the chosen estimator does not use are refused in one line that names them.
"""


def settings_page() -> str:
    """The whole page, Markdown."""
    parts = [FIRST_LINE, INTRODUCTION, *(_section(each) for each in list_sections(ExperimentFile) if each.keys)]
    return "\n".join(parts).rstrip() + "\n"


def _section(section: KeySection) -> str:
    title = f"## `[{section.name}]`" if section.name else "## The file itself"
    rows = ["| key | what may stand there | unit | default | meaning |", "|---|---|---|---|---|"]
    rows += [_row(key) for key in section.keys]
    return "\n".join([title, "", section.meaning, "", *rows, ""])


def _row(key: Key) -> str:
    default = "must be given" if key.required else f"`{key.default}`" if key.default else "–"
    name = key.name.rpartition(".")[2]
    return f"| `{name}` | {key.kind} | {key.unit} | {default} | {key.meaning.replace('|', chr(92) + '|')} |"
