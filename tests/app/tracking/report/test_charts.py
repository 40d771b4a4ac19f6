"""Charts of the tracking report: their text, and the import of their library."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from rodsight.tracking.report.charts import Labels, line_chart, stacked_chart

LABELS = Labels("How well < before", "photograph", "ZNCC")
X = np.arange(1, 9)


def texts(chart: str) -> list[str]:
    return [text.strip() for text in ET.fromstring(chart).itertext() if text.strip()]


def count_markers(chart: str) -> int:
    """Count the points drawn, without unknown values."""
    return chart.count("<use ")


def test_a_chart_names_its_lines_and_axes_in_letters() -> None:
    labels = texts(line_chart(X, {"median": np.linspace(0.9, 0.95, 8), "least": np.linspace(0.7, 0.8, 8)}, LABELS))
    for word in ("How well < before", "photograph", "ZNCC", "median", "least", "2"):
        assert word in labels


def test_labels_of_lines_with_equal_ends_do_not_overlap() -> None:
    chart = line_chart(X, {"median": np.full(8, 0.9), "least": np.full(8, 0.9), "wide": np.linspace(0, 1, 8)}, LABELS)
    height = {}
    for text in ET.fromstring(chart).iter("{http://www.w3.org/2000/svg}text"):
        if text.text in ("median", "least"):
            height[text.text] = float(text.attrib["y"])
    assert abs(height["median"] - height["least"]) > 9.0  # [px], of letters 10 px high


def test_unknown_values_interrupt_a_line() -> None:
    whole = np.linspace(0.9, 0.95, 8)
    broken = np.where(X == 4, np.nan, whole)
    assert count_markers(line_chart(X, {"a": whole}, LABELS)) == count_markers(line_chart(X, {"a": broken}, LABELS)) + 1


def test_a_chart_without_values_is_labelled() -> None:
    assert "not known" in texts(line_chart(X, {"median": np.full(8, np.nan)}, LABELS))


def test_counts_are_named() -> None:
    labels = texts(stacked_chart(X, {"rescued": np.arange(8), "lost": np.ones(8, np.int64)}, LABELS))
    assert "rescued" in labels
    assert "lost" in labels


def test_the_same_chart_has_the_same_bytes() -> None:
    first, second = (line_chart(X, {"median": np.linspace(0.9, 0.95, 8)}, LABELS) for _ in range(2))
    assert first == second


@pytest.mark.thorough
def test_tracking_without_a_report_imports_no_drawing_library() -> None:
    code = "import sys, rodsight.tracking.stage; print([m for m in ('matplotlib', 'jinja2') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
