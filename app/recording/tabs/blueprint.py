"""The blueprint: the tabs and their views."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

import rerun.blueprint as rrb

from ..curve_layers.radius_curve import RADIUS_BOUNDS
from ..curve_layers.stress_and_fabric import ROSE_REACH, STRESS_REACH
from ..look import entities
from ..look.axes import PLOT_BOUNDS
from ..look.canvas import Canvas
from ..packing_layers.film import COLUMNS, SWEEP_COLUMNS, film_bounds
from ..packing_layers.grain_maps.fringe_maps import FRINGE_BOUNDS
from .axis_ranges import Extremes
from .views import (
    contacts_by,
    curve_view,
    drawn_view,
    lanes_view,
    near_axis,
    packing_view,
    polar_view,
    solid_view,
    wall_force_views,
)


class Tab(StrEnum):
    """The tabs, in their order."""

    SUMMARY = "Summary"
    FORCES = "Forces"
    CONVERGENCE = "Convergence"
    CONTACTS = "Contacts"
    STATISTICS = "Statistics"
    KINEMATICS = "Kinematics"
    TRUTH = "Truth"
    FRINGES = "Fringes"  # behind the forces


BEHIND = {Tab.FRINGES: Tab.FORCES}  # tabs that share the place of another one


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
    kinematics: bool = False  # measured
    fringes: bool = False  # of photoelastic discs


_PACKING = [entities.WALLS, entities.CELL, f"{entities.GRAINS}/**"]
_LOW = rrb.Corner2D.LeftBottom
_FORCES = [
    entities.FORCE_UNCERTAINTY,
    entities.FORCES,
    entities.FORCES_ACROSS,
    entities.SLIDING,
    f"{entities.FORCE_LEGEND}/**",
]
# For views without edges, points and rims.
_PLAIN_LEGEND = [entities.FORCE_LEGEND, entities.FORCE_LEGEND + entities.TICKS]
_UNIT_RANGE = (-0.04, 1.05)  # of an axis for fractions and correlations
_RESIDUALS = (-6.4, 5.5)  # log10, with space for a legend above


def make_blueprint(layout: RecordingLayout, *, active: Tab | None = None, following: bool = False) -> rrb.Blueprint:
    """Make the blueprint.

    Parameters
    ----------
    layout : RecordingLayout
        The properties of the recording.
    active : Tab, optional
        The tab in front; with the Convergence tab the timeline is `sweep`. None: the summary, which is written at the
        end, and the forces of a run that is followed.
    following : bool
        The cursor stays at the newest frame.

    Raises
    ------
    ValueError
        If the recording has no such tab.
    """
    tabs: dict[Tab, rrb.Container] = {
        Tab.SUMMARY: _summary(layout),
        Tab.FORCES: _forces_and_fringes(layout, active) if layout.fringes else _forces(layout),
        Tab.CONVERGENCE: _convergence(layout),
        Tab.CONTACTS: _contacts(layout),
        Tab.STATISTICS: _statistics(layout),
    }
    if layout.kinematics:
        tabs[Tab.KINEMATICS] = _kinematics(layout)
    if layout.truth:
        tabs[Tab.TRUTH] = _truth(layout)
    if active is None:
        active = Tab.FORCES if following else Tab.SUMMARY
    if active not in tabs and not (active is Tab.FRINGES and layout.fringes):
        raise ValueError(f"there is no tab {active} in this recording")
    in_front = list(tabs).index(BEHIND.get(active, active))
    return rrb.Blueprint(
        rrb.Tabs(*tabs.values(), active_tab=in_front, name=entities.ROOT_CONTAINER),
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


def _summary(layout: RecordingLayout) -> rrb.Container:
    return rrb.Horizontal(
        rrb.TextDocumentView(origin=entities.SUMMARY, name="The run"),
        rrb.Vertical(
            drawn_view("Strong forces over the run; bright: nearest frame", "/film/frames",
                       *film_bounds(layout.canvas, COLUMNS)),
            lanes_view(),
            row_shares=[5.0, 1.0],
        ),
        column_shares=[1.0, 1.0],
        name=Tab.SUMMARY,
    )  # fmt: skip


def _forces(layout: RecordingLayout, name: str = Tab.FORCES) -> rrb.Container:
    photograph = [entities.PHOTOGRAPH] if layout.photographs else []
    angles = [entities.FRICTION_ANGLE, entities.WALL_RATIO_ANGLE]
    curves = rrb.Horizontal(
        curve_view("Trust and similarity", [entities.TRUST, entities.SIMILARITY], _UNIT_RANGE, corner=_LOW),
        curve_view("Friction angle [°]; thin: 95 %", angles, layout.extremes, height=240.0),
    )
    walls = wall_force_views(layout.extremes, layout.wall_count, recorded=layout.wall_forces)
    rows: list[rrb.View | rrb.Container] = [
        rrb.TextDocumentView(origin=entities.FRAME_CARD, name="This frame"), lanes_view(), curves, *walls,
    ]  # fmt: skip
    return rrb.Horizontal(
        rrb.Tabs(
            packing_view("Force network", layout.canvas, [*photograph, *_PACKING, *_FORCES]),
            _rods(layout),
            name="Network",
        ),
        rrb.Vertical(*rows, row_shares=[1.9, 1.0, 1.9, 2.0, 0.55][: len(rows)]),
        column_shares=[1.25, 1.0],
        name=name,
    )


def _forces_and_fringes(layout: RecordingLayout, active: Tab | None) -> rrb.Container:
    inside = _forces(layout, name="Forces and walls")
    return rrb.Tabs(inside, _fringes(layout), active_tab=int(active is Tab.FRINGES), name=Tab.FORCES)


def _fringes(layout: RecordingLayout) -> rrb.Container:
    """Return maps of the discs by their fringes and by the forces, and how both agree."""
    views = [
        packing_view(name, layout.canvas, [entities.WALLS, f"{entities.FRINGE_MAPS}/{quantity}",
                                           f"{entities.FRINGE_LEGENDS}/{quantity}/**"])
        for quantity, name in (
            (entities.BY_FRINGES, "Σ f_n on a disc by its fringes"),
            (entities.BY_FORCES, "Σ f_n on a disc by the forces"),
            (entities.FRINGE_RESIDUAL, "Fringes − forces"),
        )
    ]  # fmt: skip
    return rrb.Vertical(
        rrb.Horizontal(*views),
        rrb.Horizontal(
            drawn_view("Forces on a disc over its fringes", "/fringes/plot", *FRINGE_BOUNDS),
            curve_view("Correlation of fringes and forces", [entities.FRINGE_CORRELATION, entities.TRUST],
                       _UNIT_RANGE, corner=_LOW),
        ),
        row_shares=[2.0, 1.0],
        name=Tab.FRINGES,
    )  # fmt: skip


def _convergence(layout: RecordingLayout) -> rrb.Container:
    maps = [entities.WALLS, entities.UNBALANCE_MAP, entities.CHANGE_MAP, f"{entities.MAP_LEGEND}/**"]
    residuals = [entities.SWEEP_NATURAL_MAP, entities.SWEEP_UNBALANCE, entities.SWEEP_FORCE_CHANGE]
    starts = [entities.COLD_RESIDUAL, entities.WARM_RESIDUAL, entities.FINAL_NATURAL_MAP, entities.FINAL_UNBALANCE]
    indicators = [entities.CORRECTION, entities.OLD_UNBALANCE, entities.START_DIFFERENCE]
    low, high = layout.extremes.get(entities.SWEEP_COUNT, (0.0, 1.0))
    plots: list[rrb.View] = [
        curve_view("log₁₀ residuals of sweeps, or reported", [*residuals, entities.TOLERANCE], (-6.4, 4.4),
                   axis=near_axis()),
        curve_view("log₁₀ residuals: starts and reported field", starts, _RESIDUALS),
        curve_view("Settling: ε, ū and H", indicators, layout.extremes, height=230.0),
        curve_view("Sweeps saved by a warm start", [entities.SAVED_SWEEPS]),
    ]  # fmt: skip
    if layout.budget:
        plots[3] = curve_view("Fractions of the error's variance", [entities.ERROR_BUDGET], _UNIT_RANGE,
                              entries=6)  # fmt: skip
    elif high > low:  # no curve for a constant number
        plots.append(curve_view("Sweeps per frame", [entities.SWEEP_COUNT], layout.extremes))
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.Tabs(
                packing_view("Network as it forms", layout.canvas, [*_PACKING, *_FORCES]),
                drawn_view("Its sweeps side by side", "/film/sweeps", *film_bounds(layout.canvas, SWEEP_COLUMNS)),
                name="Sweeps",
            ),
            packing_view("Force residuals and change per sweep", layout.canvas, maps),
            drawn_view("Residuals of this frame over its sweeps", "/solve/plot", *PLOT_BOUNDS),
            column_shares=[1.0, 1.0, 1.1],
        ),
        rrb.Horizontal(*plots),
        row_shares=[1.9, 1.0],
        name=Tab.CONVERGENCE,
    )


def _contacts(layout: RecordingLayout) -> rrb.Container:
    """Return maps of the contacts, each coloured by another quantity, and their numbers; a selection applies to all."""
    changes = [entities.GAPS, entities.NEW_CONTACTS, entities.LOST_CONTACTS, entities.VERDICTS]
    thin = 0.13 * layout.canvas.grain_radius
    views = [packing_view("Gaps, changes, verdicts", layout.canvas, [*_PACKING, *changes, f"{entities.GAP_LEGEND}/**"])]
    for quantity, name, radius in (
        (entities.TOUCHING_PROBABILITY, "Probability that it touches", thin),
        (entities.BEARING_PROBABILITY, "Probability that it bears force", thin),
        (entities.SLIDING_PROBABILITY, "Probability that it slides", thin),
        (entities.TANGENTIAL, "Tangential force f_t", None),
        (entities.CHANGE, "Change of f_n in a frame", None),
        (entities.ERROR, "Standard deviation of f_n", None),
        (entities.AGE, "Age: frames since it began", thin),
    ):
        contents = [entities.WALLS, entities.FORCES, f"{entities.COLOUR_LEGENDS}/{quantity}/**"]
        views.append(packing_view(name, layout.canvas, contents, contacts_by(quantity, radius=radius)))
    counts = [entities.CONTACT_COUNT, entities.EXPECTED_COUNT]
    plots = [
        curve_view("Number of contacts", counts, layout.extremes, height=260.0),
        curve_view("Ambiguous contacts", [entities.AMBIGUOUS_COUNT]),
        curve_view("New and lost contacts", [entities.NEW_CONTACT_COUNT, entities.LOST_CONTACT_COUNT]),
    ]
    if layout.extremes and entities.EXPECTED_COUNT not in layout.extremes:
        del plots[1]  # the probabilities were not computed
    return rrb.Horizontal(
        rrb.Grid(*views, grid_columns=4), rrb.Vertical(*plots), column_shares=[4.0, 1.0], name=Tab.CONTACTS
    )


def _statistics(layout: RecordingLayout) -> rrb.Container:
    strong = [entities.STRONG_FRACTION, entities.STRONG_PRESSURE_FRACTION, entities.STRONG_DEVIATOR_FRACTION]
    angles = [entities.FRICTION_ANGLE, entities.ANISOTROPY_ANGLE]
    anisotropies = [
        entities.CONTACT_ANISOTROPY, entities.BRANCH_ANISOTROPY, entities.NORMAL_FORCE_ANISOTROPY,
        entities.TANGENTIAL_FORCE_ANISOTROPY,
    ]  # fmt: skip
    packing: list[tuple[str, list[str]]] = [
        ("Coordination number",
         [entities.COORDINATION_NUMBER, entities.COORDINATION_NUMBER_WITHOUT_RATTLERS]),
        ("Tail and plateau of P(f_n)", [entities.TAIL_EXPONENT, entities.PLATEAU_RATIO]),
        ("Sliding and mobilisation", [entities.SLIDING_FRACTION, entities.MOBILISATION]),
        ("Strong network, force chains", [*strong, entities.CHAIN_GRAIN_FRACTION]),
    ]  # fmt: skip
    stresses: list[tuple[str, list[str]]] = [
        ("Principal stresses [kPa]", [entities.SIGMA_1, entities.PRESSURE, entities.SIGMA_2]),
        ("Direction of σ₁ [°]", [entities.PRINCIPAL_DIRECTION]),
        ("Friction angle [°]", angles),
        ("Anisotropies", anisotropies),
    ]
    drawn = [
        drawn_view("P(f_n / mean f_n), logarithmic", "/statistics/force_density", *PLOT_BOUNDS),
        polar_view("Principal stresses over the pressure", "/statistics/stress", STRESS_REACH),
        polar_view("Directions of contacts and forces", "/statistics/rose", ROSE_REACH),
    ]
    if layout.radius_curve:
        drawn.insert(1, drawn_view("z over a change of all radii", "/statistics/radius_curve", *RADIUS_BOUNDS))

    def row(plots: list[tuple[str, list[str]]]) -> rrb.Container:
        return rrb.Horizontal(
            *(curve_view(f"{name}; thin: 95 %", paths, layout.extremes, height=250.0) for name, paths in plots)
        )

    shares = [1.45, *[1.0] * (len(drawn) - 1)]
    return rrb.Vertical(
        rrb.Horizontal(*drawn, column_shares=shares), row(packing), row(stresses), row_shares=[1.3, 1.0, 1.0],
        name=Tab.STATISTICS,
    )  # fmt: skip


def _kinematics(layout: RecordingLayout) -> rrb.Container:
    """Return maps of the motion beyond the mean field."""
    fluctuations = [*_PACKING, entities.FLUCTUATIONS, entities.FLUCTUATION_LEGEND]
    views = [packing_view("Fluctuations about the mean field", layout.canvas, fluctuations)]
    for quantity, name in (
        (entities.LOCAL_SHEAR, "Local shear strain"),
        (entities.D2MIN, "√D²min about the local field"),
        (entities.LOCAL_ROTATION, "Rotation − local field"),
    ):
        drawn = f"{entities.KINEMATIC_MAPS}/{quantity}"
        legend = f"{entities.KINEMATIC_LEGENDS}/{quantity}/**"
        views.append(packing_view(name, layout.canvas, [entities.WALLS, drawn, legend]))
    return rrb.Vertical(
        rrb.Horizontal(*views),
        rrb.Horizontal(
            lanes_view(),
            curve_view("Participation of the local shear; 1: homogeneous", [entities.PARTICIPATION], _UNIT_RANGE),
            curve_view("Mean local solid fraction", [entities.SOLID_FRACTION]),
        ),
        row_shares=[2.4, 1.0],
        name=Tab.KINEMATICS,
    )  # fmt: skip


def _rods(layout: RecordingLayout) -> rrb.View:
    x, y, size = _middle(layout.canvas)
    eye = (x + 0.4 * size, y - 0.18 * size, 1.09 * size)
    return solid_view("Rods in space", "/rods", eye, (x, y, -0.3 * layout.rod_length))


def _middle(canvas: Canvas) -> tuple[float, float, float]:
    """Return the middle of the packing and its greater side [m]."""
    metre = canvas.scale.pixel_size * canvas.shrink
    across, down = 0.5 * (canvas.left + canvas.right), 0.5 * (canvas.top + canvas.bottom)
    x = (across - 0.5) * metre
    y = (canvas.scale.height - 1) * canvas.scale.pixel_size - (down - 0.5) * metre
    return x, y, metre * max(canvas.width, canvas.height)


def _truth(layout: RecordingLayout) -> rrb.Container:
    agreement = [entities.TRUTH_R_FN, entities.TRUTH_R_FT, entities.TRUTH_ERROR, entities.TRUST]
    difference = [*_PACKING, entities.TRUTH_DIFFERENCE, f"{entities.DIFFERENCE_LEGEND}/**"]
    return rrb.Vertical(
        rrb.Horizontal(
            packing_view("Inferred forces", layout.canvas, [*_PACKING, *_FORCES]),
            packing_view("Inferred − true", layout.canvas, difference),
            packing_view("True forces", layout.canvas, [*_PACKING, entities.TRUTH_FORCES, *_PLAIN_LEGEND]),
        ),
        rrb.Horizontal(
            drawn_view("f_n: inferred over true", "/truth/scatter", (-60.0, 425.0), (-15.0, 455.0)),
            curve_view("Agreement with the truth, and trust", agreement, (-0.5, 1.05), corner=_LOW, entries=4),
            column_shares=[1.0, 1.6],
        ),
        row_shares=[1.8, 1.0],
        name=Tab.TRUTH,
    )
