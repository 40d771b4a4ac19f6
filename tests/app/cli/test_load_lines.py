"""Lines of the summary: loads in newtons, with the part that rods of the boundary bear, and rods that were inferred."""

from __future__ import annotations

import pytest
from rodsight.cli.summary_table import frame_table, inferred_line, load_line

PRESSED = {"wall": "top", "width": 0.25, "length": 0.06, "pressure": 5e4, "force": 750.0, "fraction_on_free_rods": 1.0}
MEASURED = PRESSED | {"pressure": None, "range": [740.0, 760.0]}


@pytest.mark.parametrize("load", [PRESSED, MEASURED])
def test_the_part_on_boundary_rods_is_stated_where_there_is_one(load) -> None:
    assert "750 N" in load_line(load)
    assert "boundary" not in load_line(load)
    assert "Rods of the boundary are on 9 % of its width" in load_line(load | {"fraction_on_free_rods": 0.91})
    earlier = {key: value for key, value in load.items() if key != "fraction_on_free_rods"}
    assert load_line(earlier) == load_line(load)


def test_one_inferred_rod_is_stated_in_the_singular() -> None:
    assert inferred_line(1) == "1 rod that is in no photograph was inferred from its neighbours."
    assert inferred_line(2).startswith("2 rods that are")


@pytest.mark.parametrize(("unit", "heading"), [("N", "⟨f_n⟩/N"), ("a.u.", "⟨f_n⟩")])
def test_a_mean_force_of_arbitrary_scale_has_no_unit(unit: str, heading: str) -> None:
    numbers = ("coordination_number", "friction_angle_degrees", "mean_fn", "natural_map", "correction", "trust")
    one = {"name": "test", "frame_count": 1, "force_unit": unit, "status": ["settled"], "contact_count": [3]}
    one |= {name: [1.0] for name in numbers}
    assert frame_table(one).columns[5].header == heading
