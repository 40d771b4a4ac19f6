"""Lines over a common axis, as SVG."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

WIDTH, HEIGHT = 480, 270
LEFT, RIGHT, TOP, BOTTOM = 58, 12, 30, 40
COLOURS = ("#1f6fd0", "#e8871e", "#b5322f", "#4a5463")


def line_chart(x: NDArray[np.int64], lines: Mapping[str, Array], title: str, below: str) -> str:
    """Lines (f,) by name over x (f,); values that are not finite interrupt a line."""
    known = np.concatenate([line[np.isfinite(line)] for line in lines.values()])
    if known.size == 0:
        return f"<p>{escape(title)}: not known.</p>"
    ticks = _ticks(float(known.min()), float(known.max()))
    low, high = ticks[0], ticks[-1]
    first, last = float(x.min()), max(float(x.max()), float(x.min()) + 1.0)

    def across(value: float) -> float:
        return LEFT + (value - first) / (last - first) * (WIDTH - LEFT - RIGHT)

    def up(value: float) -> float:
        return HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - TOP - BOTTOM)

    parts = [f'<text x="{LEFT}" y="16" font-weight="600">{escape(title)}</text>']
    digits = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-9))
    for tick in ticks:
        y = up(tick)
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="#e3e6ea"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.{digits}f}</text>')
    for tick in _ticks(first, last):
        if first <= tick <= last and tick == round(tick):
            parts.append(
                f'<text x="{across(tick):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{tick:.0f}</text>'
            )
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">{escape(below)}</text>')
    key = float(LEFT)
    for colour, (name, line) in zip(COLOURS, lines.items(), strict=False):
        parts.append(_polyline(colour, [(across(float(a)), up(float(b))) for a, b in zip(x, line, strict=True)]))
        parts.append(f'<rect x="{key}" y="{HEIGHT - 14}" width="12" height="3" fill="{colour}"/>')
        parts.append(f'<text x="{key + 16}" y="{HEIGHT - 8}">{escape(name)}</text>')
        key += 30.0 + 7.0 * len(name)
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" font-size="12" font-family="system-ui, sans-serif" fill="#4a5463">'
        + "".join(parts)
        + "</svg>"
    )


def _polyline(colour: str, points: list[tuple[float, float]]) -> str:
    path, pen = [], "M"
    for x, y in points:
        if not math.isfinite(y):
            pen = "M"
            continue
        path.append(f"{pen}{x:.1f} {y:.1f}")
        pen = "L"
    drawn = f'<path d="{" ".join(path)}" fill="none" stroke="{colour}" stroke-width="1.8"/>'
    if len(path) == 1:  # a single photograph draws no line
        x, y = next((x, y) for x, y in points if math.isfinite(y))
        drawn += f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colour}"/>'
    return drawn


def _ticks(low: float, high: float) -> list[float]:
    """Round values that enclose low … high, some five of them."""
    span = max(high - low, abs(high) * 1e-6, 1e-12)
    rough = span / 4.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * unit for unit in (1.0, 2.0, 5.0, 10.0) if power * unit >= rough * 0.999)
    first = math.floor(low / step + 1e-9)
    last = max(math.ceil(high / step - 1e-9), first + 1)
    return [step * k for k in range(first, last + 1)]
