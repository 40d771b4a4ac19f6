"""The worlds: how the truth of each is made, and how its experiment folder departs from it."""

from __future__ import annotations

from dataclasses import dataclass

from solver.dem.simulation import DemSettings

from ..dense_packing import choose_two_radii, choose_wide_radii
from .courses import (
    Course,
    compress_biaxially,
    load_isotropically,
    push_core,
    push_heap,
    shear,
    shear_purely,
    shear_under_loads,
)
from .departures import (
    HIGH,
    LOW,
    Departure,
    cut_out,
    displace_centres,
    hide_rods,
    move_camera,
    photograph_discs,
    scatter_radii,
    shrink_radii,
    stop_after_ten,
    tell_corners,
    tell_friction,
    tell_short_walls,
    tell_truly,
)
from .names import WorldName

DISC_NOISE = 1.18e-4  # [m], 0.7 % of a mean diameter of the two sizes


@dataclass(frozen=True, slots=True)
class World:
    """A truth and what is told of it."""

    meaning: str
    course: Course
    departure: Departure = tell_truly
    noise: float = 1e-5  # [m] of a position component
    scale_told: bool = True  # where the course knows it

    @property
    def scale_known(self) -> bool:
        """Whether a loaded plate or the weight tells the size of the forces."""
        loaded = bool(self.course.plates or self.course.measured)
        return self.scale_told and (loaded or any(self.course.settings.gravity))


SHEAR = Course(shear, 0.25, plates=("top",))
SOFT = Course(shear, 0.25, plates=("top",), settings=DemSettings(normal_stiffness=1.6e6))
HEAP = DemSettings(pressure=float("nan"), gravity=(0.0, -9.81), normal_stiffness=2e6)
DISCS = DemSettings(normal_stiffness=4e5, friction=0.3, wall_friction=0.3, base_friction=10.0)

WORLDS: dict[WorldName, World] = {
    "shear": World("simple shear under a plate, .25° a photograph, 10 µm noise: all is right", SHEAR),
    "sheared": World(
        "the same after 3° of shear, its friction mobilised: the first photograph is one like the others",
        Course(shear, 0.25, before=3.0, plates=("top",)),
    ),
    "biaxial": World(
        "biaxial compression of radii 1:5, .3 % a photograph, the right side under constant pressure",
        Course(compress_biaxially, 0.003, plates=("right",), sizes=choose_wide_radii),
    ),
    "isotropic": World(
        "loaded and unloaded from two sides between 1 and 3 times 50 kPa; no pressure is told",
        Course(load_isotropically, 0.0),
    ),
    "gravity": World(
        "a heap with a free surface, pushed by its right wall; no plate",
        Course(push_heap, 0.002, settings=HEAP, open_top=True),
    ),
    "soft": World(
        "simple shear of soft rods that overlap by about .25 % of a diameter",
        SOFT,
    ),
    "soft_radii_03": World("soft; radii are wrong by .3 % at random, as much as rods overlap", SOFT,
                           scatter_radii(0.003)),
    "soft_unseen": World("soft; 3 % of the rods were never seen", SOFT, hide_rods),
    "softer": World(
        "simple shear of very soft rods that overlap by about 1.1 % of a diameter",
        Course(shear, 0.25, plates=("top",), settings=DemSettings(normal_stiffness=3e5)),
    ),
    "nearly_jammed": World(
        "two sizes of soft discs on a rubbing base, pure shear of .3 % a photograph; no rotations, no pressure told, "
        "radii 3 % too small, noise .7 % of a diameter",
        Course(shear_purely, 0.003, settings=DISCS, sizes=choose_two_radii, loose=True),
        photograph_discs,
        DISC_NOISE,
    ),
    "corners": World("shear; walls end where the bars meet", SHEAR, tell_corners),
    "short_walls": World("shear; the side walls are told 13 % too short", SHEAR, tell_short_walls),
    "unseen": World("shear; 3 % of the rods were never seen", SHEAR, hide_rods),
    "camera": World("shear; every photograph is shifted by up to 60 µm against the walls", SHEAR, move_camera),
    "centres": World("shear; centres are wrong by 50 µm that turn with the rod, precision told so", SHEAR,
                     displace_centres),
    "radii_03": World("shear; radii are wrong by .3 % at random", SHEAR, scatter_radii(0.003)),
    "radii_1": World("shear; radii are wrong by 1 % at random", SHEAR, scatter_radii(0.01)),
    "radius_offset": World("shear; all radii are 3 % of their mean too small", SHEAR, shrink_radii),
    "mu_low": World("shear; friction is told as .2 for .25", SHEAR, tell_friction(LOW)),
    "mu_high": World("shear; friction is told as .4 for .25", SHEAR, tell_friction(HIGH)),
    "step_05": World("simple shear of .5° a photograph", Course(shear, 0.5, plates=("top",))),
    "step_1": World("simple shear of 1° a photograph", Course(shear, 1.0, plates=("top",))),
    "periodic": World(
        "simple shear of a periodic cell at constant pressure, .25° a photograph",
        Course(shear, 0.25, periodic=True),
    ),
    "outer": World(
        "shear; walls and the rods near them are out of the picture: the outermost rods are the boundary",
        SHEAR,
        cut_out,
        scale_told=False,
    ),
    "circle": World(
        "a core is pushed and turned through a packing in a ring under pressure, 1 % of its radius a photograph",
        Course(push_core, 0.01, plates=("ring",), ring=True),
    ),
    "loads": World(
        "simple shear, .25° a photograph, while the loads on plate and right side swing by 40 % and 20 %: both are "
        "told as sensors measured them",
        Course(shear_under_loads, 0.25, before=1.0, measured=("top", "right")),
    ),
    "ten_frames": World("shear; radii wrong by .3 % at random, and ten photographs only", SHEAR, stop_after_ten),
}  # fmt: skip
