"""The views of which tabs consist."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping
from rerun.blueprint.visualizers import Visualizer  # pyright: ignore[reportPrivateImportUsage]

from ...results.schema import unit_of
from ..curve_layers.statistic_curves import CURVES
from ..look import entities
from ..look.canvas import Canvas
from ..look.colours import BACKGROUND
from .axis_ranges import Extremes, range_with_legend

WALL_KEY_BOUNDS = ((-60.0, 660.0), (0.0, 60.0))
PLOT_HEIGHT = 300.0  # [px] height of a curve view by default
BANDED = {curve.path for curve in CURVES}
_TOP = (rrb.Corner2D.LeftTop, rrb.Corner2D.RightTop)


def packing_view(name: str, canvas: Canvas, contents: list[str], contacts: Visualizer | None = None) -> rrb.View:
    """Return a view of the packing with scale bar and caption above it and space for a legend below.

    Parameters
    ----------
    name : str
        Title of the view.
    canvas : Canvas
        Bounds of the packing.
    contents : list of str
        Entities.
    contacts : Visualizer, optional
        Style of the contacts; None: by f_n.
    """
    return rrb.Spatial2DView(
        origin="/",
        contents=[*contents, f"{entities.SCALE_BAR}/**", entities.CAPTION],
        name=name,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[canvas.left, canvas.right],
            y_range=[canvas.top - canvas.header_height, canvas.bottom + canvas.legend_height],
        ),
        overrides={entities.FORCES: contacts} if contacts else None,
    )


def contacts_by(quantity: str, *, radius: float | None = None) -> Visualizer:
    """Return a style of contacts coloured by one of entities.COLOURED_BY; radius [px] of all lines, None: by f_n."""
    style = rr.LineStrips2D.from_fields(radii=None if radius is None else [radius])
    source = f"{entities.coloured_by(quantity)}:colors"
    chosen = VisualizerComponentMapping(
        "LineStrips2D:colors", ComponentSourceKind.SourceComponent, source_component=source
    )
    return style.visualizer(mappings=[chosen])


def drawn_view(name: str, origin: str, x_range: tuple[float, float], y_range: tuple[float, float]) -> rrb.View:
    """Return a view of a plot drawn as lines: all entities below one."""
    return rrb.Spatial2DView(
        origin=origin,
        contents="$origin/**",
        name=name,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=list(x_range), y_range=list(y_range)),
    )


def polar_view(name: str, origin: str, circles: float) -> rrb.View:
    """Return a view of a plot about a unit circle, up to a radius of `circles` unit circles."""
    reach = 100.0 * circles
    return drawn_view(name, origin, (-reach, reach), (-reach, reach))


def solid_view(name: str, origin: str, eye: tuple[float, float, float], target: tuple[float, float, float]) -> rrb.View:
    """Return a view in three dimensions, y up, from the point `eye` to the point `target` [m]."""
    return rrb.Spatial3DView(
        origin=origin,
        name=name,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0.0, 1.0, 0.0)),
        spatial_information=rrb.SpatialInformation(target_frame="tf#/", show_axes=False, show_bounding_box=False),
    )


def lanes_view() -> rrb.View:
    """Return a view of the status and tracking of frames as lanes, whose signs its title explains."""
    return rrb.StateTimelineView(
        origin="/frames",
        contents=[entities.STATUS_LANE, entities.TRACKING_LANE],
        name="0 reset   ≠ rearranging   ≈ settling   = settled   ? suspect   × failed",
        time_view=whole_axis(),
    )


def wall_force_views(extremes: Extremes, walls: int, *, recorded: bool) -> list[rrb.View | rrb.Container]:
    """Return plots of the forces on the walls, and the key to their colours; nothing where there are no walls."""
    if not walls:
        return []
    unit = unit_of("statistics/wall_force")
    normal, tangential = [entities.WALL_NORMAL_FORCE], [entities.WALL_TANGENTIAL_FORCE]
    if recorded:
        normal, tangential = [*normal, entities.WALL_NORMAL_RECORDED], [*tangential, entities.WALL_TANGENTIAL_RECORDED]
    plots = [
        curve_view(f"Walls, {name} [{unit}]", paths, extremes, entries=0)
        for name, paths in (("normal", normal), ("tangential", tangential))
    ]
    key = drawn_view("Walls; wide and pale: recorded" if recorded else "Walls", entities.WALL_KEY, *WALL_KEY_BOUNDS)
    return [rrb.Horizontal(*plots), key]


def curve_view(
    name: str,
    contents: list[str],
    span: Extremes | tuple[float, float] | None = None,
    *,
    height: float = PLOT_HEIGHT,
    entries: int | None = None,
    corner: rrb.Corner2D = rrb.Corner2D.RightTop,
    axis: rrb.TimeAxis | None = None,
) -> rrb.View:
    """Return a plot of curves with the bands of those that have one.

    Parameters
    ----------
    name : str
        Title of the view.
    contents : list of str
        Paths of the curves.
    span : mapping or tuple of float, optional
        Least and greatest values of the curves, for an axis with space for the legend; or the range of the axis.
    height : float
        Height of the plot in a window of usual size [px].
    entries : int, optional
        Entries of the legend; None: one per path, whose band has its name, none for a single curve.
    corner : Corner2D
        Corner of the legend.
    axis : TimeAxis, optional
        Range of the timeline; None: the whole test.
    """
    bands = [path + entities.BAND for path in contents if path in BANDED]
    if entries is None:
        entries = len(contents) if len(contents) > 1 else 0
    contents = [*bands, *contents]
    y_range = span if isinstance(span, tuple) else None
    if not isinstance(span, tuple):
        y_range = range_with_legend(span or {}, contents, entries=entries, height=height, top=corner in _TOP)
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=name,
        axis_x=axis or whole_axis(),
        axis_y=rrb.ScalarAxis(range=y_range) if y_range else None,
        plot_legend=rrb.PlotLegend(corner, visible=entries > 0),
        background=rrb.archetypes.PlotBackground(color=BACKGROUND),  # for which the curves have their colours
    )


def whole_axis() -> rrb.TimeAxis:
    """Return an axis of the whole timeline; by default the viewer shows a minute, or 2000 values, about the cursor."""
    everything = rrb.TimeRangeBoundary.infinite()
    return rrb.TimeAxis(link="Independent", view_range=rrb.TimeRange(start=everything, end=everything))


def near_axis() -> rrb.TimeAxis:
    """Return an axis of a minute, or 2000 values, about the cursor, for curves with a value at every sweep."""
    return rrb.TimeAxis(link="Independent")
