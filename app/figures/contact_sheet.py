"""A contact sheet: small networks of a long run, those at its events first."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ..drawing.force_range import ForceRange
from ..drawing.frame_caption import caption_of_strain
from ..results.results import Results
from ..solver.even_subset import even_subset
from ..solver.frame_forces import FrameStatus
from .figure_style import INK, VERMILION, Width, new_figure
from .force_network import bounds_of, draw_network

COLUMNS: dict[Width, int] = {"single": 4, "double": 7}
ROWS = 5
EVENTS = (FrameStatus.RESET, FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED)


def draw_sheet(results: Results, frame: int, width: Width) -> Figure:
    """Draw networks of the whole run side by side: half of them at events, the others evenly spaced."""
    columns = COLUMNS[width]
    chosen = sheet_frames(results, columns * ROWS)
    rows = -(-len(chosen) // columns)
    low, high = bounds_of(results)
    tall = float((high - low)[1] / (high - low)[0])
    figure = new_figure(width, rows * (tall / columns + 0.045) + 0.05)
    force_range = ForceRange.of(results.frames)
    panels = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    for axes in panels[len(chosen) :]:
        axes.axis("off")
    for axes, k in zip(panels, chosen, strict=False):
        forces = results.frames[k]
        draw_network(axes, results, k, forces.contacts, forces.fn, force_range)
        for text in axes.texts:
            text.remove()  # one scale is enough
        eventful = forces.status in EVENTS
        strain = caption_of_strain(forces)
        label = f"{k}{' · ' + strain if strain else ''}\n{forces.status.name.lower()}"
        axes.set_title(label, loc="left", fontsize=4.5, color=VERMILION if eventful else INK, pad=1.0)
    figure.suptitle(f"{results.name}: {len(chosen)} of {len(results.frames)} frames", x=0.02, ha="left", fontsize=7.0)
    return figure


def sheet_frames(results: Results, most: int) -> list[int]:
    """Choose at most `most` frames with forces: the beginnings of events, at most half, and evenly spaced."""
    status = [each.status for each in results.frames]
    solved = [k for k, each in enumerate(status) if each is not FrameStatus.FAILED]
    begins = [k for k in solved if status[k] in EVENTS and (k == 0 or status[k - 1] is not status[k])]
    if len(begins) > most // 2:
        begins = [begins[row] for row in np.linspace(0, len(begins) - 1, most // 2).round().astype(int)]
    rest = [k for k in solved if k not in begins]
    spaced = even_subset(len(rest), most - len(begins))
    return sorted({*begins, *(rest[row] for row in spaced.tolist())})
