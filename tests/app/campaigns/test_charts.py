"""Charts of a campaign: axes, the varied parameters, every run."""

from __future__ import annotations

import json
import re

import pytest
from rodsight.campaigns.charts import NAMED, draw_over_frames, draw_over_parameter, varied_parameters
from rodsight.campaigns.collect import setting_of
from rodsight.campaigns.report import write_report
from rodsight.figures.figure_style import DASHES

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


def test_named_curves_differ_without_colour():
    chart = draw_over_frames({str(k): [float(k), k + 1.0, k + 2.0] for k in range(NAMED)}, "trust")
    assert len(set(re.findall(r"stroke-dasharray: [^;]*", chart))) == len(DASHES) - 1  # the first is unbroken
    marks = set(re.findall(r'<path id="m\w+" d="([^"]*)"', chart))
    assert len(marks) == NAMED + 2  # and the ticks of both axes


def test_a_run_has_the_range_of_its_frames_and_the_deviation_of_its_forces():
    plain = draw_over_parameter("material.friction", [0.2, 0.3, 0.3, None], ROWS)
    rows = [row | {"trust_low": 0.7, "trust_high": 0.95, "friction_angle_degrees_sd": 0.5} for row in ROWS]
    with_intervals = draw_over_parameter("material.friction", [0.2, 0.3, 0.3, None], rows)
    assert with_intervals.count("<path") == plain.count("<path") + 6  # a range and a deviation for each of three runs


def test_an_empty_cell_has_the_value_of_the_experiment():
    configuration = "[material]\nfriction = 0.25\n"
    assert setting_of(configuration, "material.friction") == 0.25
    assert setting_of(configuration, "solver.kappa") == ""


@pytest.mark.thorough
def test_the_report_lists_every_run_and_draws_its_results(tmp_path):
    names = [f"run-{k}" for k in range(40)]
    for name in names:
        (tmp_path / name).mkdir()
        summary = {"friction_angle_degrees": [1.0, 2.0, 3.0], "trust": [0.5, 0.6, 0.7]}
        (tmp_path / name / "summary.json").write_text(json.dumps(summary))
    rows = [
        {"run": name, "experiment": "x", "material.friction": f"{k}" if k else 0.0, "state": "done",
         "trust": 0.5 + 0.01 * k, "trust_low": 0.4, "trust_high": 0.9}
        for k, name in enumerate(names)
    ]  # fmt: skip
    page = write_report(tmp_path, rows).read_text()
    assert page.count("<tr") == 41
    assert all(f'<a href="{name}/">{name}</a>' in page for name in names)
    assert page.count('class="text"') == 80  # run and state; the values of keys are aligned, typed or not
    assert "<th>trust</th>" in page
    assert "<th>trust_low</th>" not in page  # intervals are drawn
    assert page.count("<svg") == 3
