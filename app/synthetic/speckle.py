"""Synthetic photographs of rods with speckled end faces and exactly known motion.

The paint is an analytic function in each body's frame, the union of soft-edged dots, and is evaluated for every pose:
nothing is interpolated, so a motion by a fraction of a pixel and a rotation by any angle are as exact as the camera
model (`synthetic.camera`).

Three properties are fixed in the picture while the bodies move, as in a laboratory: the unevenness of the light, the
side on which a tilted rod's rim darkens, and the backing behind the gaps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..experiment.units import Scale
from ..solver.bodies.grains import Array
from .camera import Camera
from .paint import Paint, paint_backing, paint_bars, paint_rods
from .speckle_kernels import FINE, add_backing, draw_bar, draw_rod

Photograph = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class SpeckleSettings:
    """How the rods are painted, lit and photographed. Grey levels count 0 … 255 at either depth."""

    pixel_size: float = 2.5e-4  # [m]
    depth: int = 8  # [bit], 8 or 16
    noise: float = 2.0  # [grey], standard deviation of the sensor's noise
    blur: float = 0.6  # [px], standard deviation of the lens's blur; below 0.18 it acts as 0.18

    dot_diameter: tuple[float, float] = (0.8e-3, 1.5e-3)  # [m], smallest and largest paint dot
    dot_pixels: float = 3.0  # [px], no dot is smaller: all are enlarged until the smallest is this
    coverage: float = 0.5  # fraction of an end face under dots
    white: float = 185.0  # [grey], the end face
    black: float = 60.0  # [grey], a dot of full strength
    brightness_range: float = 0.05  # ±, of the end faces of different rods

    light: float = 0.15  # ±, unevenness of the light over the picture, fixed in the picture
    rim_shading: float = 0.6  # darkening towards the rims, mean over rods and directions; 0 = none
    rim_width: float = 3.0  # [px], the darkening begins this far inside a rim and has half its strength at it

    gap: float = 12.0  # [grey], the backing seen between rods
    gap_texture: float = 4.0  # [grey], ±, its faint texture, fixed in the picture

    bar_thickness: float = 0.012  # [m]
    bar_metal: float = 160.0  # [grey]
    bar_coverage: float = 0.3  # fraction of a bar under marks

    def __post_init__(self) -> None:
        if self.depth not in (8, 16):
            raise ValueError(f"depth must be 8 or 16 bits, not {self.depth}")
        for name in ("pixel_size", "dot_pixels", "rim_width", "bar_thickness", "white"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")
        for name in ("noise", "blur", "black", "gap", "gap_texture", "bar_metal"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} must not be negative, not {getattr(self, name)}")
        for name in ("coverage", "bar_coverage", "light", "rim_shading", "brightness_range"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must be in [0, 1), not {getattr(self, name)}")
        if not 0 < self.dot_diameter[0] <= self.dot_diameter[1] < math.inf:
            raise ValueError(f"dot_diameter must be ascending and positive, not {self.dot_diameter}")

    @property
    def dot_radius(self) -> tuple[float, float]:
        """Smallest and largest radius of a paint dot [px]."""
        smallest, largest = (diameter / (2 * self.pixel_size) for diameter in self.dot_diameter)
        enlargement = max(1.0, self.dot_pixels / (2 * smallest))
        return smallest * enlargement, largest * enlargement


@dataclass(frozen=True, slots=True)
class RodScene:
    """The bodies in front of the camera, in the world coordinates of `experiment.units`.

    `pattern_seed` fixes the paint of every row: a row must be the same rod, of the same radius, in all photographs.
    Bodies may extend beyond the picture.
    """

    width: int  # [px] of the photograph
    height: int  # [px]
    radius: Array  # (n,) [m]
    position: Array  # (n, 2) [m]
    rotation: Array  # (n,) [rad], counter-clockwise
    bars: Array  # (w, 2, 2) [m], segments; the packing lies to the left of endpoint 0 → 1, the bar to the right
    pattern_seed: int


def render_photograph(settings: SpeckleSettings, scene: RodScene, *, noise_seed: int) -> Photograph:
    """Photograph n rods and w bars.

    Parameters
    ----------
    settings : SpeckleSettings
    scene : RodScene
    noise_seed : int
        Seed of this photograph's noise.

    Returns
    -------
    ndarray
        (height, width), uint8 or uint16 according to the depth.

    Raises
    ------
    ValueError
        If shapes are wrong, values are not finite or radii are not positive.
    """
    return expose(settings, render_scene(settings, scene), noise_seed=noise_seed)


def render_scene(settings: SpeckleSettings, scene: RodScene) -> NDArray[np.float32]:
    """Render the light at the sensor before noise and rounding: (height, width) [grey]. Raises ValueError."""
    width, height, pattern_seed = scene.width, scene.height, scene.pattern_seed
    radius, position, rotation, bars = _checked(scene.radius, scene.position, scene.rotation, scene.bars)
    if width < 1 or height < 1:
        raise ValueError(f"a photograph has at least one pixel, not {width} × {height}")
    scale = Scale(settings.pixel_size, height)
    camera = Camera(width, height, settings.blur)
    size = radius / settings.pixel_size
    rods = paint_rods(
        size,
        seed=pattern_seed,
        coverage=settings.coverage,
        dot_radius=settings.dot_radius,
        brightness_range=settings.brightness_range,
    )
    for k, (x, y) in enumerate(scale.to_pixels(position)):
        for tile in camera.tiles((x - size[k], y - size[k]), (x + size[k], y + size[k])):
            draw_rod(
                tile.glow, tile.fraction, *tile.within(x, y), FINE * size[k],
                math.cos(rotation[k]), math.sin(rotation[k]), _dots(rods.paint, k),
                settings.white * rods.brightness[k], settings.black,
                settings.rim_shading * rods.rim[k], rods.tilt[k], FINE * settings.rim_width,
            )  # fmt: skip

    ends = scale.to_pixels(bars)
    span = ends[:, 1] - ends[:, 0]
    length = np.sqrt((span * span).sum(axis=1))
    thickness = settings.bar_thickness / settings.pixel_size
    marks = paint_bars(
        length, thickness, seed=pattern_seed, coverage=settings.bar_coverage, dot_radius=settings.dot_radius
    )
    for k in range(len(bars)):
        along = span[k] / length[k]
        inward = thickness * np.array([-along[1], along[0]])
        corners = np.concatenate([ends[k], ends[k] + inward])
        for tile in camera.tiles(tuple(corners.min(axis=0)), tuple(corners.max(axis=0))):
            draw_bar(
                tile.glow, tile.fraction, *tile.within(*ends[k, 0]), along, FINE * length[k], FINE * thickness,
                _dots(marks, k), settings.bar_metal, settings.black,
            )  # fmt: skip

    backing = paint_backing(width, height, pattern_seed)
    add_backing(camera.light, camera.covered, backing, settings.gap, settings.gap_texture, settings.light)
    return camera.light


def expose(settings: SpeckleSettings, scene: NDArray[np.float32], *, noise_seed: int) -> Photograph:
    """Add the sensor's noise to a scene (height, width) [grey] and round it to the integers of the depth."""
    noise = np.random.default_rng(noise_seed).standard_normal(scene.shape, dtype=np.float32)
    noise *= np.float32(settings.noise)
    noise += scene
    if settings.depth == 16:
        noise *= np.float32(65535 / 255)
        return np.clip(np.rint(noise, out=noise), 0, 65535, out=noise).astype(np.uint16)
    return np.clip(np.rint(noise, out=noise), 0, 255, out=noise).astype(np.uint8)


def _dots(paint: Paint, body: int) -> Array:
    return paint.dots[paint.offset[body] : paint.offset[body + 1]]


def _checked(radius: Array, position: Array, rotation: Array, bars: Array) -> tuple[Array, Array, Array, Array]:
    radius, position = np.asarray(radius, dtype=np.float64), np.asarray(position, dtype=np.float64)
    rotation, bars = np.asarray(rotation, dtype=np.float64), np.asarray(bars, dtype=np.float64)
    n = len(radius)
    if radius.shape != (n,) or position.shape != (n, 2) or rotation.shape != (n,):
        raise ValueError(
            f"radius (n,), position (n, 2) and rotation (n,) do not fit: "
            f"{radius.shape}, {position.shape}, {rotation.shape}"
        )
    if bars.ndim != 3 or bars.shape[1:] != (2, 2):
        raise ValueError(f"bars must be (w, 2, 2), not {bars.shape}")
    for name, value in (("radius", radius), ("position", position), ("rotation", rotation), ("bars", bars)):
        if not np.isfinite(value).all():
            raise ValueError(f"{name} has values that are not finite")
    if (radius <= 0).any():
        raise ValueError(f"radius must be positive, not {radius.min()}")
    if (bars[:, 0] == bars[:, 1]).all(axis=1).any():
        raise ValueError("a bar's two ends must differ")
    return radius, position, rotation, bars
