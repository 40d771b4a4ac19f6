"""The schema of a recording: every timeline, entity and component.

There are four timelines. `frame` counts photographs from 0; `time` [s] and `microstrain` are the time and the
accumulated strain at which they were taken. `sweep` counts Gauss-Seidel sweeps over the whole run: frame k occupies the
values first_sweep[k] … first_sweep[k+1] − 1, one value per sweep and a last one for the reported field (only that
one if a frame was not swept). Rows of a frame are on all timelines; on those of photographs the viewer shows the last
row of a frame, so that `frame` shows the reported forces and `sweep` the convergence of the solve.

`microstrain` is the accumulated strain of the packing, in millionths, which never decreases: the sum over the steps
between photographs of their shear, or of their greatest principal strain where that is greater. A monotonic shear test
is thus drawn over its shear, an oedometer test over its axial strain. Files without `frames/strain` lack this timeline.

The first row of a frame contains the geometry, the later ones only widths and colours. The sweeps are those of the
Gauss-Seidel chain, including its last; the row after it shows the reported field, which the estimator `ensemble`
computes from several chains and convex programmes: the forces may jump there. The values shown by a click (`fn`,
`ft`, …) are those of the reported field.

Lengths in the 2D views are pixels of the photograph as recorded (y down; a photograph above 4 megapixels
is recorded at half size), or nominal pixels of 1/30 mean radius without photographs. The 3D view is in metres.

The property `experiment` of a recording holds the input of the run (name, frames, grains, friction, pressure, …), the
property `outcome` its results, and `settings` the configuration as TOML: in a catalogue each is a column.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from . import entities


class When(Enum):
    """The rows in which an entity has data."""

    START = "first sweep of every frame, on all timelines"
    START_AND_SWEEPS = "first sweep of every frame, then width and colour at recorded sweeps, on all timelines"
    START_AND_END = "cleared at the first sweep of every frame, set at its last row, on all timelines"
    END = "last row of every frame, on all timelines"
    SWEEPS = "every sweep on `sweep`, the last one of every frame on the others"
    FOUND = "in frames with a warning, on all timelines"
    STATIC = "once, without a time"

    @property
    def timelines(self) -> frozenset[str]:
        """The timelines of these rows."""
        if self is When.STATIC:
            return frozenset()
        return frozenset({entities.FRAME, entities.SWEEP, entities.TIME, entities.STRAIN})


class Condition(Enum):
    """The recordings that have an entity."""

    ALWAYS = "always"
    PHOTOGRAPHS = "with photographs"
    SWEPT = "where frames were swept"
    TOLERANCE = "where a stopping level was given"
    TRUTH = "with a truth"
    RADII = "where radii were tuned by the coordination number"
    FLAGS = "where something was flagged"
    WALL_FORCES = "where wall forces were recorded"
    BUDGET = "where an error budget was requested"
    CELL = "of a periodic cell"
    KINEMATICS = "where the kinematics were measured"
    FRINGES = "with photoelastic photographs"


@dataclass(frozen=True, slots=True)
class Entity:
    """One entity of the recording."""

    path: str
    meaning: str
    components: frozenset[str]
    when: When
    condition: Condition = Condition.ALWAYS
    per_frame: bool = False  # one entity for each of some frames, whose number ends the path


def _of(archetype: str, *names: str) -> frozenset[str]:
    return frozenset(f"{archetype}:{name}" for name in names)


_STRIPS = _of("LineStrips2D", "strips", "radii", "colors", "draw_order")
_POINTS = _of("Points2D", "positions", "radii", "colors", "draw_order")
_TICKS = _of("Points2D", "positions", "radii", "colors", "labels", "show_labels")
_FILM = _STRIPS | _TICKS
_SCALAR = _of("Scalars", "scalars")
_LINE = _of("SeriesLines", "colors", "names", "widths")
_MARKED = _LINE | _of("SeriesPoints", "colors", "names", "markers", "marker_sizes")
_LANE = _of("StateChange", "state") | _of("StateConfiguration", "values", "labels", "colors")
_FORCE_VALUES = frozenset({"i", "j", "grain_a", "body_b", "fn", "ft"})
_CONTACT_VALUES = _FORCE_VALUES | {
    "gap_um", "fn_sd", "mobilisation", "state", "age", "probability", "sliding_probability", "bearing_probability",
}  # fmt: skip
_CONTACT_COLOURS = frozenset(f"{entities.coloured_by(name)}:colors" for name in entities.COLOURED_BY)
_GRAIN_VALUES = frozenset({"id", "x_mm", "y_mm", "theta_deg", "sigma_um", "zncc", "status", "unbalance"})


_KINEMATIC_MAPS = (
    (entities.LOCAL_SHEAR, "rods, colour by the local shear strain over the window"),
    (entities.D2MIN, "rods, colour by the rms departure of their neighbours from the local field"),
    (entities.LOCAL_ROTATION, "rods, colour by their rotation minus that of the local field"),
)


_FRINGE_MAPS = (
    (entities.BY_FRINGES, "discs, colour by the sum of the normal forces that their fringes show"),
    (entities.BY_FORCES, "discs, colour by the sum of the inferred normal forces"),
    (entities.FRINGE_RESIDUAL, "discs, colour by the sum by the fringes minus that of the forces"),
)


def _scalar(path: str, meaning: str, when: When = When.END, condition: Condition = Condition.ALWAYS) -> Entity:
    return Entity(path, meaning, _SCALAR | _LINE, when, condition)


def _marked(path: str, meaning: str) -> Entity:
    return Entity(path, meaning, _SCALAR | _MARKED, When.END)


def _with_band(path: str, meaning: str) -> tuple[Entity, Entity]:
    """A curve of a statistic and its band."""
    band = "two standard deviations below and above the curve"
    return _scalar(path, meaning), _scalar(path + entities.BAND, band)


def _with_ticks(path: str, meaning: str, values: str, condition: Condition = Condition.ALWAYS) -> tuple[Entity, Entity]:
    """A legend or axes, and the texts beside it."""
    texts = Entity(path + entities.TICKS, values, _TICKS, When.STATIC, condition)
    return Entity(path, meaning, _STRIPS, When.STATIC, condition), texts


def _maps(paths: str, legends: str, maps: tuple[tuple[str, str], ...], condition: Condition) -> Iterator[Entity]:
    """Yield maps of the grains with their legends."""
    for name, meaning in maps:
        yield Entity(f"{paths}/{name}", meaning, _POINTS, When.START, condition)
        yield from _with_ticks(f"{legends}/{name}", "its colours", "their values", condition)


SCHEMA: tuple[Entity, ...] = (
    Entity(
        entities.PHOTOGRAPH, "the photograph, JPEG, shown dimmed",
        _of("EncodedImage", "blob", "media_type", "opacity", "draw_order"), When.START, Condition.PHOTOGRAPHS,
    ),
    Entity(entities.WALLS, "walls, one strip each; loaded plates brighter", _STRIPS | {"name", "drive"}, When.START),
    Entity(entities.CELL, "edges of the periodic cell", _STRIPS, When.START, Condition.CELL),
    Entity(
        entities.GRAINS, "outline of every grain, instance = row; lost ones where they were last seen",
        _of("Ellipses2D", "centers", "half_sizes", "line_radii", "colors", "draw_order") | _GRAIN_VALUES, When.START,
    ),
    Entity(entities.GRAIN_SPINS, "mark at the rim that was at the top in frame 0", _STRIPS, When.START),
    Entity(entities.GRAINS_LOST, "cross over every grain without a pose", _STRIPS, When.START),
    Entity(
        entities.FORCES,
        "contacts, centre to centre (wall: centre to contact point); width and colour increase with f_n; further "
        "selectable colours by other quantities",
        _STRIPS | _CONTACT_VALUES | _CONTACT_COLOURS, When.START_AND_SWEEPS,
    ),
    Entity(
        entities.FORCES_ACROSS, "second halves of the contacts across the edge of a periodic cell, as reported",
        _STRIPS, When.START, Condition.CELL,
    ),
    Entity(entities.SLIDING, "contacts at the Coulomb limit", _POINTS, When.START_AND_END),
    Entity(
        entities.FORCE_UNCERTAINTY, "gaps in the lines of uncertain forces, as long as σ(f_n) / f_n of a period",
        _STRIPS | {"fn", "fn_sd"}, When.START_AND_END,
    ),
    Entity(entities.CAPTION, "frame, time, strain, status and trust", _TICKS, When.START_AND_END),
    Entity(entities.FRAME_CARD, "the same with reasons, as a document",
           _of("TextDocument", "text", "media_type"), When.START),
    Entity(entities.GAPS, "contact points, colour by gap", _POINTS | {"gap_um", "grain_a", "body_b"}, When.START),
    Entity(entities.NEW_CONTACTS, "contacts that the frame before did not have", _STRIPS, When.START),
    Entity(entities.LOST_CONTACTS, "contacts of the frame before that are gone, in two parts", _STRIPS, When.START),
    Entity(
        entities.VERDICTS, "contacts that a reviewer added, or forbade (in two parts)",
        _STRIPS | {"source", "grain_a", "body_b"},
        When.START,
    ),
    Entity(entities.SCALE_BAR, "a bar of a round length", _STRIPS, When.STATIC),
    Entity(entities.SCALE_BAR_LENGTH, "its length", _TICKS, When.STATIC),
    *_with_ticks(entities.FORCE_LEGEND, "width and colour of f_n", "its values [N]"),
    Entity(entities.FORCE_LEGEND_NOTES, "legend of points and rims", _TICKS, When.STATIC),
    *_with_ticks(entities.UNCERTAINTY_LEGEND, "legend of gaps", "its values"),
    Entity(entities.WALL_KEY, "names of the walls in the colours of their curves", _TICKS, When.STATIC),
    *_with_ticks(entities.GAP_LEGEND, "colour of the gap", "its values [µm]"),
    *(
        entity
        for name in entities.COLOURED_BY
        for entity in _with_ticks(f"{entities.COLOUR_LEGENDS}/{name}", f"colour by {name}", "its values")
    ),
    *_with_ticks(entities.MAP_LEGEND, "colour of force residual and change", "its values, over the mean f_n"),
    _scalar(entities.SWEEP_FORCE_CHANGE, "log10 of the greatest |Δf|/|f|", When.SWEEPS, Condition.SWEPT),
    _scalar(entities.SWEEP_NATURAL_MAP, "log10 of the natural-map residual", When.SWEEPS, Condition.SWEPT),
    _scalar(
        entities.SWEEP_UNBALANCE, "log10 of the worst force residual over the mean f_n", When.SWEEPS, Condition.SWEPT,
    ),
    _scalar(entities.TOLERANCE, "log10 of the stopping level", When.START, Condition.TOLERANCE),
    Entity(
        entities.RESIDUAL_CURVES, "residuals of the frame over its sweeps, both logarithmic, and those of a cold start",
        _STRIPS, When.START, Condition.SWEPT,
    ),
    Entity(
        entities.RESIDUAL_MARKS, "the recorded sweep on these curves", _POINTS, When.START_AND_SWEEPS, Condition.SWEPT,
    ),
    Entity(
        entities.RESIDUAL_REPORTED, "force residual of the reported field, beyond the last sweep",
        _POINTS | {"Points2D:labels", "Points2D:show_labels"}, When.END, Condition.SWEPT,
    ),
    *_with_ticks(entities.RESIDUAL_AXES, "axes and the stopping level", "their values", Condition.SWEPT),
    Entity(
        entities.UNBALANCE_MAP, "grains, colour by |ΣF| of the recorded forces over the mean f_n", _POINTS,
        When.START_AND_SWEEPS,
    ),
    Entity(
        entities.CHANGE_MAP,
        "contacts, colour by the change of a sweep over the mean f_n, on average since the recorded one before",
        _STRIPS, When.START_AND_SWEEPS,
    ),
    Entity(entities.STATUS_LANE, "status of the frame", _LANE, When.START),
    Entity(entities.TRACKING_LANE, "whether every grain has a pose", _LANE, When.START),
    _scalar(entities.TRUST, "T, lower bound of the correlation with the true forces, from the evidence of the frame"),
    _scalar(
        entities.ERROR_BUDGET, "fraction of each cause in the variance of the force error", When.END, Condition.BUDGET,
    ),
    _scalar(entities.SIMILARITY, "correlation of f_n with the frame before, common contacts"),
    _scalar(entities.CORRECTION, "ε, correction of the measured motion by the forces"),
    _scalar(entities.OLD_UNBALANCE, "ū, residual of the previous forces on this network"),
    _scalar(entities.START_DIFFERENCE, "H, remaining difference between two starts"),
    _scalar(entities.FRAMES_SINCE_RESET, "frames since the last reset"),
    _scalar(entities.WARM_RESIDUAL, "log10 of the natural-map residual after one sweep from the previous forces"),
    _scalar(entities.COLD_RESIDUAL, "log10 of the natural-map residual after one sweep from zero forces"),
    _scalar(entities.SAVED_SWEEPS, "sweeps from zero forces that equal one sweep from the previous forces"),
    _scalar(entities.SWEEP_COUNT, "sweeps of the frame"),
    _scalar(entities.FINAL_NATURAL_MAP, "log10 of the natural-map residual reached"),
    _scalar(entities.FINAL_UNBALANCE, "log10 of the worst force residual of a grain in the reported field"),
    _scalar(entities.NEW_CONTACT_COUNT, "contacts that the frame before did not have, in number"),
    _scalar(entities.LOST_CONTACT_COUNT, "contacts of the frame before that are gone, in number"),
    _scalar(entities.EXPECTED_COUNT, "expected number of contacts: the sum of P(touch)"),
    _scalar(entities.AMBIGUOUS_COUNT, "contacts with P(touch) < 1/2 that are kept"),
    Entity(
        entities.FLAGS, "warnings about a frame", _of("TextLog", "text", "level"), When.FOUND,
        Condition.FLAGS,
    ),
    *_with_band(entities.FRICTION_ANGLE, "asin((σ₁−σ₂)/(σ₁+σ₂)) [°]"),
    *_with_band(entities.WALL_RATIO_ANGLE, "atan(T/N) on the loaded plate [°]"),
    *_with_band(entities.PRINCIPAL_DIRECTION, "direction of σ₁ [°], counter-clockwise from x"),
    *_with_band(entities.PRESSURE, "half the trace of the stress [kPa]"),
    *_with_band(entities.COORDINATION_NUMBER, "contacts with force per grain"),
    *_with_band(entities.COORDINATION_NUMBER_WITHOUT_RATTLERS, "contacts with force per grain, without rattlers"),
    *_with_band(entities.RATTLER_COUNT, "grains without load"),
    *_with_band(entities.CONTACT_COUNT, "contacts with force"),
    *_with_band(entities.SLIDING_FRACTION, "fraction of contacts with force at the Coulomb limit"),
    *_with_band(entities.MEAN_FN, "mean f_n [N]"),
    *_with_band(entities.MAX_FN, "greatest f_n [N]"),
    *_with_band(entities.FABRIC_ANISOTROPY, "2 (F₁ − F₂) of the fabric tensor"),
    *_with_band(entities.SIGMA_1, "greatest principal stress [kPa]"),
    *_with_band(entities.SIGMA_2, "smallest principal stress [kPa]"),
    *_with_band(entities.ANISOTROPY_ANGLE, "friction angle from the anisotropies [°]"),
    *_with_band(entities.CONTACT_ANISOTROPY, "a_c, of contact directions"),
    *_with_band(entities.BRANCH_ANISOTROPY, "a_l, of branch lengths"),
    *_with_band(entities.NORMAL_FORCE_ANISOTROPY, "a_n, of normal forces"),
    *_with_band(entities.TANGENTIAL_FORCE_ANISOTROPY, "a_t, of tangential forces"),
    *_with_band(entities.MOBILISATION, "mean |f_t| / (μ f_n)"),
    *_with_band(entities.TAIL_EXPONENT, "β of the exponential tail of P(f_n) above the mean"),
    *_with_band(entities.PLATEAU_RATIO, "P(f_n) of the weakest forces over its plateau below the mean; 1: flat"),
    *_with_band(entities.STRONG_FRACTION, "fraction of the contacts with more than the mean f_n"),
    *_with_band(entities.STRONG_PRESSURE_FRACTION, "fraction of the pressure carried by strong contacts"),
    *_with_band(entities.STRONG_DEVIATOR_FRACTION, "fraction of the stress deviator carried by strong contacts"),
    *_with_band(entities.CHAIN_COUNT, "force chains"),
    *_with_band(entities.CHAIN_GRAIN_FRACTION, "fraction of the grains that belong to a force chain"),
    _marked(entities.WALL_NORMAL_FORCE, "force of the packing on every wall along its outward normal [N]"),
    _marked(entities.WALL_TANGENTIAL_FORCE, "force of the packing on every wall along it [N]"),
    _scalar(entities.WALL_NORMAL_RECORDED, "recorded normal force on every wall [N]", When.END, Condition.WALL_FORCES),
    _scalar(entities.WALL_TANGENTIAL_RECORDED, "recorded force along every wall [N]", When.END, Condition.WALL_FORCES),
    Entity(entities.FORCE_DENSITY, "density of f_n over its mean, this frame", _POINTS, When.END),
    Entity(entities.FORCE_DENSITY_TAIL, "exponential tail above the mean, this frame", _STRIPS, When.END),
    Entity(entities.FORCE_DENSITY_TAIL_VALUE, "its exponent", _TICKS, When.END),
    Entity(entities.FORCE_DENSITY_POOLED, "the same, all frames so far", _STRIPS, When.END),
    *_with_ticks(entities.FORCE_DENSITY_AXES, "axes", "their values"),
    Entity(entities.STRESS_CROSS, "principal stresses, length over the pressure", _STRIPS, When.END),
    Entity(entities.STRESS_VALUES, "their values [kPa]", _TICKS, When.END),
    Entity(entities.STRESS_CURVE, "normal stress over the pressure in every direction", _STRIPS, When.END),
    Entity(entities.STRESS_AXES, "circle of the pressure, axes", _STRIPS, When.STATIC),
    Entity(entities.ROSE, "directions of contacts with force, relative number", _STRIPS, When.END),
    Entity(entities.ROSE_OF_FORCES, "directions of contacts, weighted by f_n", _STRIPS, When.END),
    *_with_ticks(entities.ROSE_AXES, "circle of an isotropic packing, axes", "names of the curves"),
    Entity(entities.RADIUS_CURVE, "coordination number over a common change of all radii", _STRIPS, When.STATIC,
           Condition.RADII),
    Entity(entities.RADIUS_FOUND, "the change that was applied", _POINTS, When.STATIC, Condition.RADII),
    *_with_ticks(entities.RADIUS_AXES, "axes and the target coordination number", "their values", Condition.RADII),
    *_maps(entities.KINEMATIC_MAPS, entities.KINEMATIC_LEGENDS, _KINEMATIC_MAPS, Condition.KINEMATICS),
    Entity(
        entities.FLUCTUATIONS, "fluctuations about the mean field, another colour in a shear band",
        _of("Arrows2D", "origins", "vectors", "radii", "colors", "draw_order"), When.START, Condition.KINEMATICS,
    ),
    Entity(entities.FLUCTUATION_LEGEND, "enlargement and colours of the fluctuations", _TICKS, When.STATIC,
           Condition.KINEMATICS),
    _scalar(entities.PARTICIPATION, "participation ratio of the local shear", When.END, Condition.KINEMATICS),
    _scalar(entities.SOLID_FRACTION, "mean local solid fraction", When.END, Condition.KINEMATICS),
    *_maps(entities.FRINGE_MAPS, entities.FRINGE_LEGENDS, _FRINGE_MAPS, Condition.FRINGES),
    Entity(entities.FRINGES_OF_FRAME, "sum of the inferred normal forces on a disc over its G²", _POINTS, When.END,
           Condition.FRINGES),
    Entity(entities.FRINGES_OF_ALL, "the same of discs of all frames", _POINTS, When.STATIC, Condition.FRINGES),
    Entity(entities.FRINGE_CURVE, "the curve of the run", _STRIPS, When.STATIC, Condition.FRINGES),
    *_with_ticks(entities.FRINGE_AXES, "axes", "their values", Condition.FRINGES),
    _scalar(entities.FRINGE_CORRELATION, "correlation of the sums by fringes and by forces over the discs", When.END,
            Condition.FRINGES),
    Entity(
        entities.RODS, "rods as cylinders [m]",
        _of("Cylinders3D", "lengths", "radii", "centers", "colors", "fill_mode"), When.END,
    ),
    Entity(
        entities.ROD_CHAINS, "forces above the mean as capsules before the rods [m]",
        _of("Capsules3D", "lengths", "radii", "translations", "quaternions", "colors", "fill_mode"), When.END,
    ),
    Entity(
        entities.FILM_FRAMES, "strong forces of at most nine frames side by side, an entity each below this one",
        _FILM, When.STATIC, per_frame=True,
    ),
    Entity(
        entities.FILM_PLACE, "frame of the picture nearest to the time cursor",
        _of("LineStrips2D", "strips", "radii", "colors"), When.START,
    ),
    Entity(entities.FILM_KEY, "width and colour of f_n", _of("LineStrips2D", "strips", "radii", "colors"), When.STATIC),
    Entity(f"{entities.FILM_KEY}/ticks", "its values [N]", _TICKS, When.STATIC),
    Entity(
        entities.FILM_SWEEPS_KEY, "width and colour of f_n", _of("LineStrips2D", "strips", "radii", "colors"),
        When.STATIC,
    ),
    Entity(f"{entities.FILM_SWEEPS_KEY}/ticks", "its values [N]", _TICKS, When.STATIC),
    Entity(
        entities.ROD_CAPTION, "frame, time, strain, status and trust",
        _of("Points3D", "positions", "radii", "colors", "labels", "show_labels"), When.END,
    ),
    Entity(entities.FILM_SWEEPS, "strong forces of some sweeps side by side", _FILM, When.START),
    Entity(entities.TRUTH_FORCES, "true contact forces, same widths and colours", _STRIPS | _FORCE_VALUES, When.START,
           Condition.TRUTH),
    Entity(
        entities.TRUTH_DIFFERENCE, "inferred − true: width by the magnitude, colour by the sign",
        _STRIPS | {"i", "j", "grain_a", "body_b", "fn_first", "fn_second", "ft_first", "ft_second"}, When.END,
        Condition.TRUTH,
    ),
    *_with_ticks(entities.DIFFERENCE_LEGEND, "colour of the difference", "its values [N]", Condition.TRUTH),
    Entity(entities.TRUTH_SCATTER, "inferred over true f_n", _POINTS, When.END, Condition.TRUTH),
    *_with_ticks(entities.TRUTH_AXES, "axes and the line of equality", "their values [N]", Condition.TRUTH),
    _scalar(entities.TRUTH_R_FN, "correlation of f_n with the truth", When.END, Condition.TRUTH),
    _scalar(entities.TRUTH_R_FT, "correlation of f_t with the truth", When.END, Condition.TRUTH),
    _scalar(entities.TRUTH_ERROR, "relative L2 error of (f_n, f_t)", When.END, Condition.TRUTH),
    Entity(entities.SUMMARY, "settings, trust, legend", _of("TextDocument", "text", "media_type"), When.STATIC),
)  # fmt: skip
