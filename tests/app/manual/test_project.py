"""The home of the project: addresses that a maintainer fills in, the recipe of conda, and the workflow of the forge."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
import yaml
from rodsight.manual.project import RECIPE, read_addresses, write_addresses, write_requirements
from rodsight.process.errors import InputError

ROOT = Path(__file__).parents[3]
FILLED = {
    "repository": "https://forge.example/group/rodsight",
    "documentation": "https://rodsight.example/docs",
    "doi": "10.1234/archive.1",
}


@pytest.fixture
def source(tmp_path):
    for name in ("pyproject.toml", "CITATION.cff", "app/manual/mkdocs.yml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def test_addresses_reach_the_package_the_citation_and_the_pages_and_leave_again(source):
    before = {file: file.read_text() for file in source.rglob("*") if file.is_file()}
    assert len(write_addresses(source, FILLED)) == 3
    urls = tomllib.loads((source / "pyproject.toml").read_text())["project"]["urls"]
    assert urls == {"Repository": FILLED["repository"], "Documentation": FILLED["documentation"]}
    citation = yaml.safe_load((source / "CITATION.cff").read_text())
    assert citation["repository-code"] == FILLED["repository"]
    assert citation["doi"] == FILLED["doi"]
    assert f"repo_url: {FILLED['repository']}" in (source / "app/manual/mkdocs.yml").read_text()
    assert write_addresses(source, FILLED) == []  # nothing is written twice
    write_addresses(source, {})
    assert {file: file.read_text() for file in before} == before


def test_the_addresses_of_the_tree_are_those_of_its_files(source):
    assert write_addresses(source, read_addresses()) == [], "python -m rodsight.manual.project"


@pytest.mark.parametrize("line", ['repository = "forge.example"', 'doi = "1234"', 'homepage = "https://a.b"'])
def test_a_wrong_address_is_named(tmp_path, line):
    (tmp_path / "project.toml").write_text(line + "\n")
    with pytest.raises(InputError, match=line.split()[0]):
        read_addresses(tmp_path / "project.toml")


def test_the_recipe_of_conda_requires_what_the_package_requires(source):
    (source / RECIPE).parent.mkdir(parents=True)
    shutil.copy(ROOT / RECIPE, source / RECIPE)
    assert write_requirements(source) == [], "python -m rodsight.manual.project"
    run = yaml.safe_load((source / RECIPE).read_text())["requirements"]["run"]
    assert "py-opencv >=4.10.0.84" in run
    text = (source / "pyproject.toml").read_text()
    (source / "pyproject.toml").write_text(re.sub(r'"h5py>=[\d.]+"', '"h5py>=9"', text))
    assert write_requirements(source) == [source / RECIPE]
    assert "h5py >=9" in yaml.safe_load((source / RECIPE).read_text())["requirements"]["run"]


def test_the_workflow_runs_the_gate_and_the_fast_tests_of_other_systems():
    workflow = yaml.safe_load((ROOT / ".github/workflows/check.yml").read_text())
    steps = {name: [each.get("run") for each in job["steps"]] for name, job in workflow["jobs"].items()}
    assert ".ci/run" in steps["gate"]
    systems = workflow["jobs"]["other-systems"]["strategy"]["matrix"]["os"]
    assert {"macos-latest", "windows-latest"} <= set(systems)


def test_the_paper_has_the_sections_that_the_journal_requires():
    text = (ROOT / "app/docs/paper.md").read_text()
    for heading in (
        "Summary", "Statement of need", "State of the field", "Software design", "Research impact statement",
        "AI usage disclosure", "References",
    ):  # fmt: skip
        assert f"\n## {heading}\n" in text
    assert 750 <= len(re.findall(r"\w+", text.partition("## Summary")[2])) <= 1750


@pytest.mark.parametrize(("folder", "container"), [("app", "rodsight"), ("solver", "rodsight.solver")])
def test_the_page_of_the_architecture_has_the_layers_that_are_checked(folder, container):
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    checked = next(each["layers"] for each in contracts if each.get("containers") == [container])
    page = (ROOT / "app/docs/architecture.md").read_text(encoding="utf-8")
    rows = page.partition(f"| `{folder}/` | content |")[2].partition("\n\n")[0].splitlines()[2:]
    stated = [set(row.split("|")[1].strip().split(" · ")) for row in rows]
    assert stated == [set(layer.split(" | ")) for layer in checked]


def test_the_readme_lists_every_package():
    table = (ROOT / "README.md").read_text(encoding="utf-8").partition("| package | content | depends on |")[2]
    for each in (ROOT / "app").iterdir():
        if (each / "__init__.py").is_file():
            assert f"`app/{each.name}/`" in table
        elif each.suffix == ".py" and each.name != "__init__.py":
            assert f"`app/{each.name}`" in table
