"""All commands, in groups, and the command line of tyro."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache, partial, wraps
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import tyro

from .. import __version__
from .commands.campaign import campaign
from .commands.docs import docs
from .commands.export import export, share
from .commands.import_commands import import_
from .commands.run import check, record, run, solve, track
from .commands.sensitivity import sensitivity
from .commands.settings import settings
from .commands.study import study
from .commands.synth import synth
from .commands.view_commands import compare, review, score, view
from .commands.workbench import init, open_

Command = Callable[..., int]
METAVARS: dict[Any, str] = {int: "N", float: "NUMBER", str: "TEXT"}

GROUPS: dict[str, tuple[Command, ...]] = {
    "Begin": (open_, init, check, run),
    "Stages of a run": (track, solve, record),
    "Look": (view, review, compare),
    "How far to trust it": (score, sensitivity, study),
    "From and to other programs": (import_, export, share),
    "More": (campaign, synth, settings, docs),
}
ENDING = """\
rodsight COMMAND --help lists the options of a command, with an example.
Exit status: 0 done, 1 failed, 2 bad input, 130 interrupted (143 terminated, 129 its terminal was closed).
Completion of commands and options: eval "$(rodsight --completion bash)" (or zsh, tcsh)."""


def overview(title: str | None = None) -> str:
    """Return the list of commands in groups, one line each; title: default the program's name and version."""
    title = title or f"Rodsight {__version__}"
    lines = [f"{title}: contact forces inside a granular packing, from photographs.", ""]
    lines += ["Usage: rodsight COMMAND …", "First: rodsight run sample_data/shear"]
    for group, commands in GROUPS.items():
        lines += ["", group]
        lines += [f"  {name_of(command):<12} {purpose(command)}" for command in commands]
    return "\n".join([*lines, "", ENDING])


def command_line() -> tyro.extras.SubcommandApp:
    """Build the command line that parses arguments and returns the call of a command, which is not made yet."""
    app = tyro.extras.SubcommandApp()
    for commands in GROUPS.values():
        for command in commands:
            app.command(name=name_of(command))(_prepared(command))
    return app


def name_of(command: Command) -> str:
    """Return the name of a command on the command line."""
    return command.__name__.rstrip("_")


def command_names() -> list[str]:
    """Return the names of all commands."""
    return [name_of(command) for commands in GROUPS.values() for command in commands]


def purpose(command: Command) -> str:
    """Return the first sentence of a command's help."""
    return (inspect.getdoc(command) or "").split("\n\n")[0].replace("\n", " ").removesuffix(".")


@cache
def _prepared(command: Command) -> Callable[..., Callable[[], int]]:
    """Prepare a command for the parser, once: every further annotation would make each later call slower."""
    return _deferred(_with_plain_defaults(command))


def _with_plain_defaults(command: Command) -> Command:
    """Annotate a command so that its help omits empty defaults and names optional values by their type."""
    hints = get_type_hints(command, include_extras=True)
    result = hints.pop("return", int)
    explained = {
        name: Annotated[_named(hint), tyro.conf.arg(help_behavior_hint=_default)] for name, hint in hints.items()
    }
    command.__annotations__ = explained | {"return": result}
    return command


def _deferred(command: Command) -> Callable[..., Callable[[], int]]:
    """Return a function of the same arguments that returns the call of a command."""

    @wraps(command)
    def deferred(*arguments: Any, **options: Any) -> Callable[[], int]:
        return partial(command, *arguments, **options)

    return deferred


def _named(hint: Any) -> Any:
    """Add a name of the value for the help to the type hint of an optional argument."""
    bare = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    kinds = [each for each in get_args(bare) if each is not type(None)]
    if type(None) not in get_args(bare) or len(kinds) != 1:
        return hint
    word = "|".join(get_args(kinds[0])) if get_origin(kinds[0]) is Literal else METAVARS.get(kinds[0])
    # Inserted first, so that an explicit metavar takes precedence.
    return hint if word is None else Annotated[(bare, tyro.conf.arg(metavar=word), *get_args(hint)[1:])]  # type: ignore[misc]


def _default(label: str) -> str:
    return "" if label in ("None", "False", "") else f"(default: {label})"
