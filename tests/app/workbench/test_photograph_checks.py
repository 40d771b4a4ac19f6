"""Names of photographs that a person would order otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest
from rodsight.workbench.setup.photograph_checks import name_fractions


@pytest.mark.parametrize(
    ("names", "stated"),
    [
        (["t_0.0", "t_0.5", "t_0.25", "t_1.0"], "t_0.5.png stands before t_0.25.png"),
        (["t_0.00", "t_0.25", "t_0.50"], ""),
        (["1", "2", "10"], ""),
        (["a_0.5", "b_0.25"], ""),
        ([], ""),
    ],
)
def test_decimal_numbers_in_another_order_are_named(names: list[str], stated: str) -> None:
    found = name_fractions([Path(f"{name}.png") for name in names])
    assert "".join(found).startswith(stated)
    assert bool(found) == bool(stated)
