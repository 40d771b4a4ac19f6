"""A synthetic experiment: a simulated shear test, written as an experiment folder with its truth.

The preset `1g2e` is the apparatus of the method's authors: discs in the corners of the frame, a plate that is a bar
with its two discs under one measured load, walls rougher than rods, and a photograph every .0267° while it moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from ..experiment.units import Scale
from ..process.atomic import write_atomically
from ..process.errors import InputError
from ..process.progress import Progress, no_progress
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import STRAIGHT, circle_parameters
from ..solver.dem.dem_truth import WALL_NAMES, DemSettings, DemTruth
from ..solver.dem.shear_cell import CORNER_NAMES, CORNERED_SIDES, shear_photographs
from . import experiment_files
from .dense_packing import prepare_packing
from .placement import cut_sides, place_in_picture
from .rearrangement import choose_window, measure_old_unbalance
from .speckle import RodScene, SpeckleSettings, render_photograph

SHEAR_RATE = 4.8e-3  # [°/s], of the real test; gives the times of the photographs
STEEPEST = 30.0  # [°]
LEAST_GRAINS = 12
MARGIN = 0.006  # [m], of visible backing around the frame
LARGEST_RADIUS_ERROR = 0.05  # of the stated radii, either way
# The apparatus 1γ2ε as its authors describe it.
PLATE_LOAD, PLATE_LENGTH = 1438.0, 0.5  # [N], [m]; a smaller frame has the same load per length
CORNER_RADIUS = 0.0206  # [m]
PLATE_OF_CORNERS = ("top", *CORNER_NAMES[2:])  # the walls that are one plate
APPARATUS = DemSettings(
    density=2900.0, friction=0.3, wall_friction=0.5, moving=True, unbalance_limit=10.0,
    pressure=PLATE_LOAD / (PLATE_LENGTH * DemSettings().length),
)  # fmt: skip
# Speckle and noise have no repeats: Huffman coding alone compresses them best and fastest (measured).
PNG_OPTIONS = [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_HUFFMAN_ONLY]


@dataclass(frozen=True, slots=True)
class Preset:
    """Size and loading of an experiment."""

    grains: int
    frames: int  # photographs written
    step_degrees: float  # of shear between photographs
    pixel_size: float  # [m]
    search_degrees: float = 0.0  # simulated range from which the photographs around the greatest event are taken
    jpeg_quality: int | None = None  # of 8-bit photographs; None: PNG
    settings: DemSettings = field(default_factory=DemSettings)
    initial_degrees: float = 0.0  # of shear at the first photograph
    interval: float | None = None  # [s] between photographs; None: at the rate of the paper's test
    corner_radius: float = 0.0  # [m] of discs where the bars meet, which make the load a measured one; 0: none
    noise: float = 0.0  # [m] of tracked positions

    @property
    def seconds(self) -> float:
        """Time between photographs [s]."""
        return self.step_degrees / SHEAR_RATE if self.interval is None else self.interval


PRESETS = {
    "small": Preset(grains=250, frames=24, step_degrees=0.25, pixel_size=2.5e-4, search_degrees=15.0, jpeg_quality=92),
    "paper": Preset(grains=1172, frames=61, step_degrees=0.25, pixel_size=2.0e-4),
    "1g2e": Preset(
        grains=1172,
        frames=60,
        step_degrees=0.0267,
        pixel_size=1.45e-4,
        jpeg_quality=92,
        settings=APPARATUS,
        initial_degrees=2.0,
        interval=5.0,
        corner_radius=CORNER_RADIUS,
        noise=1e-5,
    ),
}


@dataclass(frozen=True, slots=True)
class Synthesis:
    """An experiment folder that was written, and its truth."""

    folder: Path
    truth: DemTruth  # in the experiment's world coordinates
    old_unbalance: Array  # (f,) ū between true forces of consecutive photographs, NaN at frame 0
    rearrangement: int  # the photograph of greatest ū
    photograph_shape: tuple[int, int] | None  # rows, columns [px]


@dataclass(frozen=True, slots=True)
class SynthesisSettings:
    """What a synthetic experiment is like. None: as in the preset.

    Raises
    ------
    InputError
        If a value is out of range.
    """

    preset: str = "small"  # small, paper or 1g2e
    seed: int = 0
    photographs: bool = True  # write photographs, whose grains are to be detected; otherwise tracks
    noise: float | None = None  # [m] standard deviation of tracked positions; that of rotations is noise / radius [rad]
    depth: int = 8  # bits of a photograph, 8 or 16; 16 bits are always PNG
    jpeg_quality: int | None = None  # of 8-bit photographs, 1 … 100
    png: bool = False  # write PNG at 8 bits
    grains: int | None = None
    frames: int | None = None
    step_degrees: float | None = None  # [°] of shear between photographs
    pixel_size: float | None = None  # [m]
    reversal: bool = False  # reverse the shear half way
    radius_error: float = 0.0  # that all stated radii share, as a fraction: −.02 states them 2 % too small
    speckle: SpeckleSettings | None = None  # paint and camera; its pixel size and depth are replaced

    def __post_init__(self) -> None:
        _check_choices(self)
        self.plan()

    def plan(self) -> Preset:
        """Return the preset with all that is given in its place. Raises InputError."""
        names = ("grains", "frames", "step_degrees", "pixel_size")
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        return _plan(PRESETS[self.preset], given, self.reversal)

    def quality(self) -> int | None:
        """Return the quality of JPEG photographs; None: PNG."""
        if self.png or self.depth != 8:
            return None
        return self.plan().jpeg_quality if self.jpeg_quality is None else self.jpeg_quality


def synthesize(out: Path, settings: SynthesisSettings | None = None, progress: Progress = no_progress) -> Synthesis:
    """Simulate a simple shear test and write it as an experiment folder; the same settings give the same bytes.

    Parameters
    ----------
    out : Path
        Folder to write; must be absent or empty.
    settings : SynthesisSettings, optional
    progress : callable, optional
        Called with stage, done and total.

    Raises
    ------
    InputError
        If the folder is not empty.
    UnbalancedError
        If the simulation does not come to rest; nothing is written then.
    """
    out, settings = Path(out), settings or SynthesisSettings()
    seed, plan = settings.seed, settings.plan()
    experiment_files.refuse_full_folder(out)
    speckle = replace(settings.speckle or SpeckleSettings(), pixel_size=plan.pixel_size, depth=settings.depth)

    truth = _simulate(plan, seed, settings.reversal, progress)
    truth = place_in_picture(cut_sides(truth), MARGIN + speckle.bar_thickness)
    old_unbalance = measure_old_unbalance(truth)
    event = int(np.nanargmax(old_unbalance)) if truth.frame_count > 1 else 0

    out.mkdir(parents=True, exist_ok=True)
    ids = np.arange(len(truth.radius))
    walls = _write_walls(out, truth)
    experiment_files.write_truth_contacts(out / "truth_contacts.csv", truth)
    experiment_files.write_tracks(out / "truth_tracks.csv", ids, truth.position, truth.rotation)
    taken = _Photographed(truth, plan.seconds, seed, settings.radius_error)
    if settings.photographs:
        source, shape = _write_photographs(out, taken, speckle, settings.quality(), progress)
    else:
        source, shape = _write_tracks(out, taken, plan.noise if settings.noise is None else settings.noise), None
    # Written last, so that an unfinished folder is not an experiment.
    experiment_files.write_experiment(
        out / "experiment.toml",
        name=out.resolve().name,
        remark=_remark(settings.preset, seed, truth, old_unbalance, event),
        source=source,
        known=experiment_files.StatedInputs.of(truth.settings, plates=() if plan.corner_radius else ("top",)),
        walls=walls,
    )
    return Synthesis(out, truth, old_unbalance, event, shape)


def shear_angles(plan: Preset, reversal: bool) -> Array:
    """Return the shear angles (f,) [rad] of the photographs to simulate."""
    count = max(plan.frames, round(plan.search_degrees / plan.step_degrees) + 1)
    step = np.arange(count)
    if reversal:
        peak = (count - 1) // 2
        step = peak - abs(step - peak)
    return np.deg2rad(plan.initial_degrees + plan.step_degrees * step)


@dataclass(frozen=True, slots=True)
class _Photographed:
    """What is written as measured."""

    truth: DemTruth
    interval: float  # [s]
    seed: int
    radius_error: float

    @property
    def stated_radius(self) -> Array:
        """Radii (n,) [m] as the tables state them."""
        return self.truth.radius * (1.0 + self.radius_error)


def _simulate(plan: Preset, seed: int, reversal: bool, progress: Progress) -> DemTruth:
    settings = plan.settings
    angles = shear_angles(plan, reversal)
    progress("simulate", 0, len(angles))
    cell = prepare_packing(plan.grains, np.random.default_rng(seed), settings, corner_radius=plan.corner_radius)
    frames = []
    for frame in shear_photographs(cell, angles):
        frames.append(frame)
        progress("simulate", len(frames), len(angles))
    truth = DemTruth.of_frames(cell.grains.radius, frames, settings)
    if plan.corner_radius:
        truth = replace(truth, wall_names=WALL_NAMES + CORNER_NAMES, side=CORNERED_SIDES)
    if truth.frame_count == plan.frames:
        return truth
    first, _ = choose_window(measure_old_unbalance(truth), plan.frames)
    return truth.frames(first, first + plan.frames)


def _write_walls(out: Path, truth: DemTruth) -> str:
    """Write the tables of the walls; return the keys of [walls] that name them."""
    if truth.side is None:
        experiment_files.write_walls(out / "walls.csv", truth.wall_names, truth.endpoints)
        experiment_files.write_wall_forces(out / "wall_forces.csv", truth)
        return 'file = "walls.csv"\n'
    experiment_files.write_corners(out / "corners.csv", CORNER_NAMES, truth.endpoints[:, truth.side != STRAIGHT])
    plate = [truth.wall_names.index(name) for name in PLATE_OF_CORNERS]
    force = experiment_files.forces_on_walls(truth)[:, plate, 1].sum(axis=1)
    experiment_files.write_loads(out / "load.csv", PLATE_OF_CORNERS[:1], force[:, None])
    return 'corners = "corners.csv"\nload = "load.csv"\n'


def _write_photographs(
    out: Path,
    taken: _Photographed,
    speckle: SpeckleSettings,
    jpeg_quality: int | None,
    progress: Progress,
) -> tuple[str, tuple[int, int]]:
    """Write photos/ and the true grains of the first photograph; return the [photographs] table and the shape."""
    truth, seed = taken.truth, taken.seed
    pixel = speckle.pixel_size
    extent = truth.endpoints.max(axis=(0, 1, 2)) + MARGIN + speckle.bar_thickness
    width, height = (math.ceil(float(length) / pixel) + 1 for length in extent)
    (out / "photos").mkdir()
    suffix, options = "png", PNG_OPTIONS
    if jpeg_quality is not None:
        suffix, options = "jpg", [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality]
    progress("photograph", 0, truth.frame_count)
    for k in range(truth.frame_count):
        image = render_photograph(
            speckle,
            RodScene(width, height, *_painted(truth, k), seed),
            noise_seed=int(np.random.SeedSequence([seed, k]).generate_state(1)[0]),
        )
        name = out / "photos" / f"{k:04d}.{suffix}"
        write_atomically(name, cv2.imencode(name.suffix, image, options)[1].tobytes())
        progress("photograph", k + 1, truth.frame_count)
    scale = Scale(pixel, height)
    experiment_files.write_grains_in_pixels(
        out / "grains.csv", scale.to_pixels(truth.position[0]), taken.stated_radius / pixel
    )
    classes = ", ".join(f"{radius:g}" for radius in np.unique(taken.stated_radius))
    source = f"""[photographs]
files = "photos/*.{suffix}"
pixel_size = {pixel:g}
interval = {taken.interval:.6f}
radii = [{classes}]
# grains = "grains.csv"  # the true grains of the first photograph: with this line nothing is detected
"""
    return source, (height, width)


def _painted(truth: DemTruth, k: int) -> tuple[Array, Array, Array, Array]:
    """Return radius, position and rotation of rods and corner discs of a photograph, and bars from disc to disc."""
    if truth.side is None:
        return truth.radius, truth.position[k], truth.rotation[k], truth.endpoints[k]
    straight = truth.side == STRAIGHT
    centre, radius, angle = circle_parameters(truth.endpoints[k][~straight])
    following = np.roll(centre, -1, axis=0)
    along = (following - centre) / np.linalg.norm(following - centre, axis=1)[:, None] * radius[:, None]
    return (
        np.concatenate([truth.radius, radius]),
        np.concatenate([truth.position[k], centre]),
        np.concatenate([truth.rotation[k], angle]),
        np.stack([centre + along, following - along], axis=1),
    )


def _write_tracks(out: Path, taken: _Photographed, noise: float) -> str:
    """Write tracks with noise, their grains and times; return the [tracks] table."""
    truth = taken.truth
    rng = np.random.default_rng([taken.seed, 1])
    position = truth.position + noise * rng.standard_normal(truth.position.shape)
    rotation = truth.rotation + noise / truth.radius * rng.standard_normal(truth.rotation.shape)
    ids = np.arange(len(truth.radius))
    experiment_files.write_tracks(out / "tracks.csv", ids, position, rotation)
    experiment_files.write_grains(out / "grains.csv", ids, taken.stated_radius)
    experiment_files.write_times(out / "times.csv", taken.interval * np.arange(truth.frame_count, dtype=np.float64))
    return f"""[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
precision = {max(noise, experiment_files.FINEST_PRECISION)}
"""


def _remark(preset: str, seed: int, truth: DemTruth, old_unbalance: Array, event: int) -> str:
    first, last = np.rad2deg(truth.shear[[0, -1]])
    text = (
        f"Synthetic: explicit discrete-element simulation of simple shear, preset {preset}, seed {seed},\n"
        f"{len(truth.radius)} rods, {truth.frame_count} photographs, shear {first:.2f}° to {last:.2f}°.\n"
        f"Greatest mean force residual of a grain in the truth: {truth.unbalance.max():.1e} of the mean force."
    )
    if event > 0:
        text += (
            f"\nGreatest rearrangement: between photographs {event - 1} and {event} (ū = {old_unbalance[event]:.3f})."
        )
    return text


def _check_choices(settings: SynthesisSettings) -> None:
    preset, seed, noise, depth = settings.preset, settings.seed, settings.noise or 0.0, settings.depth
    if preset not in PRESETS:
        raise InputError("synth", f"preset = {preset!r}", f"expected one of {', '.join(PRESETS)}")
    if seed < 0:
        raise InputError("synth", f"seed = {seed}", "expected 0 or more")
    if depth not in (8, 16):
        raise InputError("synth", f"depth = {depth}", "expected 8 or 16 bits")
    if not (math.isfinite(noise) and noise >= 0.0):
        raise InputError("synth", f"noise = {noise}", "expected metres, 0 or more")
    if settings.photographs and noise > 0.0:
        raise InputError("synth", f"noise = {noise}", "applies to tracks only: photographs have noise of their own")
    quality = settings.jpeg_quality
    if quality is not None and not (1 <= quality <= 100 and depth == 8):
        raise InputError("synth", f"jpeg_quality = {quality}", "expected 1 … 100, and a depth of 8 bits")
    if not abs(settings.radius_error) <= LARGEST_RADIUS_ERROR:
        limit = f"expected a fraction from -{LARGEST_RADIUS_ERROR} to {LARGEST_RADIUS_ERROR}"
        raise InputError("synth", f"radius_error = {settings.radius_error}", limit)


def _plan(preset: Preset, given: dict[str, float], reversal: bool) -> Preset:
    for name, value in given.items():
        if not (math.isfinite(value) and value > 0):
            raise InputError("synth", f"{name} = {value}", "expected more than 0")
    plan = replace(preset, **given)
    if plan.grains < LEAST_GRAINS:
        raise InputError("synth", f"grains = {plan.grains}", f"expected at least {LEAST_GRAINS}")
    steepest = float(np.rad2deg(shear_angles(plan, reversal).max()))
    if steepest > STEEPEST + 1e-9:
        loading = f"frames = {plan.frames}, step_degrees = {plan.step_degrees}"
        raise InputError("synth", loading, f"shears to {steepest:g}°, expected at most {STEEPEST:g}°")
    return plan
