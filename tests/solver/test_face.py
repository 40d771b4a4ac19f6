"""The solver's public names are there when asked for, and cost nothing until then."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import solver

HEAVY = ("numpy", "numba", "scipy")


def said_by_a_fresh_python(program: str) -> str:
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()


def test_importing_the_solver_loads_nothing_heavy() -> None:
    program = f"import sys, solver; print([name for name in {HEAVY!r} if name in sys.modules])"
    assert said_by_a_fresh_python(program) == "[]"


def test_a_name_loads_its_own_home_and_no_other() -> None:
    program = "import sys, solver; solver.Grains; print('solver.bodies.grains' in sys.modules, 'numba' in sys.modules)"
    assert said_by_a_fresh_python(program) == "True False"


@pytest.mark.parametrize("name", solver.__all__)
def test_every_public_name_is_the_one_of_its_home(name: str) -> None:
    assert name in dir(solver)
    found = getattr(solver, name)
    assert found is getattr(import_module(found.__module__), name)


def test_what_a_type_checker_sees_is_what_is_loaded() -> None:
    tree = ast.parse(Path(str(solver.__file__)).read_text())
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        (node.module, each.name) for node in guarded.body if isinstance(node, ast.ImportFrom) for each in node.names
    }
    assert {name for _, name in seen} == set(solver.__all__)
    assert all(getattr(import_module(str(home)), name) is getattr(solver, name) for home, name in seen)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        _ = solver.nonsense
