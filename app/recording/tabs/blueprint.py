"""The blueprint: the tabs and their views."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import rerun.blueprint as rrb

from ...results.schema import unit_of
from ..curve_layers.radius_curve import RADIUS_BOUNDS
from ..curve_layers.stress_and_fabric import ROSE_REACH, STRESS_REACH
from ..look import entities
from ..look.axes import PLOT_BOUNDS
from ..look.canvas import Canvas
from ..packing_layers.film import COLUMNS, SWEEP_COLUMNS, film_bounds
from .axis_ranges import Extremes
from .views import (
    contacts_by,
    curve_view,
    drawn_view,
    flags_view,
    lanes_view,
    near_axis,
    packing_view,
    polar_view,
    solid_view,
)


class Tab(StrEnum):
    """The tabs, in their order."""

    EXPERIMENT = "Experiment"
    CONVERGENCE = "Convergence"
    SETTLING = "Settling"
    STATISTICS = "Statistics"
    LOADS = "Stress and walls"
    CONTACTS = "Contacts"
    MAPS = "Contact maps"
    RODS = "3D"
    FILM = "Film"
    TRUTH = "Truth"
    SUMMARY = "Summary"


@dataclass(frozen=True, slots=True)
class RecordingLayout:
    """The properties of a recording that define its blueprint."""

    canvas: Canvas
    rod_length: float  # [m]
    frame_count: int
    photographs: bool
    truth: bool
    wall_count: int = 4
    radius_curve: bool = False
    wall_forces: bool = False  # recorded by sensors
    budget: bool = False  # error budget
    extremes: Extremes = field(default_factory=dict)  # of the curves known before the recording is written


_PACKING = [entities.WALLS, entities.CELL, f"{entities.GRAINS}/**"]
_LOW, _HIGH = rrb.Corner2D.LeftBottom, rrb.Corner2D.LeftTop
_FORCES = [
    entities.FORCE_UNCERTAINTY,
    entities.FORCES,
    entities.FORCES_ACROSS,
    entities.SLIDING,
    f"{entities.FORCE_LEGEND}/**",
]
_PLAIN_LEGEND = [entities.FORCE_LEGEND, entities.FORCE_LEGEND_TICKS]  # for views without edges, points and rims
_UNIT_RANGE = (-0.04, 1.05)  # of an axis for fractions and correlations
_RESIDUALS = (-6.4, 3.0)  # log10, with space for a legend above


def make_blueprint(layout: RecordingLayout, *, active: Tab = Tab.EXPERIMENT, following: bool = False) -> rrb.Blueprint:
    """Make the blueprint.

    Parameters
    ----------
    layout : RecordingLayout
        The properties of the recording.
    active : Tab
        The tab in front; with the Convergence tab the timeline is `sweep`.
    following : bool
        The cursor stays at the newest frame.

    Raises
    ------
    ValueError
        If the recording has no such tab.
    """
    tabs: dict[Tab, rrb.Container | rrb.View] = {
        Tab.EXPERIMENT: _experiment(layout),
        Tab.CONVERGENCE: _convergence(layout),
        Tab.SETTLING: _settling(layout),
        Tab.STATISTICS: _statistics(layout),
        Tab.LOADS: _loads(layout),
        Tab.CONTACTS: _contacts(layout),
        Tab.MAPS: _maps(layout),
        Tab.RODS: _rods(layout),
        Tab.FILM: _film(layout),
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


def _experiment(layout: RecordingLayout) -> rrb.Container:
    photograph = [entities.PHOTOGRAPH] if layout.photographs else []
    angles = [entities.FRICTION_ANGLE, entities.WALL_RATIO_ANGLE]
    return rrb.Horizontal(
        packing_view("Force network", layout.canvas, [*photograph, *_PACKING, *_FORCES]),
        rrb.Vertical(
            lanes_view(),
            curve_view("Friction angle [°]", angles, layout.extremes, height=200.0, corner=_HIGH),
            curve_view("Trust and similarity", [entities.TRUST, entities.SIMILARITY], y_range=_UNIT_RANGE, corner=_LOW),
            flags_view(),
            row_shares=[1.15, 2.0, 2.0, 1.5],
        ),
        column_shares=[1.75, 1.0],
        name=Tab.EXPERIMENT,
    )


def _convergence(layout: RecordingLayout) -> rrb.Container:
    maps = [entities.WALLS, entities.UNBALANCE_MAP, entities.CHANGE_MAP, f"{entities.MAP_LEGEND}/**"]
    residuals = [entities.SWEEP_NATURAL_MAP, entities.SWEEP_UNBALANCE, entities.SWEEP_FORCE_CHANGE]
    low, high = layout.extremes.get(entities.SWEEP_COUNT, (0.0, 1.0))
    plots: list[rrb.View] = [
        drawn_view("Residuals of this frame over its sweeps", "/solve/plot", *PLOT_BOUNDS),
        curve_view(
            "log₁₀ residuals: every sweep, or the last of a frame", [*residuals, entities.TOLERANCE],
            y_range=(-6.4, 4.4), axis=near_axis(),
        ),
    ]  # fmt: skip
    if high > low:  # no curve for a constant number
        plots.append(curve_view("Sweeps per frame", [entities.SWEEP_COUNT], layout.extremes))
    return rrb.Horizontal(
        packing_view("Network as it forms", layout.canvas, [*_PACKING, *_FORCES]),
        packing_view("Unbalance and change per sweep", layout.canvas, maps),
        rrb.Vertical(*plots, row_shares=[2.0, 1.5, 0.8][: len(plots)]),
        column_shares=[1.0, 1.0, 1.05],
        name=Tab.CONVERGENCE,
    )  # fmt: skip


def _settling(layout: RecordingLayout) -> rrb.Container:
    starts = [entities.COLD_RESIDUAL, entities.WARM_RESIDUAL, entities.FINAL_NATURAL_MAP, entities.FINAL_UNBALANCE]
    indicators = [entities.CORRECTION, entities.OLD_UNBALANCE, entities.START_DIFFERENCE]
    below = [
        curve_view("Settling: ε, ū and H", indicators, layout.extremes, height=190.0),
        curve_view("Sweeps saved by the former forces", [entities.SAVED_SWEEPS]),
    ]
    longest = layout.extremes.get(entities.FRAMES_SINCE_RESET, (0.0, 0.0))[1]
    if longest < layout.frame_count - 1:  # no curve that only counts the frames
        below.append(curve_view("Frames since reset", [entities.FRAMES_SINCE_RESET], layout.extremes))
    if layout.budget:
        below[1:] = [curve_view("Error budget: fractions of the variance", [entities.ERROR_BUDGET], y_range=_UNIT_RANGE,
                                entries=6)]  # fmt: skip
    return rrb.Vertical(
        lanes_view(),
        rrb.Horizontal(
            curve_view("Trust and similarity", [entities.TRUST, entities.SIMILARITY], y_range=_UNIT_RANGE, corner=_LOW),
            curve_view("log₁₀ residuals: cold start, warm start, reached", starts, y_range=_RESIDUALS),
        ),
        rrb.Horizontal(
            *below,
            flags_view(),
            column_shares=[1.0, *([1.6] if layout.budget else [0.8] * (len(below) - 1)), 1.4],
        ),
        row_shares=[1.0, 2.0, 1.8],
        name=Tab.SETTLING,
    )


def _statistics(layout: RecordingLayout) -> rrb.Container:
    density = drawn_view("P(f_n / mean f_n), logarithmic", "/statistics/force_density", *PLOT_BOUNDS)
    coordination = [entities.COORDINATION_NUMBER, entities.COORDINATION_NUMBER_WITHOUT_RATTLERS]
    strong = [entities.STRONG_FRACTION, entities.STRONG_PRESSURE_FRACTION, entities.STRONG_DEVIATOR_FRACTION]
    plots: list[tuple[str, list[str]]] = [
        ("Coordination number", coordination),
        ("Tail and plateau of P(f_n)", [entities.TAIL_EXPONENT, entities.PLATEAU_RATIO]),
        ("Sliding and mobilisation", [entities.SLIDING_FRACTION, entities.MOBILISATION]),
        ("Strong network, force chains", [*strong, entities.CHAIN_GRAIN_FRACTION]),
    ]
    below: list[rrb.View] = [curve_view(name, paths, layout.extremes, height=330.0) for name, paths in plots]
    if layout.radius_curve:
        below.insert(0, drawn_view("z over a change of all radii", "/statistics/radius_curve", *RADIUS_BOUNDS))
    return rrb.Vertical(
        rrb.Horizontal(
            density,
            polar_view("Principal stresses over the pressure", "/statistics/stress", STRESS_REACH),
            polar_view("Directions of contacts and forces", "/statistics/rose", ROSE_REACH),
            column_shares=[1.45, 1.0, 1.0],
        ),
        rrb.Horizontal(*below),
        row_shares=[1.0, 1.0],
        name=Tab.STATISTICS,
    )


def _loads(layout: RecordingLayout) -> rrb.Container:
    angles = [entities.FRICTION_ANGLE, entities.ANISOTROPY_ANGLE, entities.WALL_RATIO_ANGLE]
    anisotropies = [
        entities.CONTACT_ANISOTROPY, entities.BRANCH_ANISOTROPY, entities.NORMAL_FORCE_ANISOTROPY,
        entities.TANGENTIAL_FORCE_ANISOTROPY,
    ]  # fmt: skip
    stresses = [entities.SIGMA_1, entities.PRESSURE, entities.SIGMA_2]

    def plot(name: str, paths: list[str], entries: int | None = None) -> rrb.View:
        return curve_view(name, paths, layout.extremes, height=340.0, entries=entries)

    unit = unit_of("statistics/wall_force")
    normal, tangential = [entities.WALL_NORMAL_FORCE], [entities.WALL_TANGENTIAL_FORCE]
    entries = layout.wall_count
    if layout.wall_forces:
        normal, tangential = [*normal, entities.WALL_NORMAL_RECORDED], [*tangential, entities.WALL_TANGENTIAL_RECORDED]
        entries *= 2
    return rrb.Vertical(
        rrb.Horizontal(
            plot("Friction angle [°]", angles),
            plot("Principal stresses [kPa]", stresses),
            plot("Direction of σ₁ [°]", [entities.PRINCIPAL_DIRECTION]),
        ),
        rrb.Horizontal(
            plot("Anisotropies", anisotropies),
            plot(f"Forces on the walls, normal [{unit}]", normal, entries),
            plot(f"Forces on the walls, tangential [{unit}]", tangential, entries),
        ),
        name=Tab.LOADS,
    )


def _contacts(layout: RecordingLayout) -> rrb.Container:
    changes = [entities.GAPS, entities.NEW_CONTACTS, entities.LOST_CONTACTS, entities.VERDICTS]
    touching = [entities.WALLS, entities.GRAINS, entities.FORCES, entities.SLIDING]
    touching.append(f"{entities.COLOUR_LEGENDS}/{entities.TOUCHING_PROBABILITY}/**")
    counts = [entities.CONTACT_COUNT, entities.EXPECTED_COUNT]
    plots = [
        curve_view("Number of contacts", counts, layout.extremes, height=220.0),
        curve_view("Ambiguous contacts", [entities.AMBIGUOUS_COUNT]),
        curve_view("New and lost contacts", [entities.NEW_CONTACT_COUNT, entities.LOST_CONTACT_COUNT]),
    ]
    if layout.extremes and entities.EXPECTED_COUNT not in layout.extremes:
        del plots[1]  # the probabilities were not computed
    return rrb.Horizontal(
        packing_view("Gaps, changes, verdicts", layout.canvas, [*_PACKING, *changes, f"{entities.GAP_LEGEND}/**"]),
        packing_view(
            "Probability that they touch; points: sliding",
            layout.canvas,
            touching,
            contacts_by(entities.TOUCHING_PROBABILITY, radius=0.1 * layout.canvas.grain_radius),
        ),
        rrb.Vertical(*plots),
        column_shares=[1.0, 1.0, 0.8],
        name=Tab.CONTACTS,
    )


def _maps(layout: RecordingLayout) -> rrb.Container:
    """Return maps of the contacts, each coloured by another quantity; a selection applies to all."""
    thin = 0.13 * layout.canvas.grain_radius
    first = [entities.WALLS, entities.FORCES, *_PLAIN_LEGEND]
    views = [packing_view("Normal force f_n", layout.canvas, first)]
    for quantity, name, radius in (
        (entities.TANGENTIAL, "Tangential force f_t", None),
        (entities.CHANGE, "Change of f_n since the frame before", None),
        (entities.ERROR, "Standard deviation of f_n", None),
        (entities.SLIDING_PROBABILITY, "Probability that it slides", thin),
        (entities.BEARING_PROBABILITY, "Probability that it bears force", thin),
        (entities.TOUCHING_PROBABILITY, "Probability that it touches", thin),
        (entities.AGE, "Age: frames since it began", thin),
    ):
        contents = [entities.WALLS, entities.FORCES, f"{entities.COLOUR_LEGENDS}/{quantity}/**"]
        views.append(packing_view(name, layout.canvas, contents, contacts_by(quantity, radius=radius)))
    return rrb.Grid(*views, grid_columns=4, name=Tab.MAPS)


def _rods(layout: RecordingLayout) -> rrb.View:
    x, y, size = _middle(layout.canvas)
    eye = (x + 0.4 * size, y - 0.18 * size, 1.09 * size)
    return solid_view(Tab.RODS, "/rods", eye, (x, y, -0.3 * layout.rod_length))


def _film(layout: RecordingLayout) -> rrb.Container:
    return rrb.Horizontal(
        drawn_view("Strong forces of frames, the nearest framed", "/film/frames", *film_bounds(layout.canvas, COLUMNS)),
        drawn_view("Strong forces of this frame's sweeps", "/film/sweeps", *film_bounds(layout.canvas, SWEEP_COLUMNS)),
        column_shares=[COLUMNS, SWEEP_COLUMNS],
        name=Tab.FILM,
    )


def _middle(canvas: Canvas) -> tuple[float, float, float]:
    """Return the middle of the packing and its greater side [m]."""
    metre = canvas.scale.pixel_size * canvas.shrink
    across, down = 0.5 * (canvas.left + canvas.right), 0.5 * (canvas.top + canvas.bottom)
    x = (across - 0.5) * metre
    y = (canvas.scale.height - 1) * canvas.scale.pixel_size - (down - 0.5) * metre
    return x, y, metre * max(canvas.width, canvas.height)


def _truth(layout: RecordingLayout) -> rrb.Container:
    agreement = [entities.TRUTH_R_FN, entities.TRUTH_R_FT, entities.TRUTH_ERROR]
    return rrb.Vertical(
        rrb.Horizontal(
            packing_view("Inferred forces", layout.canvas, [*_PACKING, *_FORCES]),
            packing_view("True forces", layout.canvas, [*_PACKING, entities.TRUTH_FORCES, *_PLAIN_LEGEND]),
        ),
        rrb.Horizontal(
            drawn_view("f_n: inferred over true", "/truth/scatter", (-60.0, 425.0), (-15.0, 455.0)),
            curve_view("Agreement with the truth", agreement, y_range=(-0.45, 1.05), corner=_LOW),
        ),
        row_shares=[1.7, 1.0],
        name=Tab.TRUTH,
    )
