"""Every error and warning that a user may read, found in the source itself."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

APP = Path(__file__).parent.parent
SOLVER = APP.parent / "solver"
# What ends a command in one line; the arguments before the last two name the file and the place.
ERRORS = {
    "InputError", "RunError", "NoPictureError", "DifferentPackingError", "FrictionError", "CoordinationError",
    "UnbalancedError", "UnreadableError",
}  # fmt: skip
COMPLAINTS = ("error", "_error")  # methods that make an InputError of a problem, their last argument
VALIDATED = "experiment/config/"  # where a ValueError is what is wrong with a key
# Functions whose sentences are warnings: of a frame, of a run, of an experiment.
WARNINGS = {
    "solver/sequence/judging/doubts.py": (
        "_stillness", "_noise", "_spacing", "_radii", "_boundary", "_softness", "_unseen", "_disagreement",
        "_correction", "doubt_friction",
    ),
    "solver/sequence/judging/judgement.py": ("judge", "_judge", "find_faults", "_tell_change"),
    "solver/calibration/calibrate.py": ("_verdict", "_track_warning", "_prior_warning"),
    "solver/boundary/boundary.py": ("describe",),
    "app/experiment/plausibility.py": ("doubtful_loads", "open_sides", "rods_beyond_ends"),
    "app/experiment/boundary.py": ("free_surfaces",),
    "app/inference/data_budget.py": ("describe", "_advice"),
}  # fmt: skip
SAYING = re.compile(r"Error\(|\.error\(|_error\(|notes\.append\(")  # what code must hold to be looked at more closely
UNKNOWN = "…"
WORDS = 4  # of a warning, at least


@dataclass(frozen=True, slots=True)
class Message:
    """What a user reads, with … for what differs from case to case."""

    kind: str  # error or warning
    source: str  # file that it comes from: app/… or solver/…
    text: str


@cache
def find_messages() -> tuple[Message, ...]:
    """All of them, each once, in the order of their files."""
    found: dict[tuple[str, str], Message] = {}
    for room, folder in (("app", APP), ("solver", SOLVER)):
        for file in sorted(folder.rglob("*.py")):
            source = f"{room}/{file.relative_to(folder).as_posix()}"
            code = file.read_text(encoding="utf-8")
            if source not in WARNINGS and not SAYING.search(code):
                continue
            for message in _messages_of(source, ast.parse(code)):
                found.setdefault((message.source, message.text), message)
    return tuple(found.values())


def _messages_of(source: str, tree: ast.Module) -> Iterator[Message]:
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        if function.name in WARNINGS.get(source, ()):
            yield from (Message("warning", source, text) for text in _sentences(function))
    for scope in (tree, *(node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))):
        named = _assigned(scope) if scope is not tree else {}
        for call in (node for node in _own(scope) if isinstance(node, ast.Call)):
            text = _text_of_call(source, call, named)
            if text.replace(UNKNOWN, "").strip(" :.'\"?()"):
                kind = "warning" if _called(call) in ("append", "tell") else "error"
                yield Message(kind, source, " ".join(text.split()))


def _own(scope: ast.AST) -> Iterator[ast.AST]:
    """What stands in a scope, and not in a function within it."""
    for child in ast.iter_child_nodes(scope):
        if not isinstance(child, ast.FunctionDef):
            yield child
            yield from _own(child)


def _text_of_call(source: str, call: ast.Call, named: dict[str, str]) -> str:
    name = _called(call)
    if name in ERRORS and call.args:
        return ": ".join(part for part in (_text(each, named) for each in call.args[-2:]) if part)
    if name in COMPLAINTS and isinstance(call.func, ast.Attribute) and len(call.args) > 1:
        return _text(call.args[-1], named)
    if name == "ValueError" and VALIDATED in source and call.args:
        return _text(call.args[0], named)
    noted = isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Attribute)
    if name == "append" and noted and call.func.value.attr in ("notes", "_notes") and call.args:  # type: ignore[attr-defined]
        return _text(call.args[0], named)
    return ""


def _called(call: ast.Call) -> str:
    return call.func.id if isinstance(call.func, ast.Name) else getattr(call.func, "attr", "")


def _assigned(function: ast.AST) -> dict[str, str]:
    """Texts that names of a function stand for."""
    found: dict[str, str] = {}
    for node in _own(function):
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            text = _text(node.value, found)
            if text.replace(UNKNOWN, "").strip():
                found[node.targets[0].id] = text
    return found


def _sentences(function: ast.FunctionDef) -> Iterator[str]:
    """The texts of some words in a function, its docstring left out."""
    inner: set[int] = set()
    docstring = ast.get_docstring(function, clean=False)
    for node in ast.walk(function):
        if id(node) in inner or not isinstance(node, ast.JoinedStr | ast.Constant):
            continue
        if isinstance(node, ast.JoinedStr):
            inner.update(id(part) for part in ast.walk(node))
        text = _text(node, {})
        if text != docstring and len([word for word in text.split() if word.strip(UNKNOWN + ":;,()")]) >= WORDS:
            yield " ".join(text.split())


def _text(node: ast.AST, named: dict[str, str]) -> str:
    """What a piece of code says, … for what is not known before it runs."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else UNKNOWN
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part, named) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return UNKNOWN
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return _text(node.left, named) + _text(node.right, named)
    if isinstance(node, ast.IfExp):
        return _text(node.body, named) if isinstance(node.body, ast.Constant | ast.JoinedStr) else UNKNOWN
    if isinstance(node, ast.Name):
        return named.get(node.id, UNKNOWN)
    return UNKNOWN
