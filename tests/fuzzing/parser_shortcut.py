"""Execution of a command without its parser, which takes most of the time of a refused input.

The few options of the campaigns are converted by the types of the command's arguments.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from rodsight.cli.commands import export, import_commands, run, synth, view_commands

NAMED = {"set": "settings", "json": "as_json"}  # options with another name of the argument
COMMANDS: dict[str, Callable[..., int]] = {
    "check": run.check, "solve": run.solve, "track": run.track,
    "score": view_commands.score, "review": view_commands.review,
    "export": export.export, "import": import_commands.import_, "synth": synth.synth,
}  # fmt: skip


def run_without_parser(arguments: list[str]) -> int:
    """Run the command and return its exit status; raises KeyError for an unknown command or option."""
    command = COMMANDS[arguments[0]]
    hints, parameters = get_type_hints(command), inspect.signature(command).parameters
    positional = [name for name, each in parameters.items() if each.kind is each.POSITIONAL_ONLY]
    given: list[Any] = []
    named: dict[str, Any] = {}
    rest = iter(arguments[1:])
    for word in rest:
        if not word.startswith("--"):
            given.append(_made(hints[positional[len(given)]], word))
            continue
        name, equals, value = word[2:].partition("=")
        name = NAMED.get(name, name.replace("-", "_"))
        if hints[name] is bool:
            named[name] = True
        elif get_origin(hints[name]) is tuple:
            named[name] = (*named.get(name, ()), value if equals else next(rest))
        else:
            named[name] = _made(hints[name], value if equals else next(rest))
    return command(*given, **named)


def _made(hint: Any, text: str) -> Any:
    kinds = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    for kind in (Path, float, int):
        if kind in kinds:
            return kind(text)
    return text
