"""A synthetic photoelastic test as photographs: plain discs in red light, fringes in green light, with the truth.

Stiff discs of two sizes, loaded and unloaded from two sides: nothing slides, and their overlaps are smaller than the
errors of their tracks, so that fringes are the best evidence of their forces. Rotations are unknown and no load is
stated. The green light drifts from photograph to photograph.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...experiment.units import Scale
from ...process.atomic import write_atomically
from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import wall_distance
from ...solver.dem.dem_truth import DemTruth
from .. import experiment_files
from ..scenarios.preset_names import FringedPreset
from ..scenarios.scenario_folder import check_output, load_or_simulate
from ..scenarios.scenario_table import FRINGED_LOADINGS
from .stress_optics import fringe_light, stress_difference

DIAMETER = 60.0  # px, mean
FINE = 3  # sub-pixels along each side of a pixel
MARGIN = 12.0  # px around everything
ORDER_OF_MEAN = 0.3  # fringe order at the centre of a disc that two mean forces squeeze from opposite sides
BACKING, DISC, DARK, BRIGHT = 16.0, 185.0, 14.0, 200.0  # grey levels: of the backing, a disc in red, no and full light
SHADE = 0.06  # ±, brightness of different discs in red light
DRIFT = 0.12  # ±, brightness of the green light from photograph to photograph
NOISE = 2.0  # grey levels, standard deviation
BLUR = 0.7  # px, standard deviation
INTERVAL = 30.0  # s
CENTRE_ERROR = 4e-3  # mean radii: by which a disc's rim is displaced from its centre, fixed in the disc


@dataclass(frozen=True, slots=True)
class FringedTest:
    """A folder that was written, and its truth in the experiment's world coordinates."""

    folder: Path
    truth: DemTruth


def make_fringed(
    out: Path,
    seed: int = 0,
    *,
    preset: FringedPreset = "fringes",
    grains: int | None = None,
    frames: int | None = None,
    progress: Progress = no_progress,
) -> FringedTest:
    """Write photographs of a photoelastic test as an experiment with its truth; the same arguments give the same bytes.

    Parameters
    ----------
    out : Path
        Folder to write; must be absent or empty.
    seed : int
    preset : {'fringes', 'stiff_fringes'}
        Discs that overlap by their tracks' errors, or by a tenth of them.
    grains : int, optional
    frames : int, optional
        Photographs; default: all of the simulation.
    progress : Progress

    Raises
    ------
    InputError
        If the folder is not empty or an argument is out of range.
    UnbalancedError
        If the simulation does not come to rest.
    """
    grains = check_output(out, grains)
    truth = load_or_simulate(FRINGED_LOADINGS[preset], grains, seed, None, progress)
    if frames is not None:
        truth = truth.frames(0, min(frames, truth.frame_count))
    pixel = 2.0 * float(truth.radius.mean()) / DIAMETER
    shift = MARGIN * pixel - truth.endpoints.min(axis=(0, 1, 2))
    truth = replace(truth, endpoints=truth.endpoints + shift, position=truth.position + shift)
    width, height = (math.ceil(float(each) / pixel + MARGIN) for each in truth.endpoints.max(axis=(0, 1, 2)))
    out.mkdir(parents=True, exist_ok=True)
    (out / "photos").mkdir()
    rng = np.random.default_rng([seed, 4])
    looks = _Looks(
        1.0 + SHADE * rng.uniform(-1.0, 1.0, grains),
        CENTRE_ERROR * float(truth.radius.mean()) * rng.standard_normal((grains, 2)),
        _per_order(truth),
    )
    for k in range(truth.frame_count):
        image = _photograph(truth, k, looks, Scale(pixel, height), (height, width), rng)
        write_atomically(out / "photos" / f"{k:04d}.png", cv2.imencode(".png", image)[1].tobytes())
        progress("photograph", k + 1, truth.frame_count)
    _write_tables(out, truth, Scale(pixel, height), seed)
    return FringedTest(out, truth)


@dataclass(frozen=True, slots=True)
class _Looks:
    """Properties of the discs that do not change."""

    brightness: Array  # (n,) in red light
    displacement: Array  # (n, 2) [m] of the rim from the centre
    per_order: float  # [N/m] of a fringe order


def _per_order(truth: DemTruth) -> float:
    """Stress per fringe order: two opposite forces F stress the centre of a disc of diameter D by 8 F/(π D)."""
    mean = float(truth.fn[truth.fn > 0.0].mean())
    return 8.0 * mean / (np.pi * 2.0 * float(truth.radius.mean())) / ORDER_OF_MEAN


def _photograph(
    truth: DemTruth, k: int, looks: _Looks, scale: Scale, shape: tuple[int, int], rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Render photograph k in blue, green and red (H, W, 3)."""
    red = np.full(shape, BACKING)
    green = np.full(shape, DARK)
    contacts = _forces_by_disc(truth, k)
    pixel = scale.mean_size
    for disc, (x, y) in enumerate(scale.to_pixels(truth.position[k] + looks.displacement)):
        size = truth.radius[disc] / pixel
        left, right = math.floor(x - size) - 1, math.ceil(x + size) + 1
        top, bottom = math.floor(y - size) - 1, math.ceil(y + size) + 1
        fine = (np.arange(FINE) + 0.5) / FINE - 0.5
        columns = (np.arange(left, right + 1)[:, None] + fine).ravel() - x
        rows = (np.arange(top, bottom + 1)[:, None] + fine).ravel() - y
        across, down = np.meshgrid(columns, rows)
        inside = across**2 + down**2 < size**2
        light = np.zeros(across.shape)
        direction, force = contacts[disc]
        if len(direction):
            stress = stress_difference(
                pixel * across[inside], -pixel * down[inside], truth.radius[disc], direction, force
            )
            light[inside] = fringe_light(stress, looks.per_order)
        within = _mean_over_pixels(inside.astype(np.float64))
        window = np.s_[top : bottom + 1, left : right + 1]
        red[window] += within * (DISC * looks.brightness[disc] - BACKING)
        green[window] += _mean_over_pixels(light) * (BRIGHT - DARK)
    green *= 1.0 + DRIFT * rng.uniform(-1.0, 1.0)
    channels = [0.5 * green, green, red]
    image = np.stack([cv2.GaussianBlur(each, (0, 0), BLUR) for each in channels], axis=2)
    image += NOISE * rng.standard_normal(image.shape)
    return np.clip(np.rint(image), 0.0, 255.0).astype(np.uint8)


def _mean_over_pixels(fine: Array) -> Array:
    rows, columns = fine.shape
    return fine.reshape(rows // FINE, FINE, columns // FINE, FINE).mean(axis=(1, 3))


def _forces_by_disc(truth: DemTruth, k: int) -> list[tuple[Array, Array]]:
    """Directions of the contact points (m, 2) and forces [N] (m, 2) on every disc in photograph k."""
    rows = slice(int(truth.offset[k]), int(truth.offset[k + 1]))
    i, j, n = truth.i[rows], truth.j[rows], len(truth.radius)
    between = j < n
    normal = np.empty((len(i), 2))
    branch = truth.position[k][j[between]] - truth.position[k][i[between]]
    normal[between] = branch / np.linalg.norm(branch, axis=1)[:, None]
    wall = j[~between] - n
    side = None if truth.side is None else truth.side[wall]
    normal[~between] = wall_distance(truth.endpoints[k, wall], side, truth.position[k, i[~between]])[1]
    tangent = np.column_stack([-normal[:, 1], normal[:, 0]])
    on_other = truth.fn[rows, None] * normal + truth.ft[rows, None] * tangent
    disc = np.concatenate([i, j[between]])
    direction = np.concatenate([normal, -normal[between]])
    force = np.concatenate([-on_other, on_other[between]])
    order = np.argsort(disc, kind="stable")
    ends = np.searchsorted(disc[order], np.arange(n + 1))
    return [(direction[order[a:b]], force[order[a:b]]) for a, b in pairwise(ends)]


def _write_tables(out: Path, truth: DemTruth, scale: Scale, seed: int) -> None:
    ids = np.arange(len(truth.radius))
    experiment_files.write_walls(out / "walls.csv", truth.wall_names, truth.endpoints)
    experiment_files.write_truth_contacts(out / "truth_contacts.csv", truth)
    experiment_files.write_tracks(out / "truth_tracks.csv", ids, truth.position, truth.rotation)
    pixel = scale.mean_size
    experiment_files.write_grains_in_pixels(
        out / "grains.csv", scale.to_pixels(truth.position[0]), truth.radius / pixel
    )
    classes = ", ".join(f"{radius:g}" for radius in np.unique(truth.radius))
    source = f"""[photographs]
files = "photos/*.png"
pixel_size = {pixel:g}
interval = {INTERVAL:g}
radii = [{classes}]
channel = "red"            # plain discs
follow = "outline"
fringes = "same"           # in these photographs …
fringe_channel = "green"   # … fringes are green
# grains = "grains.csv"  # the true discs of the first photograph: with this line nothing is detected
"""
    experiment_files.write_experiment(
        out / "experiment.toml",
        name=out.resolve().name,
        remark=f"Synthetic: {len(ids)} photoelastic discs, {truth.frame_count} photographs, seed {seed}.",
        source=source,
        known=experiment_files.StatedInputs.of(truth.settings, plates=()),
    )
