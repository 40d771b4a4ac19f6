"""Writes two force fields side by side: both networks, their difference, and curves of their agreement.

The entities are below /compare; the timeline is `frame`. Widths and colours of both networks have the same scale. In
the difference the width of a line is the difference of the forces; it is warm where the first field is greater and cool
where the second is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from ..drawing.accumulated_strain import accumulated_strains
from ..drawing.force_range import ForceRange
from ..process.atomic import replacing
from ..results.comparison import Comparison, FieldFrame
from ..solver.bodies.grains import Array
from ..solver.contacts.pairs import align
from .files.writing import writing
from .look import entities
from .look.axes import Axes, log_scatter_axes, scatter
from .look.canvas import Canvas
from .look.clock import Clock
from .look.colours import SERIES
from .look.force_style import ForceStyle
from .look.printable_text import printable
from .look.scene import Scene, tracks_in_cell
from .look.values import log_curve_style, log_scalar, nullable
from .packing_layers.captions import log_caption
from .packing_layers.forces.difference import log_difference, log_difference_legend
from .packing_layers.forces.network import body_values
from .packing_layers.grains_and_walls import log_grains_and_walls
from .packing_layers.legends import log_force_legend, log_scale_bar
from .tabs.views import curve_view, drawn_view, packing_view

APPLICATION_ID = "rodsight-compare"  # a separate one, so that the viewer does not apply a layout of runs to comparisons
FIRST, SECOND = "/compare/first", "/compare/second"
DIFFERENCE = "/compare/difference"
SCATTER, SCATTER_AXES = "/compare/scatter/contacts", "/compare/scatter/axes"
R_FN, R_FT, ERROR, SUM_RATIO = (f"/compare/{name}" for name in ("r_fn", "r_ft", "relative_l2", "sum_ratio"))
ANGLES = tuple(f"/compare/{which}/{name}" for which in ("first", "second") for name in ("friction_angle", "wall_ratio"))
SUMMARY = "/compare/summary"


def record_comparison(comparison: Comparison, path: Path | str) -> int:
    """Write a comparison as a recording and return its size [bytes]."""
    path, base = Path(path), comparison.base
    tracks = tracks_in_cell(base.tracks, base.walls)
    canvas = Canvas.around(tracks, None, None, base.walls)
    scene = Scene(
        f"{comparison.first.name} and {comparison.second.name}", tracks, base.walls, base.grains, base.friction,
        base.configuration, canvas, ForceStyle.on(canvas, _range_of(comparison)),
    )  # fmt: skip
    rr.set_strict_mode(True)
    stream = rr.RecordingStream(APPLICATION_ID)
    with replacing(path) as part, writing(stream, part, make_comparison_blueprint(comparison, canvas)):
        stream.set_log_time_enabled(False)
        stream.send_recording_name(printable(scene.name))
        axes = _log_styles(stream, scene, comparison)
        strains = accumulated_strains([forces.strain for forces in base.frames])
        for frame, strain in enumerate(strains):
            clock = Clock(stream, frame, frame, frame, float(base.tracks.time[frame]), strain)
            _log_frame(clock, scene, comparison, axes)
        stream.reset_time()
        text = rr.TextDocument(printable(describe(comparison)), media_type=rr.MediaType.MARKDOWN)
        stream.log(SUMMARY, text, static=True)
    return path.stat().st_size


def describe(comparison: Comparison) -> str:
    """Return the results of a comparison as Markdown."""
    first, second = comparison.first.name, comparison.second.name
    rows = [
        f"| {k} | {a.r_fn:.3f} | {a.r_ft:.3f} | {a.relative_l2:.3f} | {a.scale:.3f} "
        f"| {np.degrees(x.friction_angle):.1f} | {np.degrees(y.friction_angle):.1f} "
        f"| {np.degrees(x.wall_ratio_angle):.1f} | {np.degrees(y.wall_ratio_angle):.1f} |"
        for k, (a, x, y) in enumerate(
            zip(comparison.agreement, comparison.first.frames, comparison.second.frames, strict=True)
        )
    ]
    head = (
        f"| frame | r(f_n) | r(f_t) | relative L2 | sum ratio | φ {first} | φ {second} | wall {first} | wall {second} |"
    )
    return "\n".join(
        [
            f"# {first} against {second}", "",
            "Over the contacts of either field; an absent contact counts as 0. Relative L2 and the ratio of the sums "
            f"of f_n are relative to {second}. Angles in degrees: φ of the stress, and the wall ratio atan(T/N).", "",
            *[f"- {note}" for note in comparison.notes], "", head, "|" + "---|" * 9, *rows,
        ]
    )  # fmt: skip


def make_comparison_blueprint(comparison: Comparison, canvas: Canvas) -> rrb.Blueprint:
    """Make the blueprint: networks and difference above, scatter plot and curves below; a second tab with the table."""
    packing = [entities.WALLS, f"{entities.GRAINS}/**"]
    legend = f"{entities.FORCE_LEGEND}/**"
    first, second = printable(comparison.first.name), printable(comparison.second.name)
    side = rrb.Vertical(
        rrb.Horizontal(
            packing_view(first, canvas, [*packing, FIRST, legend]),
            packing_view(f"{first} − {second}", canvas, [*packing, DIFFERENCE, f"{entities.DIFFERENCE_LEGEND}/**"]),
            packing_view(second, canvas, [*packing, SECOND, legend]),
        ),
        rrb.Horizontal(
            drawn_view(f"f_n: {first} over {second}", "/compare/scatter", (-60.0, 425.0), (-15.0, 455.0)),
            curve_view("Correlation, error", [R_FN, R_FT, ERROR, SUM_RATIO], corner=rrb.Corner2D.LeftBottom),
            curve_view("Friction angle φ, wall ratio [°]", list(ANGLES), corner=rrb.Corner2D.LeftBottom),
            column_shares=[0.8, 1.0, 1.0],
        ),
        row_shares=[1.7, 1.0],
        name="Side by side",
    )  # fmt: skip
    return rrb.Blueprint(
        rrb.Tabs(side, rrb.TextDocumentView(origin=SUMMARY, name="Figures"), name=entities.ROOT_CONTAINER),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=entities.FRAME, fps=4.0, play_state="paused", loop_mode="all"),
        auto_views=False,
        auto_layout=False,
    )


def _range_of(comparison: Comparison) -> ForceRange:
    frames = [*comparison.first.frames, *comparison.second.frames]
    return ForceRange.of_forces([frame.fn for frame in frames])


def _log_styles(stream: rr.RecordingStream, scene: Scene, comparison: Comparison) -> Axes:
    first, second = printable(comparison.first.name), printable(comparison.second.name)
    log_force_legend(stream, scene)
    log_scale_bar(stream, scene.canvas)
    log_difference_legend(stream, scene, first, second)
    names = (f"φ {first}", f"wall ratio {first}", f"φ {second}", f"wall ratio {second}")
    curves = [
        (R_FN, "r(f_n)", SERIES[0], 2.0), (R_FT, "r(f_t)", SERIES[1], 2.0), (ERROR, "relative L2", SERIES[3], 2.0),
        (SUM_RATIO, "ratio of the sums of f_n", SERIES[2], 1.0),
    ]  # fmt: skip
    hues, widths = (SERIES[0], SERIES[1], SERIES[0], SERIES[1]), (2.5, 2.5, 1.0, 1.0)
    curves += list(zip(ANGLES, names, hues, widths, strict=True))
    for path, name, colour, width in curves:
        log_curve_style(stream, path, name, colour, width)
    reach = 1.15 * scene.style.range.top
    axes = Axes((0.0, reach), (0.0, reach), width=400.0, height=400.0)
    log_scatter_axes(stream, axes, SCATTER_AXES, f"{second} [N]", f"{first} [N]")
    return axes


def _log_frame(clock: Clock, scene: Scene, comparison: Comparison, axes: Axes) -> None:
    k = clock.frame
    a, b = comparison.first.frames[k], comparison.second.frames[k]
    log_caption(clock, scene, comparison.base.frames[k])
    log_grains_and_walls(clock, scene, comparison.base.frames[k])
    clock.end()
    for path, field in ((FIRST, a), (SECOND, b)):
        _log_network(clock, scene, path, field)
    key, fn = _on_union(a, b, "fn")
    _, ft = _on_union(a, b, "ft")
    log_difference(clock, scene, DIFFERENCE, key, fn, ft)
    clock.log(SCATTER, scatter(axes, fn[1], fn[0]))
    agreement = comparison.agreement[k]
    angles = (a.friction_angle, a.wall_ratio_angle, b.friction_angle, b.wall_ratio_angle)
    for path, value in (
        (R_FN, agreement.r_fn), (R_FT, agreement.r_ft), (ERROR, agreement.relative_l2), (SUM_RATIO, agreement.scale),
        *((path, float(np.degrees(angle))) for path, angle in zip(ANGLES, angles, strict=True)),
    ):  # fmt: skip
        log_scalar(clock, path, value)


def _log_network(clock: Clock, scene: Scene, path: str, field: FieldFrame) -> None:
    shown = np.flatnonzero(np.isfinite(field.contacts.point).all(axis=1))
    contacts, fn, ft = field.contacts.select(shown), field.fn[shown], field.ft[shown]
    clock.log(
        path,
        scene.style.strips(scene.branches(clock.frame, contacts), fn),
        rr.AnyValues(**body_values(scene, contacts), fn=nullable(fn), ft=nullable(ft)),
    )


def _on_union(a: FieldFrame, b: FieldFrame, name: str) -> tuple[NDArray[np.int64], Array]:
    """Return keys (u,) of the contacts of either field, and both forces on them (2, u) [N], 0 without contact."""
    key, *both = align(a.contacts.key, np.nan_to_num(getattr(a, name)), b.contacts.key, np.nan_to_num(getattr(b, name)))
    return key, np.stack(both)
