"""Two common models of lens distortion: OpenCV's and Brown's.

Both models are functions of pixels (column, row) alone. Undistorted pixels are those of an ideal camera that looks at
the same plane; a pixel size converts them to metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..solver.bodies.grains import Array

# Newton's method in two unknowns starts at the point itself: a lens moves a point by some per cent of its distance.
MAX_STEPS = 20
TOLERANCE = 1e-9  # [px]


@dataclass(frozen=True, slots=True)
class OpenCVLens:
    """OpenCV's model, which maps undistorted points, in units of the focal length, to distorted ones.

    Notes
    -----
    x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²), y' with p1, p2 and x, y exchanged (OpenCV
    documentation, camera calibration). The undistorted picture keeps the camera's own matrix.
    """

    fx: float  # [px] focal length along rows
    fy: float  # [px] along columns
    cx: float  # [px] column of the optical axis
    cy: float  # [px] its row
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def distort(self, points: Array) -> Array:
        """Convert undistorted pixels (…, 2) to those of the photograph (…, 2)."""
        x, y = (points[..., 0] - self.cx) / self.fx, (points[..., 1] - self.cy) / self.fy
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        bent_x = x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x)
        bent_y = y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y
        return np.stack([self.fx * bent_x + self.cx, self.fy * bent_y + self.cy], axis=-1)

    def undistort(self, points: Array) -> Array:
        """Convert pixels of the photograph (…, 2) to undistorted ones (…, 2)."""
        return invert(self.distort, points)


@dataclass(frozen=True, slots=True)
class BrownLens:
    """Brown's model in pixels, from the photograph to the undistorted picture (D. C. Brown 1966).

    Notes
    -----
    With dx, dy from the centre, x_u = x + dx (K1 r² + K2 r⁴ + K3 r⁶) + (P1 (r² + 2 dx²) + 2 P2 dx dy)(1 + P3 r²) and
    y_u with P1, P2 and dx, dy exchanged: the convention of the p-tracker program. K1 is in 1/px², K2 in 1/px⁴, K3 in
    1/px⁶, P1 and P2 in 1/px, P3 in 1/px².
    """

    xc: float  # [px] column of the centre of distortion
    yc: float  # [px] its row
    K1: float = 0.0
    K2: float = 0.0
    K3: float = 0.0
    P1: float = 0.0
    P2: float = 0.0
    P3: float = 0.0

    def undistort(self, points: Array) -> Array:
        """Convert pixels of the photograph (…, 2) to undistorted ones (…, 2)."""
        dx, dy = points[..., 0] - self.xc, points[..., 1] - self.yc
        r2 = dx * dx + dy * dy
        radial = r2 * (self.K1 + r2 * (self.K2 + r2 * self.K3))
        rest = 1.0 + self.P3 * r2
        x = points[..., 0] + dx * radial + (self.P1 * (r2 + 2.0 * dx * dx) + 2.0 * self.P2 * dx * dy) * rest
        y = points[..., 1] + dy * radial + (self.P2 * (r2 + 2.0 * dy * dy) + 2.0 * self.P1 * dx * dy) * rest
        return np.stack([x, y], axis=-1)

    def distort(self, points: Array) -> Array:
        """Convert undistorted pixels (…, 2) to those of the photograph (…, 2)."""
        return invert(self.undistort, points)


Lens = OpenCVLens | BrownLens


def jacobian(function: Callable[[Array], Array], points: Array) -> Array:
    """Return the derivative (…, 2, 2) of a map of the plane at points (…, 2): row = component, column = direction."""
    half = 0.5
    columns = []
    for axis in np.eye(2):
        columns.append((function(points + half * axis) - function(points - half * axis)) / (2.0 * half))
    return np.stack(columns, axis=-1)


def invert(function: Callable[[Array], Array], points: Array) -> Array:
    """Return the points (…, 2) [px] that a map of the plane maps to `points` (…, 2) [px], near them.

    NaN stays NaN. A point without a preimage nearby, where the model folds back on itself, gives NaN.
    """
    found = np.array(points, dtype=np.float64)
    for _ in range(MAX_STEPS):
        missing = points - function(found)
        residual = np.abs(missing[np.isfinite(missing)])
        if residual.size == 0 or residual.max() < TOLERANCE:
            break
        slope = jacobian(function, found)
        determinant = slope[..., 0, 0] * slope[..., 1, 1] - slope[..., 0, 1] * slope[..., 1, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            step_x = (slope[..., 1, 1] * missing[..., 0] - slope[..., 0, 1] * missing[..., 1]) / determinant
            step_y = (slope[..., 0, 0] * missing[..., 1] - slope[..., 1, 0] * missing[..., 0]) / determinant
        found = found + np.stack([step_x, step_y], axis=-1)
    with np.errstate(invalid="ignore", over="ignore"):
        diverged = ~(np.abs(function(found) - points).max(axis=-1) < 1e-3)
    found[diverged] = np.nan
    return found
