"""The examples in the docstrings of what `import rodsight` promises, executed on a small solved experiment."""

from __future__ import annotations

import doctest
import importlib
import inspect
import shutil
from pathlib import Path

import pytest
import rodsight

NAMES = ("Run", "open", "run", "solve")


@pytest.fixture(scope="module")
def folder(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the examples work: an experiment my_test and its run runs/shear."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(made_tracks, folder / "my_test")
    config = folder / "my_test/experiment.toml"
    config.write_text(config.read_text().replace('"tracked"', '"my_test"'))
    rodsight.run(folder / "my_test", out=folder / "runs/shear", settings={"solver.sweeps": 50})
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_examples_do_what_they_say(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    thing = getattr(rodsight, name)
    module = importlib.import_module(thing.__module__)
    examples = doctest.DocTestFinder().find(thing, name, module=module, globs={"rodsight": rodsight})
    assert sum(len(each.examples) for each in examples) > 0
    runner = doctest.DocTestRunner()
    told: list[str] = []
    for each in examples:
        runner.run(each, out=told.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(told)


def test_every_public_method_of_a_run_has_an_example():
    silent = [
        name
        for name, each in inspect.getmembers(rodsight.Run)
        if inspect.isfunction(each) and not name.startswith("_") and ">>>" not in (each.__doc__ or "")
    ]
    assert silent == ["view"]  # which opens a window
