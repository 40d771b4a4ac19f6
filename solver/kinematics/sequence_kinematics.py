"""Kinematics of a whole sequence: maps of every photograph, and fluctuations over windows of strain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..bodies.cell import Cell
from ..bodies.grains import Array
from ..bodies.strain import logarithmic_strain, shear_strain
from ..even_subset import even_subset
from ..quantity import Quantity, columns
from .local_density import local_solid_fraction, triangulate
from .local_motion import measure_local_motion
from .mean_field import FLUCTUATION_BINS, excess_kurtosis, fit_mean_field, fluctuation_density
from .shear_bands import find_shear_band, participation
from .spatial_correlation import DISTANCE_BINS, correlate_in_space, correlation_length

VISIBLE = 3.0  # fluctuations over their noise, above which a map shows the packing
MOST_INTERVALS = 12  # of a window, from which its statistics are pooled
_Windows = tuple[NDArray[np.int64], Array, Array, Array, Array, Array, Array, Array]

SAMPLES = 5  # intervals from which the window of the maps is chosen


@dataclass(frozen=True, slots=True)
class SequenceKinematics:
    """Motion of the grains beyond the mean field. Maps of frame k are over the frames k − window … k."""

    window: Annotated[int, Quantity("photographs over which the maps read the motion", since=2, absent=1)]
    gradient: Annotated[
        Array, Quantity("mean displacement gradient ∂u/∂x over the window", dims="frame xy axis", since=2)
    ]
    fluctuation: Annotated[
        Array, Quantity("displacement over the window minus the mean field", "m", "frame grain xy", since=2)
    ]
    shear_strain: Annotated[
        Array,
        Quantity("difference of the principal local strains over the window, the local shear", dims="frame grain",
                 since=2),
    ]  # fmt: skip
    volumetric_strain: Annotated[
        Array, Quantity("trace of the local strain over the window, dilation positive", dims="frame grain", since=2)
    ]
    d2min: Annotated[
        Array, Quantity("mean squared departure of the neighbours from the local field", "m2", "frame grain", since=2)
    ]
    rotation: Annotated[
        Array,
        Quantity("rotation over the window minus that of the local field, counter-clockwise", "rad", "frame grain",
                 since=2),
    ]  # fmt: skip
    solid_fraction: Annotated[
        Array, Quantity("solid fraction of the triangles around a grain; NaN at the edge", dims="frame grain", since=2)
    ]
    in_band: Annotated[
        NDArray[np.bool_], Quantity("whether a grain belongs to a shear band", dims="frame grain", since=2)
    ]
    band_angle: Annotated[
        Array, Quantity("direction of the shear band, counter-clockwise from x; NaN: none", "rad", "frame", since=2)
    ]
    band_thickness: Annotated[Array, Quantity("thickness of the shear band; NaN: none", "m", "frame", since=2)]
    participation: Annotated[
        Array,
        Quantity("participation ratio of the local shear: 1 homogeneous, 1/n one grain", dims="frame", since=2),
    ]  # fmt: skip
    window_frames: Annotated[NDArray[np.int64], Quantity("photographs of a strain window", dims="strain_window",
                                                         since=2)]  # fmt: skip
    window_strain: Annotated[
        Array, Quantity("mean shear strain of the mean field over a window", dims="strain_window", since=2)
    ]
    window_rms: Annotated[
        Array,
        Quantity("rms component of the fluctuations over a window, noise of positions subtracted", "m",
                 "strain_window", since=2),
    ]  # fmt: skip
    window_noise: Annotated[
        Array, Quantity("rms component of fluctuations by the noise of positions alone", "m", "strain_window", since=2)
    ]
    window_kurtosis: Annotated[
        Array, Quantity("excess kurtosis of the components, 0: Gaussian", dims="strain_window", since=2)
    ]
    window_density: Annotated[
        Array,
        Quantity("probability density of the components over their rms", dims="strain_window fluctuation_bin",
                 since=2),
    ]  # fmt: skip
    window_correlation: Annotated[
        Array, Quantity("spatial correlation of the fluctuations", dims="strain_window distance_bin", since=2)
    ]
    window_correlation_length: Annotated[
        Array, Quantity("distance at which it falls below 1/e", "m", "strain_window", since=2)
    ]

    def of_frames(self, frames: slice) -> SequenceKinematics:
        """Return the maps of some frames, with all strain windows."""
        return replace(self, **{name: getattr(self, name)[frames] for name in columns(SequenceKinematics, "frame")})


def measure_kinematics(
    position: Array,
    rotation: Array,
    radius: Array,
    sigma: Array,
    cell: Array | None = None,
) -> SequenceKinematics | None:
    """Measure the kinematics of a sequence; None for fewer than two frames.

    Parameters
    ----------
    position : (f, n, 2)
        Positions [m]; NaN: not seen.
    rotation : (f, n)
        Rotations [rad]; NaN: unknown.
    radius : (n,)
        Radii [m].
    sigma : (f, n)
        Standard deviations [m] of a component of a position.
    cell : (f, 2, 2), optional
        Vectors [m] of the periodic cell.

    Notes
    -----
    Fluctuations u' of the displacements about the mean field, their distributions and correlations over windows of
    strain: F. Radjai & S. Roux, Phys. Rev. Lett. 89, 064302 (2002); G. Combe, V. Richefeu, M. Stasiak & A. P. F. Atman,
    Phys. Rev. Lett. 115, 238301 (2015). D²min: M. L. Falk & J. S. Langer, Phys. Rev. E 57, 7192 (1998).
    """
    frames, count = position.shape[:2]
    if frames < 2 or count == 0:
        return None
    noise = float(np.sqrt(2.0 * np.nanmean(np.where(np.isfinite(position[..., 0]), sigma, np.nan) ** 2)))
    cells = None if cell is None else [Cell.at_rest(each) for each in cell]
    window = _choose_window(position, noise, cells)
    gradient = np.full((frames, 2, 2), np.nan)
    fluctuation = np.full((frames, count, 2), np.nan)
    shear, volumetric, d2min, excess, solid = (np.full((frames, count), np.nan) for _ in range(5))
    in_band = np.zeros((frames, count), np.bool_)
    angle, thickness, moving_fraction = (np.full(frames, np.nan) for _ in range(3))
    for k in range(frames):
        triangle = triangulate(position[k], radius)
        solid[k] = local_solid_fraction(position[k], radius, triangle)
        begin = max(k - window, 0)
        if k == 0:
            continue
        both = None if cells is None else (cells[begin], cells[k])
        field = fit_mean_field(position[begin], position[k], both)
        gradient[k], fluctuation[k] = field.gradient, field.fluctuation
        local = measure_local_motion(position[begin], position[k], radius, both)
        strain = local.strain
        shear[k] = np.hypot(strain[:, 0, 0] - strain[:, 1, 1], strain[:, 0, 1] + strain[:, 1, 0])
        volumetric[k] = np.trace(strain, axis1=1, axis2=2)
        d2min[k] = local.d2min
        excess[k] = rotation[k] - rotation[begin] - local.rotation
        band = find_shear_band(position[k], shear[k], triangle)
        in_band[k], angle[k], thickness[k] = band.member, band.angle, band.thickness
        moving_fraction[k] = participation(shear[k])
    windows = _measure_windows(position, radius, noise, cells)
    return SequenceKinematics(
        window, gradient, fluctuation, shear, volumetric, d2min, excess, solid, in_band, angle, thickness,
        moving_fraction, *windows,
    )  # fmt: skip


def _choose_window(position: Array, noise: float, cells: list[Cell] | None) -> int:
    """Choose the least power of two of photographs over which the fluctuations are VISIBLE times their noise."""
    last = len(position) - 1
    window = 1
    while window < last:
        rms = [_rms(_fluctuations(position, begin, window, cells)) for begin in _begins(last, window, SAMPLES)]
        if np.nanmedian(rms) > VISIBLE * noise:
            break
        window = min(2 * window, last)
    return window


def _measure_windows(position: Array, radius: Array, noise: float, cells: list[Cell] | None) -> _Windows:
    """Measure strain, rms, noise, kurtosis, density, correlation and its length of windows of 1, 2, 4 … photographs."""
    last, diameter = len(position) - 1, 2.0 * float(radius.mean())
    lengths = 2 ** np.arange(int(np.log2(last)) + 1)
    rows = []
    for length in lengths.tolist():
        strains, parts, correlations = [], [], []
        for begin in _begins(last, length, MOST_INTERVALS):
            both = None if cells is None else (cells[begin], cells[begin + length])
            field = fit_mean_field(position[begin], position[begin + length], both)
            strains.append(shear_strain(logarithmic_strain(field.gradient)))
            parts.append(field.fluctuation[np.isfinite(field.fluctuation).all(axis=1)].ravel())
            correlations.append(correlate_in_space(position[begin], field.fluctuation, diameter))
        component, rms = np.concatenate(parts), _rms(np.concatenate(parts))
        table = np.array(correlations)
        known = np.isfinite(table)
        mean = np.where(known, table, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
        correlation = np.where(known.any(axis=0), mean, np.nan)
        rows.append((
            float(np.nanmean(strains)) if np.isfinite(strains).any() else np.nan,
            float(np.sqrt(max(rms**2 - noise**2, 0.0))), noise, excess_kurtosis(component),
            fluctuation_density(component, rms), correlation, diameter * correlation_length(correlation),
        ))  # fmt: skip
    strain, size, of_noise, kurtosis, density, correlation, length = zip(*rows, strict=True)
    return (
        lengths.astype(np.int64), np.array(strain), np.array(size), np.array(of_noise), np.array(kurtosis),
        np.array(density, np.float64).reshape(-1, FLUCTUATION_BINS),
        np.array(correlation, np.float64).reshape(-1, DISTANCE_BINS),
        np.array(length),
    )  # fmt: skip


def _fluctuations(position: Array, begin: int, length: int, cells: list[Cell] | None) -> Array:
    both = None if cells is None else (cells[begin], cells[begin + length])
    found = fit_mean_field(position[begin], position[begin + length], both).fluctuation
    return found[np.isfinite(found).all(axis=1)].ravel()


def _begins(last: int, length: int, count: int) -> list[int]:
    """Return at most `count` first frames of windows, evenly spaced."""
    return even_subset(last - length + 1, count).tolist()


def _rms(component: Array) -> float:
    return float(np.sqrt(np.mean(component**2))) if len(component) else float("nan")
