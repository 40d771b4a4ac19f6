"""The examples in the docstrings of what `import rodsight` promises, executed on a small solved experiment."""

from __future__ import annotations

import doctest
import importlib
import inspect

import pytest
import rodsight

NAMES = ("Run", "open", "run", "solve")


@pytest.mark.parametrize("name", NAMES)
def test_examples_do_what_they_say(name, examples, monkeypatch):
    monkeypatch.chdir(examples)
    thing = getattr(rodsight, name)
    module = importlib.import_module(thing.__module__)
    found = doctest.DocTestFinder().find(thing, name, module=module, globs={"rodsight": rodsight})
    assert sum(len(each.examples) for each in found) > 0
    runner = doctest.DocTestRunner()
    told: list[str] = []
    for each in found:
        runner.run(each, out=told.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(told)


def test_every_public_method_of_a_run_has_an_example():
    silent = [
        name
        for name, each in inspect.getmembers(rodsight.Run)
        if inspect.isfunction(each) and not name.startswith("_") and ">>>" not in (each.__doc__ or "")
    ]
    assert silent == ["view"]  # which opens a window
