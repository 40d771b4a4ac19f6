"""The calibration report as one self-contained HTML page."""

from __future__ import annotations

import base64
import io

import numpy as np
from jinja2 import Environment
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import erf

from ...figures.figure_style import COLOURS, DASHES, INK, VERMILION, add_title, new_figure, paper_style
from ...synthetic.scenarios.scenario_table import SCENARIOS
from ..scenarios.interval_coverage import COMPONENTS, GROUPS
from ..scenarios.statistic_errors import HEADINGS, SCENARIO_HEADINGS
from .calibration_report import CalibrationStudy, confusion_rows, coverage_rows, sliding_rows, statistic_error_rows

PANELS = 5  # in a row
MAX_RATIO = 3.0  # [standard deviation]
MARKS = "osv^D<>Ph*Xd"

_PAGE = Environment(autoescape=True).from_string("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Rodsight {{ facts.version }}: calibration report</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 64rem; padding: 0 1rem;
  color: #222; background: #fff }
img { width: 100%; margin: .3rem 0 } img.square { max-width: 40rem }
table { border-collapse: collapse; font-size: .9em } tbody tr:nth-child(odd) { background: #f4f4f4 }
td, th { padding: .1rem .7rem; text-align: right; white-space: nowrap }
td:first-child, th:first-child { text-align: left }
.broken { color: #a00 } code { overflow-wrap: anywhere }
</style></head><body>
<h1>Calibration report</h1>
<p>Rodsight {{ facts.version }}. Simulated scenarios {{ facts.worlds|join(", ") }} of {{ facts.grains }} rods, seeds
{{ facts.seeds|join(", ") }}; {{ facts.contacts }} contacts in {{ facts.frames }} frames. SHA-256 of the data:
<code>{{ facts.data }}</code></p>
{% if facts.broken %}<p class="broken">Outside the limits:</p><ul class="broken">
{% for each in facts.broken %}<li>{{ each }}</li>{% endfor %}</ul>
{% else %}<p><b>All stated quantities are within their limits.</b></p>{% endif %}
<h2>Intervals of contact forces</h2>
<p>Fraction of contacts within a number of stated standard deviations of the truth, by group; the black line is the
normal law. Above it intervals are too wide, below it too narrow.</p>
<img src="{{ coverage }}" alt="Coverage of the intervals of normal and tangential forces by group of contacts">
<table><thead><tr><th>contacts</th>
<th>f_n 68 %</th><th>f_n 95 %</th><th>f_t 68 %</th><th>f_t 95 %</th><th>beyond 5 and 2 %</th></tr></thead><tbody>
{% for row in covered %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
<h2>Trust</h2>
<p>Trust is a lower bound of the correlation with the true normal forces: at most 5 % of the frames may lie below the
line. {{ "%.1f"|format(100 * facts.too_trusting) }} % do.</p>
<img src="{{ trust }}" alt="Correlation with the truth over trust, frame by frame, for every scenario">
{% if confused %}<h2>Prediction and diagnosis</h2>
<p>What <code>rodsight check</code> expects from the first photographs, with its interval, over what the whole test
reached.</p>
<img class="square" src="{{ predicted }}" alt="Predicted over reached correlation, with intervals">
<table><thead><tr><th>scenario</th><th>group</th><th>cause</th><th>named (tests)</th></tr></thead><tbody>
{% for row in confused %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
{% endif %}
<h2>Statistics</h2>
<table><thead><tr>{% for each in headings %}<th>{{ each }}</th>{% endfor %}</tr></thead><tbody>
{% for row in rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
<p>Bias: mean of inferred minus true over the mean true value; of angles in degrees; of densities the fraction in
another bin. sd: standard deviation of single frames about the bias. 68 %, 95 %: frames within one and two stated
standard deviations.</p>
<h3>Fraction of sliding contacts, by scenario</h3>
<table><thead><tr>{% for each in scenario_headings %}<th>{{ each }}</th>{% endfor %}</tr></thead><tbody>
{% for row in sliding %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
</body></html>
""")


def report_page(study: CalibrationStudy) -> str:
    """Return the page as HTML."""
    with paper_style():
        coverage, trust = _encoded(draw_coverage(study)), _encoded(draw_trust(study))
        predicted = _encoded(draw_predictions(study)) if study.outcomes else ""
    return _PAGE.render(
        facts=study.facts(), coverage=coverage, covered=coverage_rows(study), trust=trust,
        predicted=predicted, confused=confusion_rows(study) if study.outcomes else [], headings=HEADINGS,
        rows=statistic_error_rows(study), scenario_headings=SCENARIO_HEADINGS, sliding=sliding_rows(study),
    )  # fmt: skip


def draw_coverage(study: CalibrationStudy) -> Figure:
    """Draw the fraction of contacts within a number of standard deviations by group, for f_n and f_t."""
    figure = new_figure("double", 0.5)
    panels = figure.subplots(1, 2, sharey=True)
    at = np.linspace(0.0, MAX_RATIO, 61)
    for component, (axes, label) in enumerate(zip(panels, COMPONENTS, strict=True)):
        axes.plot(at, erf(at / np.sqrt(2.0)), color=INK, linewidth=1.6, label="normal law")
        for number, name in enumerate(name for name in GROUPS if name in study.coverage and name != "all"):
            part = study.errors.select(GROUPS[name](study.errors))
            ratio = np.abs(part.error[:, component]) / np.maximum(part.sd[:, component], 1e-12)
            fraction = np.searchsorted(np.sort(ratio), at, side="right") / len(ratio)
            axes.plot(
                at, fraction, color=COLOURS[number % len(COLOURS)], linestyle=DASHES[number % len(DASHES)],
                marker=MARKS[number], markevery=(3 + number, 12), label=name,
            )  # fmt: skip
        axes.set(xlabel="stated standard deviations", xlim=(0.0, MAX_RATIO), ylim=(0.0, 1.0))
        add_title(axes, f"{label}: fraction of contacts within")
    panels[1].legend(loc="lower right")
    return figure


def draw_trust(study: CalibrationStudy) -> Figure:
    """Draw the correlation with the truth over trust in a panel for every scenario, each with the line r = T."""
    frames, names = study.frames, study.scenarios
    columns = min(len(names), PANELS)
    rows = -(-len(names) // columns)
    figure = new_figure("double", min(0.28 * rows + 0.05, 2.5))
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    low = float(min(frames.trust.min(), frames.r.min(), 0.9))
    for number, axes in enumerate(panels.flat):
        axes.plot([low, 1.0], [low, 1.0], color=VERMILION, linewidth=1.0)
        if number >= len(names):
            axes.set_axis_off()
            axes.lines[0].set_visible(False)
            continue
        here = frames.scenario == names[number]
        sound, suspect = here & ~frames.suspect, here & frames.suspect
        axes.plot(frames.trust[sound], frames.r[sound], "o", color=COLOURS[0], mfc="none", markersize=3.0)
        axes.plot(frames.trust[suspect], frames.r[suspect], "x", color=COLOURS[1], markersize=3.0)
        below = 100.0 * study.too_trusting_by_scenario.get(names[number], 0.0)
        axes.set_title(f"{names[number]}, below: {below:.0f} %", fontsize=7)
    figure.supxlabel("trust T (crosses: suspect frames)", fontsize=8)
    figure.supylabel("correlation r with the true f$_n$", fontsize=8)
    return figure


def draw_predictions(study: CalibrationStudy) -> Figure:
    """Draw the expected correlation of `check` with its interval over the correlation that was reached."""
    figure = new_figure("single", 1.0)
    axes: Axes = figure.add_subplot()
    known = [each for each in study.outcomes if each.score.r_late is not None and np.isfinite(each.expected[0])]
    for number, group in enumerate(("correct", "missing physics", "wrong input")):
        some = [each for each in known if SCENARIOS[each.score.scenario].group == group]
        if not some:
            continue
        r = np.array([each.score.r_late for each in some], float)
        expected, low, high = np.array([each.expected for each in some]).T
        axes.errorbar(
            r, expected, yerr=[expected - low, high - expected], fmt=MARKS[number], color=COLOURS[number],
            mfc="none", linewidth=0.8, capsize=1.5, markersize=4.0, label=group,
        )  # fmt: skip
    lowest = min([0.9, *(float(low) for each in known for low in (each.expected[1], each.score.r_late or 0.0))]) - 0.01
    axes.plot([lowest, 1.0], [lowest, 1.0], color=VERMILION, linewidth=1.2)
    axes.set(
        xlabel="correlation that was reached", ylabel="predicted by check", xlim=(lowest, 1.0), ylim=(lowest, 1.0),
        aspect="equal",
    )  # fmt: skip
    axes.legend(loc="lower right")
    return figure


def _encoded(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()
