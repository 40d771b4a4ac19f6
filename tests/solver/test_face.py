"""The public names of the solver are imported on first access."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from rodsight import solver

HEAVY = ("numpy", "numba", "scipy")


def output_of_a_fresh_python(program: str) -> str:
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()


def test_importing_the_solver_loads_nothing_heavy() -> None:
    program = f"import sys; from rodsight import solver; print([name for name in {HEAVY!r} if name in sys.modules])"
    assert output_of_a_fresh_python(program) == "[]"


def test_a_name_imports_its_own_module_only() -> None:
    program = (
        "import sys; from rodsight import solver; solver.Grains; "
        "print('rodsight.solver.bodies.grains' in sys.modules, 'numba' in sys.modules)"
    )
    assert output_of_a_fresh_python(program) == "True False"


@pytest.mark.parametrize("name", solver.__all__)
def test_every_public_name_is_that_of_its_module(name: str) -> None:
    assert name in dir(solver)
    found = getattr(solver, name)
    assert found is getattr(import_module(found.__module__), name)


def test_type_checkers_and_runtime_agree_on_the_names() -> None:
    tree = ast.parse(Path(str(solver.__file__)).read_text())
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    imports = [node for node in guarded.body if isinstance(node, ast.ImportFrom)]
    guarded_names = {(f"{solver.__name__}.{node.module}", each.name) for node in imports for each in node.names}
    assert {name for _, name in guarded_names} == set(solver.__all__)
    assert all(getattr(import_module(str(home)), name) is getattr(solver, name) for home, name in guarded_names)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        _ = solver.nonsense
