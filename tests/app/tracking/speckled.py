"""Speckled rods on a grid, whose poses in pixels are known exactly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from rodsight.experiment.units import Scale
from rodsight.solver.bodies.grains import Array
from rodsight.synthetic.speckle import RodScene, SpeckleSettings, render_photograph

PIXEL_SIZE = 2.5e-4  # [m]


@dataclass(frozen=True, slots=True)
class Rods:
    """Rods in a photograph. Poses are those of the picture: y down, angles from x towards y."""

    width: int
    height: int
    x: Array  # (n,) [px]
    y: Array  # (n,) [px]
    radius: Array  # (n,) [px]
    settings: SpeckleSettings
    bars: Array = field(default_factory=lambda: np.empty((0, 2, 2)))  # (w, 2, 2) [m]

    @property
    def count(self) -> int:
        return len(self.x)

    def photograph(self, x: Array, y: Array, rotation: Array, *, noise_seed: int, pattern_seed: int = 3) -> np.ndarray:
        scale = Scale(self.settings.pixel_size, self.height)
        return render_photograph(
            self.settings,
            RodScene(
                width=self.width,
                height=self.height,
                radius=self.radius * self.settings.pixel_size,
                position=scale.to_world(np.stack([x, y], axis=1)),
                rotation=scale.angle_to_world(rotation),
                bars=self.bars,
                pattern_seed=pattern_seed,
            ),
            noise_seed=noise_seed,
        )

    def reference(self) -> np.ndarray:
        return self.photograph(self.x, self.y, np.zeros(self.count), noise_seed=1).astype(np.float32)

    def moved(
        self, dx: Array | float, dy: Array | float, rotation: Array | float, *, noise_seed: int = 2
    ) -> np.ndarray:
        angle = np.broadcast_to(np.asarray(rotation, dtype=np.float64), self.x.shape)
        return self.photograph(self.x + dx, self.y + dy, angle, noise_seed=noise_seed).astype(np.float32)


def grid_of_rods(
    columns: int, rows: int, *, radius: float, pitch: float, margin: float, seed: int = 0, **settings: object
) -> Rods:
    """Place columns × rows rods of one radius [px], each displaced by a random fraction of a pixel."""
    generator = np.random.default_rng(seed)
    column, row = np.meshgrid(np.arange(columns), np.arange(rows))
    x = margin + pitch * column.ravel() + generator.uniform(-0.5, 0.5, columns * rows)
    y = margin + pitch * row.ravel() + generator.uniform(-0.5, 0.5, columns * rows)
    width = int(np.ceil(2 * margin + pitch * (columns - 1)))
    height = int(np.ceil(2 * margin + pitch * (rows - 1)))
    settings_given = {"pixel_size": PIXEL_SIZE, "noise": 2.5, **settings}
    return Rods(width, height, x, y, np.full(len(x), radius), SpeckleSettings(**settings_given))  # type: ignore[arg-type]
