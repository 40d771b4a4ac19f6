"""Inferred forces beside measured ones for the eye: a table on the terminal, and a page with pictures side by side."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from solver.bodies.grains import Array

from .real_forces import WAYS, Field, RealStudy, mean_of

WIDTH = 110  # columns of the table
SIDE = 420  # px of a picture
THICKEST = 7.0  # px of the line of a force of GREATEST means
GREATEST = 4.0  # mean forces: beyond, lines grow no more
FAINTEST = 0.05  # mean forces: weaker ones are not drawn
NAMES = {
    "ours": "inferred", "static": "in balance", "overlap": "in balance, towards overlaps", "uniform": "same everywhere",
    "ceiling": "in balance, nearest to the truth",
}  # fmt: skip
MEANINGS = (
    "r: correlation of normal forces over all near pairs and all that either side names; matched: over the contacts "
    "that truly bear; pressure: of the grains' pressures; turned: how far the principal direction is off, without sign."
)


def print_real(console: Console, study: RealStudy) -> None:
    """Print a row per way of finding forces, means over frames; then what limits them."""
    table = Table(title=f"{study.name}: {len(study.frames)} frames against measured forces", box=None, pad_edge=False)
    table.add_column("forces", no_wrap=True)
    for heading in ("r", "matched", "pressure", "turned [°]"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows_of(study):
        table.add_row(*row)
    console.print(table)
    console.print(MEANINGS, highlight=False)
    console.print(limits_of(study), highlight=False)


def rows_of(study: RealStudy) -> list[tuple[str, ...]]:
    """Name and figures of every way, means over the frames."""
    return [
        (
            NAMES[way],
            *(_told(mean_of([getattr(getattr(row, way), name) for row in study.frames]), 3)
              for name in ("r", "matched", "pressure")),
            _told(mean_of([abs(row.turned(way)) for row in study.frames]), 1),
        )
        for way in WAYS
    ]  # fmt: skip


def limits_of(study: RealStudy) -> str:
    """What the truth itself is worth, and which contacts were found, in words."""
    sides, direction = mean_of([row.sides for row in study.frames]), mean_of([row.direction for row in study.frames])
    precision, recall = (mean_of([getattr(row, name) for row in study.frames]) for name in ("precision", "recall"))
    read = (
        f"The two readings of a contact correlate by {_told(sides, 3)}. " if sides is not None
        else "The truth has one reading of a contact: its own noise is not known. "
    )  # fmt: skip
    return (
        f"{read}True principal direction {_told(direction, 1)}°. Contacts that carry force in the run: "
        f"{_told(precision, 3)} of them truly bear; {_told(recall, 3)} of those that truly bear are listed."
    )


def real_page(study: RealStudy) -> str:
    """A self-contained HTML page: truth, inferred and best baseline of one frame, and the table of all frames."""
    best = max(
        ("static", "overlap", "uniform"), key=lambda way: _or_least(mean_of([getattr(r, way).r for r in study.frames]))
    )
    pictures = [
        _figure(study, study.truth, "measured"),
        _figure(study, study.drawn["ours"], f"inferred, r = {_told(study.frames[study.shown].ours.r, 2)}"),
        _figure(
            study, study.drawn[best],
            f"{NAMES[best]} (no motion), r = {_told(getattr(study.frames[study.shown], best).r, 2)}",
        ),
    ]  # fmt: skip
    head = "".join(f"<th>{each}</th>" for each in ("forces", "r", "matched", "pressure", "turned [°]"))
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows_of(study)
    )
    title = html.escape(study.name)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}: forces against measured ones</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 84rem; padding: 0 1rem;
  color: #222; background: #fff; }}
figure {{ display: inline-block; margin: 0 .8rem 1rem 0; }} figcaption {{ text-align: center; }}
td, th {{ padding: .15rem .9rem .15rem 0; text-align: right; }} td:first-child, th:first-child {{ text-align: left; }}
</style></head><body>
<h1>{title}</h1>
<p>Frame {study.shown} of {len(study.frames)}. A line is as thick as its force over the mean of its picture.</p>
{"".join(pictures)}
<h2>Means over all frames</h2>
<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>
<p>{html.escape(MEANINGS)}</p>
<p>{html.escape(limits_of(study))}</p>
</body></html>
"""


def _figure(study: RealStudy, field: Field, caption: str) -> str:
    """Grains as circles, forces between centres as lines."""
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


def _lines(study: RealStudy, field: Field, pixels: Callable[[Array], Array]) -> Sequence[str]:
    fn = np.nan_to_num(field.force[:, 0])
    bearing = fn > 0.0
    if not bearing.any():
        return ()
    strength = fn / fn[bearing].mean()
    contacts = field.contacts
    drawn = np.flatnonzero((strength > FAINTEST) & ~contacts.with_wall)
    start, end = (pixels(study.position[side[drawn]]) for side in (contacts.i, contacts.j))
    width = np.minimum(strength[drawn], GREATEST) * THICKEST / GREATEST
    return [
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke-width="{w:.2f}"/>'
        for a, b, w in zip(start, end, width, strict=True)
    ]


def _told(value: float | None, digits: int) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def _or_least(value: float | None) -> float:
    return -1.0 if value is None else value
