"""The scenarios: how the truth of each is simulated, and how its experiment folder departs from it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...solver.bodies.grains import Array
from ...solver.bodies.rods import EARTH_GRAVITY
from ...solver.dem.dem_truth import DemSettings
from ..dense_packing import choose_two_radii, choose_wide_radii
from .bed_paths import compress_in_membrane, press_footing, push_intruder, slide_box, turn_drum
from .departures import (
    HIGH_FRICTION,
    LOW_FRICTION,
    Departure,
    crop_to_interior,
    displace_centres,
    in_turn,
    keep_ten_frames,
    keep_unchanged,
    misstate_friction,
    misstate_wall_ends,
    move_camera,
    omit_loads,
    omit_rods,
    scatter_radii,
    shrink_radii,
    state_corners,
    state_membrane,
    state_photoelastic_discs,
    state_pins,
)
from .input_errors import (
    add_outliers,
    confuse_classes,
    correlate_noise,
    delay_left,
    delay_walls,
    displace_one_pose,
    distort_picture,
    drop_rotation,
    duplicate_frame,
    exchange_ids,
    extend_bars,
    fix_top,
    lose_poses,
    misstate_class,
    misstate_some,
    reverse_time,
    scale_rotation,
    scatter_walls,
    shift_side_inwards,
    shuffle_frames,
    state_walls_rough,
    stretch_picture,
    swap_frames,
)
from .loading_paths import (
    LoadingPath,
    compress_biaxially,
    load_isotropically,
    push_core,
    push_heap,
    shear,
    shear_cyclically,
    shear_purely,
    shear_under_loads,
    step_loads,
    tilt_heap,
    turn_core,
)
from .preset_names import FringedPreset, Group, ScenarioName
from .scenario import Scenario

DISC_NOISE = 1.18e-4  # [m], 0.7 % of a mean diameter of the two sizes


SHEAR = LoadingPath(shear, 0.25, plates=("top",))
SOFT = LoadingPath(shear, 0.25, plates=("top",), settings=DemSettings(normal_stiffness=1.6e6))
STIFF = DemSettings(normal_stiffness=2e8)
RISING = LoadingPath(load_isotropically, 0.0, measured=("top", "right"), settings=STIFF)
SOFTER = replace(SOFT, settings=DemSettings(normal_stiffness=3e5))
HEAP = DemSettings(pressure=float("nan"), gravity=(0.0, -EARTH_GRAVITY), normal_stiffness=2e6)
DISCS = DemSettings(normal_stiffness=4e5, friction=0.3, wall_friction=0.3, base_drag=10.0)
# Stiff discs, whose overlaps are smaller than the errors of tracked rims, loaded without sliding.
FRINGED = LoadingPath(load_isotropically, 0.0, settings=DemSettings(friction=0.3), sizes=choose_two_radii)
FRINGED_LOADINGS: dict[FringedPreset, LoadingPath] = {
    "fringes": FRINGED,
    "stiff_fringes": replace(FRINGED, settings=DemSettings(friction=0.3, normal_stiffness=2e8)),  # as the stiff rods
}


MOVED = LoadingPath(shear, 0.25, initial_shear=2.0, plates=("top",))  # the first photograph is like the others
BIAXIAL = LoadingPath(compress_biaxially, 0.003, plates=("right",), sizes=choose_wide_radii)
PUSHED_HEAP = LoadingPath(push_heap, 0.002, settings=HEAP, open_top=True)
# Loadings by which hardly any contact slides.
ISOTROPIC = LoadingPath(load_isotropically, 0.0)
STEPPED = LoadingPath(step_loads, 0.0, measured=("top", "right"))
TURNED = LoadingPath(turn_core, 0.02, plates=("ring",), ring=True)
TILTED = LoadingPath(tilt_heap, 1.0, settings=HEAP, open_top=True)
TINY = LoadingPath(shear_cyclically, 0.01, initial_shear=2.0, plates=("top",))


def _cropped(
    meaning: str, loading: LoadingPath, departure: Departure = keep_unchanged, noise: float = 1e-5,
    group: Group = "correct",
) -> Scenario:  # fmt: skip
    both = in_turn(departure, crop_to_interior)
    return Scenario(f"{meaning}; cropped as in `outer`", loading, both, noise, scale_stated=False, group=group)


def _sheared(**changes: Any) -> LoadingPath:
    """Simple shear after 2° of it, with other settings of the simulation."""
    return replace(MOVED, settings=DemSettings(**changes))


MOVING = _sheared(moving=True, unbalance_limit=10.0)


def _choose_ten(count: int, rng: np.random.Generator) -> Array:
    """Draw radii (n,) [m] between 3 and 30 mm, with equal area per size."""
    return 1.0 / rng.uniform(1.0 / 0.03, 1.0 / 0.003, count)


def _choose_by_power_law(count: int, rng: np.random.Generator) -> Array:
    """Draw radii (n,) [m] between 4 and 24 mm, their number falling with the power 2.5 of the radius."""
    low, high = 0.004**-1.5, 0.024**-1.5
    return rng.uniform(high, low, count) ** (-1.0 / 1.5)


def _missing(
    meaning: str, loading: LoadingPath, departure: Departure = keep_unchanged, noise: float = 1e-5
) -> Scenario:
    return Scenario(meaning, loading, departure, noise, group="missing physics")


def _wrong(meaning: str, departure: Departure, loading: LoadingPath = MOVED) -> Scenario:
    meaning = f"sheared; {meaning}" if loading is MOVED else meaning
    return Scenario(meaning, loading, departure, group="wrong input")


SCENARIOS: dict[ScenarioName, Scenario] = {
    "shear": Scenario("simple shear under a plate, .25° a photograph, 10 µm noise, no other error", SHEAR),
    "sheared": Scenario(
        "the same after 3° of shear, its friction mobilised, so that the first photograph is like the others",
        LoadingPath(shear, 0.25, initial_shear=3.0, plates=("top",)),
    ),
    "biaxial": Scenario(
        "biaxial compression of radii 1:5, .3 % a photograph, the right side under constant pressure",
        BIAXIAL,
    ),
    "isotropic": Scenario(
        "loaded and unloaded from two sides between 1 and 3 times 50 kPa; no pressure is stated",
        ISOTROPIC,
    ),
    "rising_loads": Scenario(
        "loaded and unloaded from two sides between 1 and 3 times 50 kPa, both loads measured; contacts ten times as "
        "stiff, so that almost nothing slides",
        RISING,
    ),
    "stepped_loads": Scenario(
        "the load on the plate rises by 5 % a photograph, that on the right side doubles once; both are measured",
        STEPPED,
    ),
    "rising_corners": Scenario("the same; walls end where the bars meet", RISING, state_corners),
    "gravity": Scenario(
        "a heap with a free surface, pushed by its right wall; no plate",
        PUSHED_HEAP,
    ),
    "soft": Scenario(
        "simple shear of soft rods that overlap by about .25 % of a diameter",
        SOFT,
    ),
    "soft_radii_03": Scenario("soft; radii with .3 % random error, as large as the overlaps", SOFT,
                           scatter_radii(0.003)),
    "soft_radii_1": Scenario("soft; radii with 1 % random error, thrice the overlaps", SOFT, scatter_radii(0.01)),
    "soft_noise": Scenario("soft; 80 µm noise, twice the overlaps", SOFT, noise=8e-5),
    "softer_noise": Scenario("very soft; 200 µm noise, as large as the overlaps", SOFTER, noise=2e-4),
    "soft_stretched": Scenario("soft; x stretched by .3 %", SOFT, stretch_picture(0.003), group="wrong input"),
    "softer_stretched": Scenario("very soft; x stretched by 1 %", SOFTER, stretch_picture(0.01), group="wrong input"),
    "soft_unseen": Scenario("soft; 3 % of the rods are in no photograph", SOFT, omit_rods),
    "softer": Scenario(
        "simple shear of very soft rods that overlap by about 1.1 % of a diameter",
        SOFTER,
    ),
    "nearly_jammed": Scenario(
        "two sizes of soft discs on a base with friction, pure shear of .3 % a photograph; no rotations, no pressure, "
        "radii 3 % too small, noise .7 % of a diameter",
        LoadingPath(shear_purely, 0.003, settings=DISCS, sizes=choose_two_radii, loose=True),
        state_photoelastic_discs,
        DISC_NOISE,
    ),
    "corners": Scenario("shear; walls end where the bars meet", SHEAR, state_corners),
    "short_walls": Scenario("shear; the side walls are stated 13 % too short", SHEAR, misstate_wall_ends),
    "unseen": Scenario("shear; 3 % of the rods are in no photograph", SHEAR, omit_rods),
    "biaxial_unseen": Scenario("biaxial; 3 % of the rods, of unknown size, are in no photograph", BIAXIAL, omit_rods),
    "camera": Scenario("shear; every photograph is shifted by up to 60 µm relative to the walls", SHEAR, move_camera),
    "centres": Scenario("shear; centres with 50 µm error fixed in the rod, precision stated so", SHEAR,
                     displace_centres),
    "radii_03": Scenario("shear; radii with .3 % random error", SHEAR, scatter_radii(0.003)),
    "radii_1": Scenario("shear; radii with 1 % random error", SHEAR, scatter_radii(0.01)),
    "radius_offset": Scenario("shear; all radii are 3 % of their mean too small", SHEAR, shrink_radii),
    "mu_low": Scenario("shear; friction stated as .2 instead of .25", SHEAR, misstate_friction(LOW_FRICTION)),
    "mu_high": Scenario("shear; friction stated as .4 instead of .25", SHEAR, misstate_friction(HIGH_FRICTION)),
    "step_05": Scenario("simple shear of .5° a photograph", LoadingPath(shear, 0.5, plates=("top",))),
    "step_1": Scenario("simple shear of 1° a photograph", LoadingPath(shear, 1.0, plates=("top",))),
    "periodic": Scenario(
        "simple shear of a periodic cell at constant pressure, .25° a photograph",
        LoadingPath(shear, 0.25, periodic=True),
    ),
    "outer": Scenario(
        "shear; walls and the rods near them are outside the picture; the outermost rods are the boundary",
        SHEAR,
        crop_to_interior,
        scale_stated=False,
    ),
    "outer_biaxial": _cropped("biaxial", BIAXIAL),
    "outer_isotropic": _cropped("isotropic", ISOTROPIC),
    "outer_gravity": _cropped("gravity", PUSHED_HEAP),
    "outer_moving": _cropped("moving", MOVING),
    "outer_noise_40": _cropped("sheared; 40 µm noise", MOVED, noise=4e-5),
    "outer_radii_03": _cropped("sheared; radii with .3 % random error", MOVED, scatter_radii(0.003)),
    "outer_theta_sign": _cropped(
        "sheared; rotations with the wrong sign", MOVED, scale_rotation(-1.0), group="wrong input"
    ),
    "outer_mu_05": _cropped(
        "sheared; friction stated as .5 instead of .25", MOVED, misstate_friction(0.5), group="wrong input"
    ),
    "unknown_load": Scenario("sheared; the load is not stated", MOVED, omit_loads, scale_stated=False),
    "circle": Scenario(
        "a core is pushed and rotated through a packing in a ring under pressure, 1 % of its radius a photograph",
        LoadingPath(push_core, 0.01, plates=("ring",), ring=True),
    ),
    "loads": Scenario(
        "simple shear, .25° a photograph, while the loads on plate and right side oscillate by 40 % and 20 %: both "
        "are stated as measured by sensors",
        LoadingPath(shear_under_loads, 0.25, initial_shear=1.0, measured=("top", "right")),
    ),
    "ten_frames": Scenario("shear; radii with .3 % random error, and ten photographs only", SHEAR, keep_ten_frames),
    "loose": Scenario("sheared, of a packing prepared with friction", replace(MOVED, loose=True)),
    "cyclic": Scenario(
        "shear to and fro by four steps of .05°",
        LoadingPath(shear_cyclically, 0.05, initial_shear=2.0, plates=("top",)),
    ),
    "tiny_cycles": Scenario(
        "shear to and fro by four steps of .01°",
        TINY,
    ),
    "annulus": Scenario(
        "a core turns by .02 rad a photograph in a ring under pressure",
        TURNED,
    ),
    "tilted_bed": Scenario(
        "a box with a free surface tilts by 1° a photograph; no plate",
        TILTED,
    ),
    "stiff_annulus": Scenario(
        "a core turns by .005 rad a photograph in a ring under pressure; contacts ten times as stiff, so that overlaps "
        "are far below the noise",
        replace(TURNED, step=0.005, settings=STIFF),
    ),
    "stiff_tiny_cycles": Scenario("tiny cycles; contacts ten times as stiff", replace(TINY, settings=STIFF)),
    "stiff_stepped_loads": Scenario("stepped loads; contacts ten times as stiff", replace(STEPPED, settings=STIFF)),
    "pins": Scenario("sheared; one rod in twenty is stated as boundary", MOVED, state_pins),
    "stepped_pins": Scenario("stepped loads; boundary as in `pins`", STEPPED, state_pins),
    "tilted_pins": Scenario("tilted bed; boundary as in `pins`", TILTED, state_pins),
    "cycles_pins": Scenario("tiny cycles; boundary as in `pins`", TINY, state_pins),
    "power_law": Scenario("sheared; radii 1:6, most of them small", replace(MOVED, sizes=_choose_by_power_law)),
    "moving": Scenario(
        "sheared, photographed while it moves: rods without contact are not at rest",
        MOVING,
    ),
    "noise_40": Scenario("sheared; 40 µm noise", MOVED, noise=4e-5),
    "correlated_noise": Scenario("sheared; further errors of 10 µm that change slowly", MOVED, correlate_noise),
    "intruder": Scenario(
        "a disc is pushed sideways through a bed with a free surface, .1 % of its width a photograph; no plate",
        LoadingPath(push_intruder, 0.001, settings=HEAP, bed=True),
    ),
    "drum": Scenario(
        "a drum that is half full turns by .75° a photograph; no plate",
        LoadingPath(turn_drum, 0.75, settings=HEAP, bed=True),
    ),
    "membrane": Scenario(
        "compressed by .2 % a photograph beside a flexible membrane under 50 kPa; the rods that it touches are stated "
        "as the boundary, the load on the plate is measured",
        LoadingPath(compress_in_membrane, 0.002, measured=("top",), bed=True),
        state_membrane,
    ),
    "isotropic_centres": Scenario("isotropic; centres as in `centres`", ISOTROPIC, displace_centres),
    "stepped_centres": Scenario("stepped loads; centres as in `centres`", STEPPED, displace_centres),
    "rising_centres": Scenario("rising loads; centres as in `centres`", RISING, displace_centres),
    "annulus_centres": Scenario("annulus; centres as in `centres`", TURNED, displace_centres),
    "cycles_centres": Scenario("tiny cycles; centres as in `centres`", TINY, displace_centres),
    "annulus_radii_1": Scenario("annulus; radii with 1 % random error", TURNED, scatter_radii(0.01)),
    "cycles_radii_1": Scenario("tiny cycles; radii with 1 % random error", TINY, scatter_radii(0.01)),
    "tilted_radii_1": Scenario("tilted bed; radii with 1 % random error", TILTED, scatter_radii(0.01)),
    "shear_box": _missing(
        "direct shear box: the upper half slides over the lower one by .2 % of the width a photograph; its edges bear "
        "on rods",
        LoadingPath(slide_box, 0.002, plates=("top",), bed=True),
    ),
    "footing": _missing(
        "a bar is pressed into a bed with a free surface, .1 % of its width a photograph; its edges bear on rods",
        LoadingPath(press_footing, 0.001, settings=HEAP, bed=True),
    ),
    "stiffest": _missing(
        "contacts fifty times as stiff, photographed at rest; packed with friction",
        replace(_sheared(normal_stiffness=1e9), loose=True),
    ),
    "stiff": _missing("sheared; contacts ten times as stiff, photographed at rest", _sheared(normal_stiffness=2e8)),
    "stiff_moving": _missing(
        "the same, photographed while it moves",
        _sheared(normal_stiffness=2e8, moving=True, unbalance_limit=10.0, damping_ratio=0.4),
    ),
    "stiff_loose": _missing(
        "contacts ten times as stiff, photographed at rest; packed with friction",
        replace(_sheared(normal_stiffness=2e8), loose=True),
    ),
    "stiff_noise_40": _missing("stiff; 40 µm noise", _sheared(normal_stiffness=2e8), noise=4e-5),
    "base_friction": _missing(
        "sheared on a base with friction of 10 % of the mean force", _sheared(base_drag=150.0)
    ),
    "cohesion": _missing("sheared; contacts attract by 10 % of the mean force", _sheared(adhesion=5.0)),
    "strong_cohesion": _missing("sheared; contacts attract by 40 % of the mean force", _sheared(adhesion=20.0)),
    "friction_spread": _missing("sheared; friction varies by 40 % between contacts", _sheared(friction_spread=0.4)),
    "smooth_walls": _missing("sheared; smooth walls stated as rough", _sheared(wall_friction=0.0), state_walls_rough),
    "smooth_walls_spread": _missing(
        "the same, and friction varies by 40 % between contacts", _sheared(wall_friction=0.0, friction_spread=0.4),
        state_walls_rough,
    ),
    "rough_walls": _missing(
        "sheared; walls of friction .5 stated like the rods", _sheared(wall_friction=0.5), state_walls_rough
    ),
    "strong_inertia": _missing(
        "sheared three times as fast as that", _sheared(inertial_number=6e-2, moving=True, unbalance_limit=10.0)
    ),
    "inertia": _missing(
        "sheared fast: forces out of balance by some 10 %, photographed while it moves",
        _sheared(inertial_number=2e-2, moving=True, unbalance_limit=10.0),
    ),
    "rolling": _missing("sheared; rolling resistance of .1", _sheared(rolling_friction=0.1)),
    "elliptic": _missing("sheared; sections elliptic by ±5 %, stated as round", _sheared(ovality=0.05)),
    "slightly_elliptic": _missing("sheared; sections elliptic by ±1 %, stated as round", _sheared(ovality=0.01)),
    "sizes_10": _missing("sheared; radii 1:10", replace(MOVED, sizes=_choose_ten)),
    "time_reversed": _wrong("photographs in reverse order", reverse_time),
    "shuffled": _wrong("photographs in random order", shuffle_frames),
    "swapped_frames": _wrong("every third pair of photographs swapped", swap_frames),
    "duplicate_frame": _wrong("one photograph twice", duplicate_frame),
    "theta_sign": _wrong("rotations with the wrong sign", scale_rotation(-1.0)),
    "theta_zero": _wrong("rotations stated as zero", scale_rotation(0.0)),
    "theta_degrees": _wrong("rotations in degrees", scale_rotation(math.degrees(1.0))),
    "theta_absent": _wrong("rotations unknown", drop_rotation),
    "mu_01": _wrong("friction stated as .1 instead of .25", misstate_friction(0.1)),
    "mu_05": _wrong("friction stated as .5 instead of .25", misstate_friction(0.5)),
    "walls_late": _wrong("walls one photograph late", delay_walls),
    "left_late": _wrong("the left side half a photograph late", delay_left),
    "top_fixed": _wrong("the plate stated at rest", fix_top),
    "wall_inside": _wrong("the right side stated 2 mm inside the packing", shift_side_inwards),
    "walls_scatter": _wrong("ends of the walls scatter by 100 µm from photograph to photograph", scatter_walls),
    "aspect_03": _wrong("x stretched by .3 %", stretch_picture(0.003)),
    "aspect_1": _wrong("x stretched by 1 %", stretch_picture(0.01)),
    "lens_03": _wrong("seen through a lens that moves the farthest corner by .3 %", distort_picture(0.003)),
    "class_2": _wrong("one class of radii 2 % too large", misstate_class),
    "some_radii": _wrong("a fifth of the rods stated 2 % too large", misstate_some),
    "wrong_class": _wrong("a tenth of the rods stated of another size", confuse_classes),
    "overhang": _wrong("the plate's wall overhangs by 5 cm at either end", extend_bars),
    "outliers": _wrong("2 % of the poses displaced by .3 to 2 mm", add_outliers),
    "one_jump": _wrong("one rod displaced by 1 mm in one photograph", displace_one_pose),
    "missing_poses": _wrong("10 % of the poses missing", lose_poses),
    "exchanged_ids": _wrong("2 % of the rods exchange their names with a neighbour in the middle of the test",
                            exchange_ids),
    "stepped_some_radii": _wrong("stepped loads; a fifth of the rods stated 2 % too large", misstate_some, STEPPED),
    "annulus_some_radii": _wrong("annulus; a fifth of the rods stated 2 % too large", misstate_some, TURNED),
    "rising_lens": _wrong("rising loads; seen through a lens as in `lens_03`", distort_picture(0.003), RISING),
}  # fmt: skip
# The same without a stated load: nothing but motion and positions shows how much the contacts bear.
UNLOADED: dict[ScenarioName, ScenarioName] = {
    "unloaded_annulus": "annulus", "unloaded_biaxial": "biaxial", "unloaded_cyclic": "cyclic",
    "unloaded_loose": "loose", "unloaded_noise_40": "noise_40", "unloaded_step_05": "step_05",
    "unloaded_rolling": "rolling", "unloaded_inertia": "inertia", "unloaded_mu_01": "mu_01",
    "unloaded_theta_degrees": "theta_degrees", "unloaded_time_reversed": "time_reversed",
    "unloaded_class_2": "class_2", "unloaded_walls_late": "walls_late", "unloaded_some_radii": "annulus_some_radii",
}  # fmt: skip
for _name, _loaded in UNLOADED.items():
    _of = SCENARIOS[_loaded]
    SCENARIOS[_name] = replace(
        _of, meaning=f"`{_loaded}`; the load is not stated", departure=in_turn(_of.departure, omit_loads),
        scale_stated=False,
    )  # fmt: skip
