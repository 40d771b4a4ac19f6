"""One page for a whole campaign: its runs in a table, friction angle and trust of each over its frames."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from ..atomic import write_atomically
from ..run_folder import SUMMARY
from .collect import Row

REPORT = "report.html"
CURVES = {"friction_angle_degrees": "macroscopic friction angle [°]", "trust": "trust T, from 0 to 1"}
WIDTH, HEIGHT, EDGE = 900, 240, 40  # [px]
SHOWN = 12  # curves that can be told apart
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#4b4b4b", "#999933")
HIDDEN = ("experiment",)


def write_report(folder: Path, rows: Sequence[Row]) -> Path:
    """Write report.html into the campaign's folder; returns it."""
    import jinja2

    source = files(__name__.rpartition(".")[0]).joinpath("report.html").read_text(encoding="utf-8")
    template = jinja2.Environment(autoescape=True, trim_blocks=True).from_string(source)
    heads = [name for name in dict.fromkeys(key for row in rows for key in row) if name not in HIDDEN]
    done = [str(row["run"]) for row in rows if row["state"] == "done"]
    charts = [
        {"svg": _chart({name: _curve(folder / name, key) for name in done[:SHOWN]}), "caption": f"{meaning} over frames"
         + (f", of the first {SHOWN} runs" if len(done) > SHOWN else "")}
        for key, meaning in CURVES.items()
        if done
    ]  # fmt: skip
    failed = sum(row["state"] == "failed" for row in rows)
    page = template.render(
        title=f"Campaign {folder.name}", rows=rows, heads=heads, charts=charts, failed=failed, folder=folder.as_posix()
    )
    write_atomically(folder / REPORT, page.encode())
    return folder / REPORT


def _curve(run: Path, key: str) -> list[float | None]:
    """A value of every frame after the first, which no motion leads to."""
    values = json.loads((run / SUMMARY).read_text(encoding="utf-8"))[key]
    return [None, *values[1:]]


def _chart(curves: dict[str, list[float | None]]) -> str:
    """Curves over frames, named at the side."""
    from html import escape

    known = [value for curve in curves.values() for value in curve if value is not None]
    low, high = min([0.0, *known]), max([1e-9, *known])
    length = max((len(curve) for curve in curves.values()), default=1)
    inner, tall = WIDTH - EDGE - 230, HEIGHT - 2 * EDGE

    def place(frame: int, value: float) -> str:
        return f"{EDGE + inner * frame / max(length - 1, 1):.1f},{EDGE + tall * (high - value) / (high - low):.1f}"

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" role="img" font-size="12" fill="none" stroke-width="1.5">',
        f'<path d="M{EDGE},{EDGE} v{tall} h{inner}" stroke="#99a3ad"/>',
        *(
            f'<text x="{EDGE - 6}" y="{y}" fill="#55606d" text-anchor="end">{value:.3g}</text>'
            for y, value in ((EDGE + 4, high), (EDGE + tall + 4, low))
        ),
        f'<text x="{EDGE + inner}" y="{HEIGHT - EDGE + 16}" fill="#55606d" text-anchor="end">frame {length - 1}</text>',
    ]
    for number, (name, curve) in enumerate(curves.items()):
        colour = COLOURS[number % len(COLOURS)]
        points = " ".join(place(k, value) for k, value in enumerate(curve) if value is not None)
        dashed = ' stroke-dasharray="5 3"' if number >= len(COLOURS) else ""
        parts.append(f'<polyline points="{points}" stroke="{colour}"{dashed}/>')
        parts.append(
            f'<text x="{EDGE + inner + 12}" y="{EDGE + 14 * number}" fill="{colour}">{escape(name[:34])}</text>'
        )
    return "".join([*parts, "</svg>"])
