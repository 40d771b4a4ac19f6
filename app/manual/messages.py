"""Find every error and warning for users in the source code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from .. import solver

APP = Path(__file__).parent.parent
SOLVER = Path(str(solver.__file__)).parent
# Errors that end a command; the arguments before the last two are the file and the place in it.
ERRORS = {
    "InputError", "MissingFileError", "MissingFrameError", "FigureError", "RunError", "NoPictureError",
    "DifferentPackingError", "FrictionError", "CoordinationError", "UnbalancedError", "UnreadableError",
}  # fmt: skip
ERROR_METHODS = ("error", "_error")  # they make an InputError of their last argument, a problem
VALIDATED = "experiment/config/"  # folder where a ValueError reports a wrong key
# Functions whose texts are warnings of a frame, a run or an experiment.
WARNINGS = {
    "solver/assessment/penalties.py": (
        "_boundary", "_inner_boundary", "_missing_force", "_softness", "_unseen", "_size", "_contradictions",
        "describe_few_grains", "describe_few_photographs", "penalise_friction",
    ),
    "solver/assessment/status.py": ("decide_status", "_decide", "find_faults", "_describe_change"),
    "solver/calibration/calibrate.py": ("_verdict", "_track_warning", "_prior_warning"),
    "solver/boundary/boundary_correction.py": ("describe",),
    "app/experiment/plausibility.py": ("implausible_density", "implausible_loads", "open_sides", "rods_beyond_ends"),
    "app/experiment/boundary.py": ("free_surfaces",),
    "app/inference/diagnosis/data_quality.py": ("describe", "obstacle"),
    "app/prediction.py": ("verdict",),
}  # fmt: skip
WORD = re.compile(r"[^\W\d_]{2,}")
RAISES = re.compile(r"Error\(|\.error\(|_error\(|notes\.append\(")  # code without a match is not parsed
UNKNOWN = "…"
MIN_WORDS = 4  # of a warning


@dataclass(frozen=True, slots=True)
class Message:
    """An error or warning, with … for its variable parts."""

    kind: str  # error or warning
    source: str  # file that it comes from: app/… or solver/…
    text: str


@cache
def find_messages() -> tuple[Message, ...]:
    """Return all messages, each once, in the order of their files."""
    found: dict[tuple[str, str], Message] = {}
    for package, folder in (("app", APP), ("solver", SOLVER)):
        for file in sorted(folder.rglob("*.py")):
            if package == "app" and file.is_relative_to(SOLVER):  # an installed package contains the solver
                continue
            source = f"{package}/{file.relative_to(folder).as_posix()}"
            code = file.read_text(encoding="utf-8")
            if source not in WARNINGS and not RAISES.search(code):
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
            if len(WORD.findall(text)) > 1:  # fewer name a place, and the cause is known at run time only
                kind = "warning" if _called(call) == "append" else "error"
                yield Message(kind, source, " ".join(text.split()))


def _own(scope: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a scope without those of its inner functions."""
    for child in ast.iter_child_nodes(scope):
        if not isinstance(child, ast.FunctionDef):
            yield child
            yield from _own(child)


def _text_of_call(source: str, call: ast.Call, named: dict[str, str]) -> str:
    name = _called(call)
    if name in ERRORS and call.args:
        return ": ".join(part for part in (_text(each, named) for each in call.args[-2:]) if part)
    if name in ERROR_METHODS and isinstance(call.func, ast.Attribute) and len(call.args) > 1:
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
    """Return the texts that are assigned to names in a function."""
    found: dict[str, str] = {}
    for node in _own(function):
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            text = _text(node.value, found)
            if text.replace(UNKNOWN, "").strip():
                found[node.targets[0].id] = text
    return found


def _sentences(function: ast.FunctionDef) -> Iterator[str]:
    """Yield the texts of at least MIN_WORDS words in a function, without its docstring."""
    inner: set[int] = set()
    docstring = ast.get_docstring(function, clean=False)
    for node in ast.walk(function):
        if id(node) in inner or not isinstance(node, ast.JoinedStr | ast.Constant):
            continue
        if isinstance(node, ast.JoinedStr):
            inner.update(id(part) for part in ast.walk(node))
        text = _text(node, {})
        if text != docstring and len([word for word in text.split() if word.strip(UNKNOWN + ":;,()")]) >= MIN_WORDS:
            yield " ".join(text.split())


def _text(node: ast.AST, named: dict[str, str]) -> str:
    """Return the text of an expression, with … for parts that are known at run time only."""
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
