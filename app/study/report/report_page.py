"""The calibration report: one HTML page that needs nothing else."""

from __future__ import annotations

import base64
import io

import numpy as np
from jinja2 import Environment
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import erf

from ...figures.page import COLOURS, DASHES, INK, VERMILION, add_title, new_figure, paper_style
from ..worlds.intervals import COMPONENTS, GROUPS
from ..worlds.numbers import HEADINGS, WORLD_HEADINGS
from .calibration_report import CalibrationStudy, rows_of_coverage, rows_of_numbers, rows_of_sliding

REACH = 3.0  # deviations
MARKS = "osv^D<>Ph*Xd"

_PAGE = Environment(autoescape=True).from_string("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Rodsight {{ facts.version }}: calibration report</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 64rem; padding: 0 1rem;
  color: #222; background: #fff }
img { max-width: 100%; margin: .3rem 0 }
td, th { padding: .1rem .9rem .1rem 0; text-align: right } td:first-child, th:first-child { text-align: left }
.broken { color: #a00 } code { overflow-wrap: anywhere }
</style></head><body>
<h1>Calibration report</h1>
<p>Rodsight {{ facts.version }}. Simulated worlds {{ facts.worlds|join(", ") }} of {{ facts.grains }} rods, seeds
{{ facts.seeds|join(", ") }}; {{ facts.contacts }} contacts in {{ facts.frames }} frames. SHA-256 of the data:
<code>{{ facts.data }}</code></p>
{% if facts.broken %}<p class="broken">What does not hold:</p><ul class="broken">
{% for each in facts.broken %}<li>{{ each }}</li>{% endfor %}</ul>
{% else %}<p><b>All that is stated holds within its limits.</b></p>{% endif %}
<h2>Intervals of contact forces</h2>
<p>How many contacts are within so many stated standard deviations of the truth, by kind of contact; the black line is
the normal law. Above it intervals are too wide, below it too narrow.</p>
<img src="{{ coverage }}" alt="Coverage of the intervals of normal and tangential forces by kind of contact">
<table><thead><tr><th>contacts</th>
<th>f_n 68 %</th><th>f_n 95 %</th><th>f_t 68 %</th><th>f_t 95 %</th><th>beyond 5 and 2 %</th></tr></thead><tbody>
{% for row in covered %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
<h2>Trust</h2>
<p>Trust is a lower bound of the correlation with the true normal forces: at most 5 % of the frames may lie below the
line. {{ "%.1f"|format(100 * facts.too_trusting) }} % do.</p>
<img src="{{ trust }}" alt="Correlation with the truth over trust, frame by frame">
<h2>Statistics</h2>
<table><thead><tr>{% for each in headings %}<th>{{ each }}</th>{% endfor %}</tr></thead><tbody>
{% for row in rows %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
<p>Bias: mean of stated less true over the mean true value; of angles in degrees; of densities the share that lies in
another bin. Scatter: of single frames about the bias. 68 %, 95 %: frames within one and two stated deviations.</p>
<h3>The share of contacts that slide, by world</h3>
<table><thead><tr>{% for each in world_headings %}<th>{{ each }}</th>{% endfor %}</tr></thead><tbody>
{% for row in sliding %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</tbody></table>
</body></html>
""")


def report_page(study: CalibrationStudy) -> str:
    """The page as text."""
    with paper_style():
        coverage, trust = _encoded(draw_coverage(study)), _encoded(draw_trust(study))
    return _PAGE.render(
        facts=study.facts(), coverage=coverage, covered=rows_of_coverage(study), trust=trust, headings=HEADINGS,
        rows=rows_of_numbers(study), world_headings=WORLD_HEADINGS, sliding=rows_of_sliding(study),
    )  # fmt: skip


def draw_coverage(study: CalibrationStudy) -> Figure:
    """Share of contacts within so many deviations, by group, of f_n and f_t."""
    figure = new_figure("double", 0.5)
    panels = figure.subplots(1, 2, sharey=True)
    at = np.linspace(0.0, REACH, 61)
    for component, (axes, label) in enumerate(zip(panels, COMPONENTS, strict=True)):
        axes.plot(at, erf(at / np.sqrt(2.0)), color=INK, linewidth=1.6, label="normal law")
        for number, name in enumerate(name for name in GROUPS if name in study.coverage and name != "all"):
            part = study.errors.select(GROUPS[name](study.errors))
            ratio = np.abs(part.error[:, component]) / np.maximum(part.deviation[:, component], 1e-12)
            share = np.searchsorted(np.sort(ratio), at, side="right") / len(ratio)
            axes.plot(
                at, share, color=COLOURS[number % len(COLOURS)], linestyle=DASHES[number % len(DASHES)],
                marker=MARKS[number], markevery=(3 + number, 12), label=name,
            )  # fmt: skip
        axes.set(xlabel="stated standard deviations", xlim=(0.0, REACH), ylim=(0.0, 1.0))
        add_title(axes, f"{label}: share of contacts within")
    panels[1].legend(loc="lower right")
    return figure


def draw_trust(study: CalibrationStudy) -> Figure:
    """Correlation with the truth over trust, a mark for each world."""
    figure = new_figure("double", 0.55)
    axes: Axes = figure.add_subplot()
    frames = study.frames
    for number, world in enumerate(study.worlds):
        here = frames.world == world
        axes.plot(
            frames.trust[here], frames.r[here], MARKS[number % len(MARKS)], color=COLOURS[number % len(COLOURS)],
            mfc="none", label=world,
        )  # fmt: skip
    low = float(min(frames.trust.min(), frames.r.min(), 0.9))
    axes.plot([low, 1.0], [low, 1.0], color=VERMILION, linewidth=1.2, label="r = T: at most 5 % below")
    axes.set(xlabel="trust T", ylabel="correlation r with the true f$_n$")
    axes.legend(loc="lower right", ncols=2)
    return figure


def _encoded(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode()
