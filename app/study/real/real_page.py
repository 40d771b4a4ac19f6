"""Report of inferred against measured forces: a table on the terminal, and a page with pictures side by side."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from ...solver.bodies.grains import Array
from .real_forces import EXCESS, SOURCES, FrameField, RealStudy, mean_of

WIDTH = 110  # columns of the table
SIDE = 420  # px of a picture
MAX_WIDTH = 7.0  # px, line width of a force of MAX_FORCE
MAX_FORCE = 4.0  # mean forces, above which line widths are equal
MIN_FORCE = 0.05  # mean forces, below which no line is drawn
NAMES = {
    "ours": "inferred", "static": "in equilibrium", "overlap": "in equilibrium, nearest to overlaps",
    "uniform": "uniform", "ceiling": "in equilibrium, nearest to the truth",
}  # fmt: skip
MEANINGS = (
    "r: correlation of normal forces over all candidate pairs and all contacts of either side; matched: over the true "
    "contacts with force; pressure: of the grains' pressures; direction: absolute error of the principal direction; "
    "total: correlation of the sum of f_n over time with the true one."
)
HEADINGS = ("r", "matched", "pressure", "direction [°]", "total")


def print_real(console: Console, study: RealStudy) -> None:
    """Print a row per force field, means over frames; then the limits of the measurement."""
    table = Table(title=f"{study.name}: {len(study.frames)} frames against measured forces", box=None, pad_edge=False)
    table.add_column("forces", no_wrap=True)
    for heading in HEADINGS:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows_of(study):
        table.add_row(*row)
    console.print(table)
    console.print(MEANINGS, highlight=False)
    console.print(describe_limits(study), highlight=False)


def rows_of(study: RealStudy) -> list[tuple[str, ...]]:
    """Return the name and figures of every force field, means over the frames."""
    return [
        (
            NAMES[source],
            *(_format(mean_of([getattr(getattr(row, source), name) for row in study.frames]), 3)
              for name in ("r", "matched", "pressure")),
            _format(mean_of([abs(row.direction_error(source)) for row in study.frames]), 1),
            _format(study.total_correlation(source), 2),
        )
        for source in SOURCES
    ]  # fmt: skip


def describe_limits(study: RealStudy) -> str:
    """Describe the noise of the measured forces and the agreement of contacts, in sentences."""
    sides, direction = mean_of([row.sides for row in study.frames]), mean_of([row.direction for row in study.frames])
    precision, recall = (mean_of([getattr(row, name) for row in study.frames]) for name in ("precision", "recall"))
    read = (
        f"The two readings of a contact correlate by {_format(sides, 3)}. " if sides is not None
        else "The truth has one reading per contact: its noise is unknown. "
    )  # fmt: skip
    return (
        f"{read}True principal direction {_format(direction, 1)}°. Of the contacts with force in the run, "
        f"{_format(precision, 3)} truly carry force; of the true contacts with force, {_format(recall, 3)} are listed. "
        f"{_describe_trust(study)} {_describe_coverage(study)} {_describe_direction(study)}"
    ).rstrip()


def _describe_direction(study: RealStudy) -> str:
    sd, one, two = study.direction_coverage()
    if not np.isfinite(sd):
        return ""
    return (
        f"The standard deviation of the principal direction is {sd:.1f}° on average; one and two cover the true one in "
        f"{100 * one:.0f} and {100 * two:.0f} % of the frames."
    )


def _describe_coverage(study: RealStudy) -> str:
    one, two = (mean_of([row.covered[k] for row in study.frames]) for k in (0, 1))
    if one is None or two is None:
        return ""
    return f"One and two standard deviations of a force cover {100 * one:.0f} and {100 * two:.0f} % of the true ones."


def _describe_trust(study: RealStudy) -> str:
    above, known = study.count_excess()
    if not known:
        return "There is no trust to compare."
    mean = mean_of([row.trust for row in study.frames])
    return (
        f"The trust is {_format(mean, 2)} on average and exceeds r by more than {EXCESS} in {above} of {known} frames."
    )


def real_page(study: RealStudy) -> str:
    """Return a self-contained HTML page: truth, inferred forces and best baseline of one frame, and the table."""
    best = max(
        ("static", "overlap", "uniform"),
        key=lambda source: _or_least(mean_of([getattr(r, source).r for r in study.frames])),
    )
    pictures = [
        _figure(study, study.truth, "measured"),
        _figure(study, study.drawn["ours"], f"inferred, r = {_format(study.frames[study.shown].ours.r, 2)}"),
        _figure(
            study, study.drawn[best],
            f"{NAMES[best]} (no motion), r = {_format(getattr(study.frames[study.shown], best).r, 2)}",
        ),
    ]  # fmt: skip
    head = "".join(f"<th>{each}</th>" for each in ("forces", *HEADINGS))
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows_of(study)
    )
    title = html.escape(study.name)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}: inferred against measured forces</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 84rem; padding: 0 1rem;
  color: #222; background: #fff; }}
figure {{ display: inline-block; margin: 0 .8rem 1rem 0; }} figcaption {{ text-align: center; }}
td, th {{ padding: .15rem .9rem .15rem 0; text-align: right; }} td:first-child, th:first-child {{ text-align: left; }}
</style></head><body>
<h1>{title}</h1>
<p>Frame {study.shown} of {len(study.frames)}. Line widths are proportional to force over its mean in the picture.</p>
{"".join(pictures)}
<h2>Means over all frames</h2>
<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>
<p>{html.escape(MEANINGS)}</p>
<p>{html.escape(describe_limits(study))}</p>
</body></html>
"""


def _figure(study: RealStudy, field: FrameField, caption: str) -> str:
    """Draw grains as circles and forces between centres as lines."""
    here = np.isfinite(study.position).all(axis=1)
    low = (study.position[here] - study.radius[here, None]).min(axis=0)
    high = (study.position[here] + study.radius[here, None]).max(axis=0)
    scale = SIDE / float((high - low).max())

    def pixels(points: Array) -> Array:
        return np.column_stack([points[:, 0] - low[0], high[1] - points[:, 1]]) * scale

    centre = pixels(study.position[here])
    circles = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}"/>'
        for (x, y), r in zip(centre, study.radius[here] * scale, strict=True)
    )
    return (
        f'<figure><svg width="{SIDE}" height="{SIDE}" role="img" aria-label="{html.escape(caption)}">'
        f'<g fill="#eee" stroke="#ccc">{circles}</g><g stroke="#b2182b" stroke-linecap="round">'
        f"{''.join(_lines(study, field, pixels))}</g></svg><figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _lines(study: RealStudy, field: FrameField, pixels: Callable[[Array], Array]) -> Sequence[str]:
    fn = np.nan_to_num(field.force[:, 0])
    bearing = fn > 0.0
    if not bearing.any():
        return ()
    strength = fn / fn[bearing].mean()
    contacts = field.contacts
    drawn = np.flatnonzero((strength > MIN_FORCE) & ~contacts.with_wall)
    start, end = (pixels(study.position[side[drawn]]) for side in (contacts.i, contacts.j))
    width = np.minimum(strength[drawn], MAX_FORCE) * MAX_WIDTH / MAX_FORCE
    return [
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke-width="{w:.2f}"/>'
        for a, b, w in zip(start, end, width, strict=True)
    ]


def _format(value: float | None, digits: int) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _or_least(value: float | None) -> float:
    return -1.0 if value is None else value
