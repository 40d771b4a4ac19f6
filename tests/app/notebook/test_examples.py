"""The docstring examples of the public names of `rodsight`, executed on a small solved experiment."""

from __future__ import annotations

import doctest
import importlib
import inspect

import pytest
import rodsight

ERRORS = ("InputError", "RunError")
SLOW = pytest.mark.slow  # a campaign in Python runs in a notebook's test and on a page, too
NAMES = tuple(sorted(set(rodsight.__all__) - {"__version__", *ERRORS}))


@pytest.mark.thorough
@pytest.mark.parametrize("name", [pytest.param(each, marks=SLOW if each == "campaign" else ()) for each in NAMES])
def test_examples_give_the_printed_output(name, examples, monkeypatch):
    monkeypatch.chdir(examples)
    documented = getattr(rodsight, name)
    module = importlib.import_module(documented.__module__)
    found = doctest.DocTestFinder().find(documented, name, module=module, globs={"rodsight": rodsight})
    assert sum(len(each.examples) for each in found) > 0
    runner = doctest.DocTestRunner()
    output: list[str] = []
    for each in found:
        runner.run(each, out=output.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(output)


def test_every_public_method_of_a_run_has_an_example():
    without_example = [
        name
        for name, each in inspect.getmembers(rodsight.Run)
        if inspect.isfunction(each) and not name.startswith("_") and ">>>" not in (each.__doc__ or "")
    ]
    assert without_example == ["view"]  # it opens a window
