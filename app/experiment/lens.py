"""How a lens bends a picture, in the two ways in which it is commonly written down.

Both models are functions of pixels (column, row) alone. What they call undistorted pixels are those of an ideal
camera that looks at the same plane; they are the ones that a pixel size turns into metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array

# Newton's method in two unknowns, from the point itself: a lens moves a point by some per cent of its distance.
STEPS = 20
TOLERANCE = 1e-9  # [px]


@dataclass(frozen=True, slots=True)
class OpenCVLens:
    """OpenCV's model: undistorted points, in units of the focal length, are mapped to distorted ones.

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
        """Undistorted pixels (…, 2) to those of the photograph (…, 2)."""
        x, y = (points[..., 0] - self.cx) / self.fx, (points[..., 1] - self.cy) / self.fy
        r2 = x * x + y * y
        radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        bent_x = x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x)
        bent_y = y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y
        return np.stack([self.fx * bent_x + self.cx, self.fy * bent_y + self.cy], axis=-1)

    def undistort(self, points: Array) -> Array:
        """Pixels of the photograph (…, 2) to undistorted ones (…, 2)."""
        return invert(self.distort, points)


@dataclass(frozen=True, slots=True)
class BrownLens:
    """Brown's model in pixels, from the photograph to the undistorted picture (D. C. Brown 1966).

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
        """Pixels of the photograph (…, 2) to undistorted ones (…, 2)."""
        dx, dy = points[..., 0] - self.xc, points[..., 1] - self.yc
        r2 = dx * dx + dy * dy
        radial = r2 * (self.K1 + r2 * (self.K2 + r2 * self.K3))
        rest = 1.0 + self.P3 * r2
        x = points[..., 0] + dx * radial + (self.P1 * (r2 + 2.0 * dx * dx) + 2.0 * self.P2 * dx * dy) * rest
        y = points[..., 1] + dy * radial + (self.P2 * (r2 + 2.0 * dy * dy) + 2.0 * self.P1 * dx * dy) * rest
        return np.stack([x, y], axis=-1)

    def distort(self, points: Array) -> Array:
        """Undistorted pixels (…, 2) to those of the photograph (…, 2)."""
        return invert(self.undistort, points)


Lens = OpenCVLens | BrownLens


def jacobian(function: Callable[[Array], Array], points: Array) -> Array:
    """Derivative (…, 2, 2) of a map of the plane at points (…, 2): row = component, column = direction."""
    half = 0.5
    columns = []
    for axis in np.eye(2):
        columns.append((function(points + half * axis) - function(points - half * axis)) / (2.0 * half))
    return np.stack(columns, axis=-1)


def invert(function: Callable[[Array], Array], points: Array) -> Array:
    """The points (…, 2) [px] that a map of the plane takes to `points` (…, 2) [px], near them.

    NaN stays NaN; so does a point that nothing near it is mapped to, where the model has turned back on itself.
    """
    found = np.array(points, dtype=np.float64)
    for _ in range(STEPS):
        missing = points - function(found)
        left = np.abs(missing[np.isfinite(missing)])
        if left.size == 0 or left.max() < TOLERANCE:
            break
        slope = jacobian(function, found)
        determinant = slope[..., 0, 0] * slope[..., 1, 1] - slope[..., 0, 1] * slope[..., 1, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            step_x = (slope[..., 1, 1] * missing[..., 0] - slope[..., 0, 1] * missing[..., 1]) / determinant
            step_y = (slope[..., 0, 0] * missing[..., 1] - slope[..., 1, 0] * missing[..., 0]) / determinant
        found = found + np.stack([step_x, step_y], axis=-1)
    with np.errstate(invalid="ignore", over="ignore"):
        astray = ~(np.abs(function(found) - points).max(axis=-1) < 1e-3)
    found[astray] = np.nan
    return found
