"""Charts of a campaign: axes, the varied parameters, every run."""

from __future__ import annotations

from rodsight.campaigns.charts import draw_over_frames, draw_over_parameter, varied_parameters

ROWS = [
    {"run": f"r{k}", "material.friction": text, "solver.kappa": "0.1", "friction_angle_degrees": 10.0 + k, "trust": 0.9}
    for k, text in enumerate(("0.2", "0.3", "0.3", ""))
]


def test_keys_with_several_numbers_are_varied_parameters():
    assert varied_parameters(ROWS, ["material.friction", "solver.kappa", "name"]) == {
        "material.friction": [0.2, 0.3, 0.3, None]
    }


def test_results_are_drawn_over_a_parameter_with_names_and_units_on_the_axes():
    chart = draw_over_parameter("material.friction", [0.2, 0.3, 0.3, None], ROWS)
    assert chart.startswith("<svg")
    for text in ("material.friction", "friction angle [°]", "trust", "0.20", "0.30"):
        assert f">{text}<" in chart
    assert "r(f_n)" not in chart  # no run has a truth


def test_every_run_is_drawn_over_frames_and_many_have_a_median():
    few = draw_over_frames({"first": [None, 1.0, 2.0], "second": [None, 2.0]}, "trust")
    assert ">first<" in few
    assert ">frame<" in few
    many = draw_over_frames({str(k): [None, float(k), 2.0 * k] for k in range(50)}, "trust")
    assert ">median of 50 runs<" in many
    assert many.count("<path") > 50
