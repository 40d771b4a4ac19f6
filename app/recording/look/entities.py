"""Names of the timelines and entities of a recording; `written_schema` states the content of each."""

from __future__ import annotations

APPLICATION_ID = "rodsight"
ROOT_CONTAINER = "Rodsight"  # of the tabs

FRAME = "frame"
SWEEP = "sweep"
TIME = "time"  # a duration
STRAIN = "microstrain"

PHOTOGRAPH = "/photograph"
WALLS = "/walls"
CELL = "/walls/cell"
GRAINS = "/grains"
GRAIN_SPINS = "/grains/spin"
GRAINS_LOST = "/grains/lost"
FORCES = "/contacts/force"
FORCES_ACROSS = "/contacts/force/across"
SLIDING = "/contacts/sliding"
FORCE_UNCERTAINTY = "/contacts/uncertainty"
GAPS = "/contacts/gap"
NEW_CONTACTS = "/contacts/new"
LOST_CONTACTS = "/contacts/lost"
VERDICTS = "/contacts/verdict"
CAPTION = "/caption"
FRAME_CARD = "/card"
FORCE_LEGEND = "/legend/force"
SCALE_BAR = "/legend/scale"
SCALE_BAR_LENGTH = "/legend/scale/length"
FORCE_LEGEND_TICKS = "/legend/force/ticks"
FORCE_LEGEND_NOTES = "/legend/force/notes"
UNCERTAINTY_LEGEND = "/legend/force/gaps"
UNCERTAINTY_LEGEND_TICKS = "/legend/force/gaps/ticks"
GAP_LEGEND = "/legend/gap"
GAP_LEGEND_TICKS = "/legend/gap/ticks"
COLOUR_LEGENDS = "/legend/by"  # followed by the quantity
MAP_LEGEND = "/legend/unconverged"
MAP_LEGEND_TICKS = "/legend/unconverged/ticks"

SWEEP_FORCE_CHANGE = "/solve/force_change"
SWEEP_NATURAL_MAP = "/solve/natural_map"
SWEEP_UNBALANCE = "/solve/unbalance"
TOLERANCE = "/solve/tolerance"
RESIDUAL_CURVES = "/solve/plot/curves"
RESIDUAL_MARKS = "/solve/plot/marks"
RESIDUAL_REPORTED = "/solve/plot/reported"
RESIDUAL_AXES = "/solve/plot/axes"
RESIDUAL_TICKS = "/solve/plot/axes/ticks"
UNBALANCE_MAP = "/solve/map/unbalance"
CHANGE_MAP = "/solve/map/change"

STATUS_LANE = "/frames/status"
TRACKING_LANE = "/frames/tracking"
TRUST = "/frames/trust"
ERROR_BUDGET = "/frames/error_budget"
SIMILARITY = "/frames/similarity"
CORRECTION = "/frames/correction"
OLD_UNBALANCE = "/frames/old_unbalance"
START_DIFFERENCE = "/frames/start_difference"
FRAMES_SINCE_RESET = "/frames/frames_since_reset"
WARM_RESIDUAL = "/frames/residual/warm"
COLD_RESIDUAL = "/frames/residual/cold"
SAVED_SWEEPS = "/frames/sweeps_saved"
SWEEP_COUNT = "/frames/sweeps"
FINAL_NATURAL_MAP = "/frames/natural_map"
FINAL_UNBALANCE = "/frames/unbalance"
NEW_CONTACT_COUNT = "/frames/contacts_new"
LOST_CONTACT_COUNT = "/frames/contacts_lost"
EXPECTED_COUNT = "/frames/contacts_expected"
AMBIGUOUS_COUNT = "/frames/contacts_ambiguous"
FLAGS = "/flags"

FRICTION_ANGLE = "/statistics/friction_angle"
WALL_RATIO_ANGLE = "/statistics/wall_ratio_angle"
PRINCIPAL_DIRECTION = "/statistics/principal_direction"
PRESSURE = "/statistics/pressure"
COORDINATION_NUMBER = "/statistics/coordination_number"
COORDINATION_NUMBER_WITHOUT_RATTLERS = "/statistics/coordination_number_without_rattlers"
RATTLER_COUNT = "/statistics/rattler_count"
CONTACT_COUNT = "/statistics/contact_count"
SLIDING_FRACTION = "/statistics/sliding_fraction"
MEAN_FN = "/statistics/mean_fn"
MAX_FN = "/statistics/max_fn"
FABRIC_ANISOTROPY = "/statistics/fabric_anisotropy"
SIGMA_1 = "/statistics/sigma_1"
SIGMA_2 = "/statistics/sigma_2"
ANISOTROPY_ANGLE = "/statistics/friction_angle_of_anisotropies"
CONTACT_ANISOTROPY = "/statistics/contact_anisotropy"
BRANCH_ANISOTROPY = "/statistics/branch_anisotropy"
NORMAL_FORCE_ANISOTROPY = "/statistics/normal_force_anisotropy"
TANGENTIAL_FORCE_ANISOTROPY = "/statistics/tangential_force_anisotropy"
MOBILISATION = "/statistics/mobilisation"
TAIL_EXPONENT = "/statistics/tail_exponent"
PLATEAU_RATIO = "/statistics/plateau_ratio"
STRONG_FRACTION = "/statistics/strong_fraction"
STRONG_PRESSURE_FRACTION = "/statistics/strong_pressure_fraction"
STRONG_DEVIATOR_FRACTION = "/statistics/strong_deviator_fraction"
CHAIN_COUNT = "/statistics/chain_count"
CHAIN_GRAIN_FRACTION = "/statistics/chain_grain_fraction"
WALL_KEY = "/legend/walls"
WALL_NORMAL_FORCE = "/statistics/wall_normal_force"
WALL_TANGENTIAL_FORCE = "/statistics/wall_tangential_force"
WALL_NORMAL_RECORDED = "/statistics/wall_normal_force/recorded"
WALL_TANGENTIAL_RECORDED = "/statistics/wall_tangential_force/recorded"
BAND = "/band"  # child of a curve: two standard deviations to either side
FORCE_DENSITY = "/statistics/force_density/frame"
FORCE_DENSITY_TAIL = "/statistics/force_density/tail"
FORCE_DENSITY_TAIL_VALUE = "/statistics/force_density/tail/value"
FORCE_DENSITY_POOLED = "/statistics/force_density/pooled"
FORCE_DENSITY_AXES = "/statistics/force_density/axes"
FORCE_DENSITY_TICKS = "/statistics/force_density/axes/ticks"
STRESS_CROSS = "/statistics/stress/cross"
STRESS_VALUES = "/statistics/stress/values"
STRESS_CURVE = "/statistics/stress/curve"
STRESS_AXES = "/statistics/stress/axes"
ROSE = "/statistics/rose/contacts"
ROSE_OF_FORCES = "/statistics/rose/forces"
ROSE_AXES = "/statistics/rose/axes"
ROSE_TICKS = "/statistics/rose/axes/ticks"
RADIUS_CURVE = "/statistics/radius_curve/curve"
RADIUS_FOUND = "/statistics/radius_curve/found"
RADIUS_AXES = "/statistics/radius_curve/axes"
RADIUS_TICKS = "/statistics/radius_curve/axes/ticks"

LOCAL_SHEAR, D2MIN, LOCAL_ROTATION = "shear_strain", "d2min", "rotation"  # maps of the kinematics
KINEMATIC_MAPS = "/kinematics/map"
KINEMATIC_LEGENDS = "/legend/kinematics"
FLUCTUATIONS = "/kinematics/fluctuation"
PARTICIPATION = "/kinematics/participation"
SOLID_FRACTION = "/kinematics/solid_fraction"

BY_FRINGES, BY_FORCES, FRINGE_RESIDUAL = "measured", "inferred", "residual"  # maps of photoelastic discs
FRINGE_MAPS = "/fringes/map"
FRINGE_LEGENDS = "/legend/fringes"
FRINGE_CORRELATION = "/fringes/correlation"
FRINGES_OF_FRAME = "/fringes/plot/frame"
FRINGES_OF_ALL = "/fringes/plot/all"
FRINGE_CURVE = "/fringes/plot/curve"
FRINGE_AXES = "/fringes/plot/axes"
FRINGE_TICKS = "/fringes/plot/axes/ticks"

RODS = "/rods/bodies"
ROD_CHAINS = "/rods/chains"
ROD_CAPTION = "/rods/caption"
FILM_FRAMES = "/film/frames/picture"  # followed by the number of the frame
FILM_KEY = "/film/frames/legend"
FILM_SWEEPS_KEY = "/film/sweeps/legend"
FILM_PLACE = "/film/frames/place"
FILM_SWEEPS = "/film/sweeps/pictures"

TRUTH_FORCES = "/truth/force"
TRUTH_DIFFERENCE = "/truth/difference"
DIFFERENCE_LEGEND = "/legend/difference"
DIFFERENCE_TICKS = "/legend/difference/ticks"
TRUTH_SCATTER = "/truth/scatter/contacts"
TRUTH_AXES = "/truth/scatter/axes"
TRUTH_TICKS = "/truth/scatter/axes/ticks"
TRUTH_R_FN = "/truth/r_fn"
TRUTH_R_FT = "/truth/r_ft"
TRUTH_ERROR = "/truth/relative_l2"

SUMMARY = "/summary"

# Quantities by which contacts may be coloured, beside f_n; the colours by each are a component of FORCES.
COLOURED_BY = TANGENTIAL, SLIDING_PROBABILITY, BEARING_PROBABILITY, TOUCHING_PROBABILITY, AGE, CHANGE, ERROR = (
    "ft", "sliding", "bearing", "touching", "age", "change", "error",
)  # fmt: skip


def coloured_by(name: str) -> str:
    """Return the archetype of the colours by a quantity of COLOURED_BY; its component is `colors`."""
    return f"by_{name}"


# Curves of statistics, each with a band.
BANDED = (
    FRICTION_ANGLE, WALL_RATIO_ANGLE, PRINCIPAL_DIRECTION, PRESSURE, COORDINATION_NUMBER,
    COORDINATION_NUMBER_WITHOUT_RATTLERS, RATTLER_COUNT, CONTACT_COUNT, SLIDING_FRACTION, MEAN_FN, MAX_FN,
    FABRIC_ANISOTROPY, SIGMA_1, SIGMA_2, ANISOTROPY_ANGLE, CONTACT_ANISOTROPY, BRANCH_ANISOTROPY,
    NORMAL_FORCE_ANISOTROPY, TANGENTIAL_FORCE_ANISOTROPY, MOBILISATION, TAIL_EXPONENT, PLATEAU_RATIO, STRONG_FRACTION,
    STRONG_PRESSURE_FRACTION, STRONG_DEVIATOR_FRACTION, CHAIN_COUNT, CHAIN_GRAIN_FRACTION,
)  # fmt: skip
