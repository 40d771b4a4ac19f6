"""The house: small rooms, small files, and functions that a reader can call without counting arguments."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.mutation.table import MUTANTS

ROOT = Path(__file__).resolve().parents[2]
MOST_PARAMETERS = 7
MOST_FILES, MOST_AT_THE_ROOT = 12, 9
MOST_LINES = 400
# Parameters that users write by name: options of the command line, keyword arguments of a verb, fields of a request.
COMMANDS = "app/cli/commands/"
NAMED_BY_USERS = {"app/notebook/solve.py: solve"}
LONG = {"app/tracking/correlation/kernels.py"}  # one chain of kernels


def sources() -> list[Path]:
    return [file for room in ("app", "solver") for file in sorted((ROOT / room).rglob("*.py"))]


def public_functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Functions, methods and constructors that are public, without compiled kernels, which take plain arrays.

    The plain form of vector instructions counts as compiled, too.
    """
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    decorators = {ast.unparse(each) for node in functions for each in node.decorator_list}
    for node in functions:
        compiled = any("njit" in ast.unparse(each) for each in node.decorator_list)
        compiled |= f"llvm_implementation_of({node.name})" in decorators
        if not compiled and (node.name == "__init__" or not node.name.startswith("_")):
            yield node


def parameters_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    given = function.args
    names = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def test_public_functions_have_few_parameters():
    many = set()
    for file in sources():
        name = file.relative_to(ROOT).as_posix()
        for each in public_functions(ast.parse(file.read_text(encoding="utf-8"))):
            if not name.startswith(COMMANDS) and len(parameters_of(each)) > MOST_PARAMETERS:
                many.add(f"{name}: {each.name}")
    assert many == NAMED_BY_USERS


@pytest.mark.parametrize(
    ("code", "count"),
    [
        ("def f(a, /, b, *c, d, **e): pass", 3),
        ("class C:\n def __init__(self, a): pass", 1),
        ("@njit(cache=True)\ndef f(a): pass", 0),
        ("def f(a): pass\n@llvm_implementation_of(f)\ndef _g(b): pass", 0),
        ("def f(a): pass\n@llvm_implementation_of(h)\ndef _g(b): pass", 1),
        ("def _f(a): pass", 0),
    ],
)
def test_parameters_are_counted(code, count):
    assert sum(len(parameters_of(each)) for each in public_functions(ast.parse(code))) == count


def test_rooms_have_few_files_and_files_few_lines():
    rooms = Counter(file.parent.relative_to(ROOT).as_posix() for file in sources() if file.name != "__init__.py")
    assert {room: count for room, count in rooms.items() if count > MOST_FILES} == {}
    assert rooms["app"] <= MOST_AT_THE_ROOT
    lines = {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8").count("\n") for file in sources()}
    assert {name for name, count in lines.items() if count > MOST_LINES} == LONG


def test_every_mutant_has_its_text_once_and_its_tests():
    assert len({(mutant.place, mutant.old, mutant.new) for mutant in MUTANTS}) == len(MUTANTS) >= 100
    for mutant in MUTANTS:
        mutant.locate(ROOT)
        assert all((ROOT / test).exists() for test in mutant.tests)
