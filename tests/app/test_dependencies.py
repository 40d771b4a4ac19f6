"""Dependencies whose internals are used have upper bounds, which state the versions that these tests passed with."""

from __future__ import annotations

import ast
import tomllib
from importlib.metadata import version

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

from tests.program import ROOT

# Modules without guaranteed stability, and the distribution that they belong to.
INTERNALS = {
    "numba.core": "numba", "numba.np": "numba", "llvmlite": "llvmlite", "pydantic_core": "pydantic",
    "uvicorn.protocols": "uvicorn", "rerun_cli": "rerun-sdk", "rerun_bindings": "rerun-sdk",
}  # fmt: skip
REQUIREMENTS = {
    each.name: each
    for each in map(Requirement, tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"])
}


def used_internals() -> set[str]:
    """Distributions of whose internals the product imports something."""
    found = set()
    for folder in ("app", "solver"):
        for file in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                modules = [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
                modules += [each.name for each in node.names] if isinstance(node, ast.Import) else []
                for module in modules:
                    found |= {
                        owner for name, owner in INTERNALS.items() if module == name or module.startswith(f"{name}.")
                    }
    return found


@pytest.mark.thorough
def test_the_internals_in_use_are_those_that_are_bounded() -> None:
    assert used_internals() == set(INTERNALS.values())


@pytest.mark.parametrize("name", sorted(set(INTERNALS.values())))
def test_a_dependency_whose_internals_are_used_has_an_upper_bound(name: str) -> None:
    operators = {each.operator for each in REQUIREMENTS[name].specifier}
    assert operators & {"<", "<=", "=="}, f"{name} needs an upper bound in pyproject.toml: its internals are used"


@pytest.mark.parametrize("name", sorted(REQUIREMENTS))
def test_the_installed_version_is_inside_the_bounds(name: str) -> None:
    installed = Version(version(name))
    bounds = REQUIREMENTS[name].specifier
    assert bounds.contains(installed), (
        f"{name} {installed} is outside {bounds}: run all tests with it, then move the bound in pyproject.toml"
    )


def test_every_dependency_has_a_locked_version_within_its_bounds():
    lines = (ROOT / ".ci" / "locked.txt").read_text().splitlines()
    locked = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert {name for name, each in REQUIREMENTS.items() if Version(locked[name]) not in each.specifier} == set()


def test_every_dependency_is_listed_with_its_licence():
    listed = (ROOT / "app" / "docs" / "install.md").read_text(encoding="utf-8").partition("## Licences")[2]
    assert [name for name in REQUIREMENTS if f"| {name} |" not in listed] == []
