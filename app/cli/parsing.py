"""Arguments of a command: parsed by tyro, whose boxes of text about mistakes become one line."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from difflib import get_close_matches

from ..process.errors import InputError
from .command_list import command_line

HELP = ("-h", "--help")
DESCRIPTION = "Contact forces from photographs."
_CHOICE = re.compile(r"invalid choice '(.*?)' for argument '(\S+)'\. Expected one of \((.*?)\)")
_VALUE = re.compile(r"Error parsing (\S+):.*?\[(?='(.*?)')([^\]]*)\]")
_PLAIN_VALUE = re.compile(r"Error parsing (\S+): [^\[]*?: (?='(.*?)')(\S+)")  # of an option with one kind of value
_EACH = re.compile(r"'(.*?)'")
# Words of a box by which a number is expected, in the order in which they are looked for.
_KINDS = (
    (re.compile(r"\bint\(|\bINT\b|\bFRAME\b"), int, "a whole number"),
    (re.compile(r"\bfloat\b|\bFLOAT\b"), float, "a number"),
)
_MISSING = re.compile(r"Missing value for argument '(.+?)'|Missing from [^:]+: (\S+)")
_UNRECOGNISED = re.compile(r"Unrecognized options: ([^,\s]+)")
FRAME = "─-│|╭╰╮╯+"
_OPTION = re.compile(r"--[a-z][\w-]*")


def parse(arguments: Sequence[str]) -> Callable[[], int]:
    """Return the call of the command; raises InputError for arguments that it does not take, and ends after help."""
    if any(each in HELP or each.startswith("--tyro-") for each in arguments):
        return _parse(arguments)
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            return _parse(arguments)
    except SystemExit:
        raise _error(arguments, printed.getvalue()) from None


def _parse(arguments: Sequence[str]) -> Callable[[], int]:
    return command_line().cli(prog="rodsight", description=DESCRIPTION, args=list(arguments))


def _error(arguments: Sequence[str], box: str) -> InputError:
    """Return the mistake that a box describes, in the words of other errors."""
    command = f"rodsight {arguments[0]}"
    known = _options(arguments[0])
    for each in arguments[1:]:
        name = each.partition("=")[0]
        if each.startswith("--") and name.replace("_", "-") not in known:
            near = get_close_matches(name, known, 1)
            return InputError(command, name, "is not an option" + (f": did you mean {near[0]}?" if near else ""))
    text = _text(box)
    if found := _CHOICE.search(text):
        choices = sorted({*re.findall(r"'(.*?)'", found[3])} - {"None"})
        return InputError(command, f"{found[2]} {found[1]}", f"is not one of {', '.join(choices)}")
    if found := _VALUE.search(text) or _PLAIN_VALUE.search(text):
        return _wrong_value(command, found[1], _EACH.findall(found[3]) or [found[2]], text)
    if found := _MISSING.search(text):
        name = found[1] or found[2]
        if name.startswith("--"):
            state = "needs a value" if name in arguments else "is missing"
            return InputError(command, name, f"{state}; see {command} --help")
        name = name.upper()
        return InputError(command, "KIND" if name.startswith("{") else name, f"is missing; see {command} --help")
    if found := _UNRECOGNISED.search(text):
        return InputError(command, found[1], f"is one argument too many; see {command} --help")
    return InputError(command, "", text)


def _wrong_value(command: str, option: str, values: list[str], text: str) -> InputError:
    """Return the error of an option's values; text: of the box, which states the kind of value that was expected."""
    for sign, kind, words in _KINDS:
        if sign.search(text):
            value = next((each for each in values if not _is_a(kind, each)), values[0])
            right = None if kind is int else _number_of(option, value)
            hint = f"; see {command} --help" if right is None else f": write {option} {right!r}"
            return InputError(command, f"{option} {value}", f"is not {words}{hint}")
    return InputError(command, f"{option} {values[0]}", f"is not a value of this option; see {command} --help")


def _is_a(kind: type[int] | type[float], text: str) -> bool:
    try:
        kind(text)
    except ValueError:
        return False
    return True


def _number_of(option: str, text: str) -> float | None:
    """Return the number that a quantity in another unit is, for an option with the name of a key; None: no such one."""
    from ..experiment.config.corrections import read_quantity
    from ..experiment.config.experiment_file import ExperimentFile
    from ..experiment.config.keys import list_keys

    name = option.removeprefix("--").replace("-", "_")
    units = [each.unit for each in list_keys(ExperimentFile) if each.name.rpartition(".")[2] == name]
    return read_quantity(text.strip("'\""), units[0]) if units else None


def _options(command: str) -> list[str]:
    """Return the options of a command, by its help."""
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            _parse([command, "--help"])
    except SystemExit:
        pass
    return sorted(set(_OPTION.findall(printed.getvalue())))


def _text(box: str) -> str:
    """Return the words of a box without its frame, which is of ASCII on some terminals."""
    return " ".join(word for word in box.split() if word.strip(FRAME))
