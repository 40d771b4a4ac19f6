"""Errors of experiment.toml use the file's words: nothing of the library that validates it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from rodsight.experiment.config.experiment_file import ExperimentFile, find_config_errors
from rodsight.experiment.config.keys import list_keys

UNUSABLE: tuple[Any, ...] = ([], {}, True, "zz", -1e99, float("nan"), [1, 2, 3], {"a": 1}, [["x"]], 5)
INTERNAL = re.compile(
    r"pydantic|Section\b|GivenTracks|instance of|dictionar|Input|validation|[Tt]uple|String|function-|constrained|"
    r"literal\[|Value error|NoneType|valid (string|number|integer|boolean|list)|Extra inputs|Field required"
)


def errors_of(name: str, value: Any) -> list[str]:
    source = {"photographs": {"files": "a"}} if name.startswith("photographs") else {"tracks": {"positions": "a"}}
    data: dict[str, Any] = {"name": "x", **source}
    *path, last = name.split(".")
    section = data
    for part in path:
        section = section.setdefault(part, {})
    section[last] = value
    return [str(error) for _, error in find_config_errors(Path("experiment.toml"), data)]


def test_no_unusable_value_of_any_key_shows_an_internal_word():
    shown = {
        error: key.name
        for key in list_keys(ExperimentFile)
        for value in UNUSABLE
        for error in errors_of(key.name, value)
        if INTERNAL.search(error)
    }
    assert not shown


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("solver", 5, r"key solver: value 5: is a section: write \[solver\] and its keys below it"),
        ("material.friction", [], r"key material\.friction: value \[\]; material\.friction is a number"),
        ("photographs.region", [1, 2, 3], r"key photographs\.region: value \[1, 2, 3\]; photographs\.region is a"),
        ("photographs.radii", [7, 8, 11], r"look like millimetres: write radii = \[0\.007, 0\.008, 0\.011\]$"),
        ("photographs.radii", [0.007, 700], r"rods are not larger than 0\.5 m: lengths are in metres$"),
    ],
)
def test_errors_name_the_key_and_the_kind_of_its_values(name, value, message):
    assert any(re.search(message, error) for error in errors_of(name, value))
