"""A command begun without its parser, which takes most of the time of a refused input; the rest is as ever.

What the parser would make of the few options that campaigns use is made here by the types of the command's arguments.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

from rodsight.cli.commands import export, look, make, run, take_in

NAMED = {"set": "settings", "json": "as_json"}  # options whose argument has another name
COMMANDS: dict[str, Callable[..., int]] = {
    "check": run.check, "solve": run.solve, "track": run.track, "score": look.score, "review": look.review,
    "export": export.export, "import": take_in.import_, "synth": make.synth,
}  # fmt: skip


def begin(arguments: list[str]) -> int:
    """What the command gives; raises KeyError where it, or an option, is not known here."""
    command = COMMANDS[arguments[0]]
    hints, told = get_type_hints(command), inspect.signature(command).parameters
    positional = [name for name, each in told.items() if each.kind is each.POSITIONAL_ONLY]
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
