"""The blueprint: which tabs there are and what each shows."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import rerun.blueprint as rrb

from app.recording import entities
from app.recording.canvas import Canvas
from app.recording.colours import BACKGROUND
from app.recording.plots import HEIGHT, WIDTH
from app.recording.stress_and_fabric import ROSE_REACH, STRESS_REACH


class Tab(StrEnum):
    """The tabs, in their order."""

    EXPERIMENT = "Experiment"
    CONVERGENCE = "Convergence"
    SETTLING = "Settling"
    STATISTICS = "Statistics"
    CONTACTS = "Contacts"
    RODS = "3D"
    TRUTH = "Truth"
    SUMMARY = "Summary"


@dataclass(frozen=True, slots=True)
class Layout:
    """What the blueprint must know of a recording."""

    canvas: Canvas
    rod_length: float  # [m]
    frame_count: int
    sweeps_per_frame: int
    photographs: bool
    truth: bool


_PACKING = [entities.WALLS, f"{entities.GRAINS}/**"]
_LOW, _HIGH = rrb.Corner2D.LeftBottom, rrb.Corner2D.LeftTop
_FORCES = [entities.FORCES, entities.SLIDING, f"{entities.FORCE_LEGEND}/**"]


def make_blueprint(layout: Layout, *, active: Tab = Tab.EXPERIMENT, following: bool = False) -> rrb.Blueprint:
    """Make the blueprint with one tab in front; `following` keeps the cursor at the newest frame.

    The Convergence tab in front starts on the timeline `sweep`.
    """
    tabs: dict[Tab, rrb.Container | rrb.View] = {
        Tab.EXPERIMENT: _experiment(layout),
        Tab.CONVERGENCE: _convergence(layout),
        Tab.SETTLING: _settling(),
        Tab.STATISTICS: _statistics(),
        Tab.CONTACTS: _contacts(layout),
        Tab.RODS: _rods(layout),
    }
    if layout.truth:
        tabs[Tab.TRUTH] = _truth(layout)
    tabs[Tab.SUMMARY] = rrb.TextDocumentView(origin=entities.SUMMARY, name=Tab.SUMMARY)
    if active not in tabs:
        raise ValueError(f"there is no tab {active} in this recording")
    return rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=list(tabs).index(active), name="Rodsight"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(
            state="collapsed",
            timeline=entities.SWEEP if active is Tab.CONVERGENCE else entities.FRAME,
            fps=4.0,
            play_state="following" if following else "paused",
            loop_mode="off" if following else "all",
        ),
        auto_views=False,
        auto_layout=False,
    )


def _experiment(layout: Layout) -> rrb.Container:
    photograph = [entities.PHOTOGRAPH] if layout.photographs else []
    return rrb.Horizontal(
        packing_view("Force network", layout.canvas, [*photograph, *_PACKING, *_FORCES]),
        rrb.Vertical(
            _lanes(),
            curve_view(
                "Friction angle [°]", [entities.FRICTION_ANGLE, entities.WALL_RATIO_ANGLE], corner=rrb.Corner2D.LeftTop
            ),
            curve_view("Trust and similarity", [entities.TRUST, entities.SIMILARITY], y_range=(0.0, 1.05), corner=_LOW),
            _flags(),
            row_shares=[1.1, 2.0, 2.0, 1.5],
        ),
        column_shares=[1.75, 1.0],
        name=Tab.EXPERIMENT,
    )


def _convergence(layout: Layout) -> rrb.Container:
    near = max(layout.sweeps_per_frame, 1)
    return rrb.Horizontal(
        packing_view(
            "Network as it forms; the last row of a frame is the reported field", layout.canvas, [*_PACKING, *_FORCES]
        ),
        packing_view(
            "Not converged: grains by unbalance, contacts by change",
            layout.canvas,
            [entities.WALLS, entities.UNBALANCE_MAP, entities.CHANGE_MAP, f"{entities.MAP_LEGEND}/**"],
        ),
        rrb.Vertical(
            curve_view(
                "log₁₀ residuals, every sweep (choose the timeline: sweep)",
                [entities.SWEEP_NATURAL_MAP, entities.SWEEP_UNBALANCE, entities.SWEEP_FORCE_CHANGE, entities.TOLERANCE],
                near=near,
            ),
            curve_view("log₁₀ residuals reached per frame", [entities.FINAL_NATURAL_MAP, entities.FINAL_UNBALANCE]),
            curve_view("Sweeps per frame", [entities.SWEEP_COUNT]),
            row_shares=[2.2, 1.2, 1.0],
        ),
        column_shares=[1.0, 1.0, 0.95],
        name=Tab.CONVERGENCE,
    )


def _settling() -> rrb.Container:
    return rrb.Vertical(
        _lanes(),
        rrb.Horizontal(
            curve_view("Trust and similarity", [entities.TRUST, entities.SIMILARITY], y_range=(0.0, 1.05), corner=_LOW),
            curve_view("Correction ε and old unbalance ū", [entities.CORRECTION, entities.OLD_UNBALANCE]),
        ),
        rrb.Horizontal(curve_view("Frames since reset", [entities.FRAMES_SINCE_RESET]), _flags()),
        row_shares=[1.0, 2.4, 1.6],
        name=Tab.SETTLING,
    )


def _statistics() -> rrb.Container:
    density = rrb.Spatial2DView(
        origin="/statistics/force_density",
        contents="$origin/**",
        name="P(f_n / mean f_n), logarithmic",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-60.0, WIDTH + 25.0], y_range=[-15.0, HEIGHT + 45.0]),
    )
    return rrb.Vertical(
        rrb.Horizontal(
            density,
            _polar_view("Stress / pressure", "stress", STRESS_REACH),
            _polar_view("Fabric", "rose", ROSE_REACH),
            column_shares=[1.5, 1.0, 1.0],
        ),
        rrb.Horizontal(
            curve_view(
                "Coordination number",
                [entities.COORDINATION_NUMBER, entities.COORDINATION_NUMBER_WITHOUT_RATTLERS],
            ),
            curve_view(
                "Friction angle [°]",
                [entities.FRICTION_ANGLE, entities.WALL_RATIO_ANGLE, entities.ANISOTROPY_ANGLE],
                corner=_HIGH,
            ),
            curve_view("Stress [kPa]", [entities.SIGMA_1, entities.PRESSURE, entities.SIGMA_2]),
            curve_view(
                "Anisotropies",
                [
                    entities.CONTACT_ANISOTROPY, entities.BRANCH_ANISOTROPY, entities.NORMAL_FORCE_ANISOTROPY,
                    entities.TANGENTIAL_FORCE_ANISOTROPY,
                ],
            ),
        ),
        rrb.Horizontal(
            curve_view("Tail and plateau of P(f_n)", [entities.TAIL_EXPONENT, entities.PLATEAU_RATIO]),
            curve_view("Sliding and mobilisation", [entities.SLIDING_FRACTION, entities.MOBILISATION]),
            curve_view(
                "Strong network and force chains",
                [
                    entities.STRONG_SHARE, entities.STRONG_PRESSURE_SHARE, entities.STRONG_DEVIATOR_SHARE,
                    entities.CHAIN_GRAIN_SHARE,
                ],
            ),
            curve_view("Normal forces on the walls [N]", [entities.WALL_NORMAL_FORCE], legend=True),
            curve_view("… along the walls [N]", [entities.WALL_TANGENTIAL_FORCE], legend=True),
        ),
        row_shares=[1.5, 1.0, 1.0],
        name=Tab.STATISTICS,
    )  # fmt: skip


def _contacts(layout: Layout) -> rrb.Container:
    shown = [*_PACKING, entities.GAPS, entities.GAINED, entities.PARTED, f"{entities.GAP_LEGEND}/**"]
    return rrb.Horizontal(
        packing_view("Gaps; gained green, lost red", layout.canvas, shown),
        packing_view(
            "Probability that they touch",
            layout.canvas,
            [entities.WALLS, entities.GRAINS, entities.PROBABILITY, f"{entities.PROBABILITY_LEGEND}/**"],
        ),
        rrb.Vertical(
            curve_view("Contacts", [entities.CONTACT_COUNT, entities.EXPECTED_COUNT]),
            curve_view("Doubtful contacts", [entities.DOUBTFUL_COUNT]),
            curve_view("Contacts gained and lost", [entities.GAINED_COUNT, entities.PARTED_COUNT]),
        ),
        column_shares=[1.0, 1.0, 0.8],
        name=Tab.CONTACTS,
    )


def _rods(layout: Layout) -> rrb.View:
    canvas = layout.canvas
    metre = canvas.scale.pixel_size * canvas.shrink
    middle = (0.5 * (canvas.left + canvas.right) - 0.5 * metre, 0.5 * (canvas.top + canvas.bottom))
    x = middle[0] * metre
    y = (canvas.scale.height - 1) * canvas.scale.pixel_size - (middle[1] - 0.5) * metre
    size = metre * max(canvas.width, canvas.height)
    return rrb.Spatial3DView(
        origin="/rods",
        name=Tab.RODS,
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(x + 0.36 * size, y - 0.16 * size, 0.97 * size),
            look_target=(x, y, -0.3 * layout.rod_length),
            eye_up=(0.0, 1.0, 0.0),
        ),
        spatial_information=rrb.SpatialInformation(target_frame="tf#/", show_axes=False, show_bounding_box=False),
    )


def _truth(layout: Layout) -> rrb.Container:
    scatter = rrb.Spatial2DView(
        origin="/truth/scatter",
        contents="$origin/**",
        name="f_n: inferred over true",
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-60.0, 425.0], y_range=[-15.0, 455.0]),
    )
    return rrb.Vertical(
        rrb.Horizontal(
            packing_view("Inferred", layout.canvas, [*_PACKING, *_FORCES]),
            packing_view("True", layout.canvas, [*_PACKING, entities.TRUTH_FORCES, f"{entities.FORCE_LEGEND}/**"]),
        ),
        rrb.Horizontal(
            scatter,
            curve_view(
                "Correlation, error", [entities.TRUTH_R_FN, entities.TRUTH_R_FT, entities.TRUTH_ERROR],
                y_range=(0.0, 1.05), corner=_LOW,
            ),
        ),
        row_shares=[1.7, 1.0],
        name=Tab.TRUTH,
    )  # fmt: skip


def packing_view(name: str, canvas: Canvas, contents: list[str]) -> rrb.View:
    """A view of the packing, with room for a legend below it."""
    return rrb.Spatial2DView(
        origin="/",
        contents=contents,
        name=name,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[canvas.left, canvas.right], y_range=[canvas.top, canvas.bottom + canvas.legend_height]
        ),
    )


def _polar_view(name: str, part: str, circles: float) -> rrb.View:
    reach = 100.0 * circles
    return rrb.Spatial2DView(
        origin=f"/statistics/{part}",
        contents="$origin/**",
        name=name,
        background=BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[-reach, reach], y_range=[-reach, reach]),
    )


def _lanes() -> rrb.View:
    return rrb.StateTimelineView(
        origin="/frames", contents=[entities.STATUS_LANE, entities.TRACKING_LANE], name="Status of the frames"
    )


def _flags() -> rrb.View:
    columns = rrb.TextLogColumns(timeline_columns=[entities.FRAME], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin=entities.FLAGS, name="Flags", columns=columns)


def curve_view(
    name: str,
    contents: list[str],
    *,
    y_range: tuple[float, float] | None = None,
    near: int | None = None,
    legend: bool | None = None,
    corner: rrb.Corner2D = rrb.Corner2D.RightTop,
) -> rrb.View:
    """A plot of curves; `near` shows only that many values on either side of the time cursor."""
    ends = [rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite()]
    if near is not None:
        ends = [rrb.TimeRangeBoundary.cursor_relative(seq=reach) for reach in (-near, near)]
    return rrb.TimeSeriesView(
        origin="/",
        contents=contents,
        name=name,
        axis_x=rrb.TimeAxis(link="Independent", view_range=rrb.TimeRange(start=ends[0], end=ends[1])),
        axis_y=rrb.ScalarAxis(range=y_range) if y_range else None,
        plot_legend=rrb.PlotLegend(corner, visible=len(contents) > 1 if legend is None else legend),
    )
