"""Kinematics of a run: maps of one frame, and fluctuations about the mean field over windows of strain."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ..results.results import Results
from ..solver.bodies.grains import Array
from ..solver.even_subset import even_subset
from ..solver.kinematics.mean_field import FLUCTUATION_EDGES
from ..solver.kinematics.sequence_kinematics import SequenceKinematics
from ..solver.kinematics.spatial_correlation import DISTANCE_EDGES
from .figure_style import (
    BLUE,
    COLOURS,
    DASHES,
    INK,
    OUTLINE,
    VERMILION,
    NothingToDrawError,
    Width,
    add_title,
    new_figure,
)
from .force_network import bounds_of, draw_packing

TOP_QUANTILE = 0.99  # of a quantity over the grains: above it the colour is constant
LONGEST_ARROW = 2.0  # mean radii, of the rms fluctuation
SHOWN_WINDOWS = 4  # whose distributions are drawn
LABELLED = 0.42  # of the width of a map, for its title and its scale
SIGNED = "cividis"  # blue, grey, yellow: of monotonic lightness, so that signs differ in grey and for everybody


def draw_kinematics(results: Results, frame: int, width: Width) -> Figure:
    """Draw local shear with fluctuations, D²min and rotations of a frame; distribution and correlation over windows.

    Raises
    ------
    NothingToDrawError
        The run has no kinematics: it was solved by an earlier version, or has one frame.
    """
    found = results.kinematics
    if found is None:
        raise NothingToDrawError("this run has no kinematics: solve it again")
    frame = max(frame, 1)
    shape = (1, 4) if width == "double" else (2, 2)
    low, high = bounds_of(results)
    tall = float((high - low)[1] / (high - low)[0]) + LABELLED
    heights = (0.23 * tall, 0.32) if width == "double" else (0.9 * tall, 1.05)
    figure = new_figure(width, sum(heights))
    # Maps and curves have margins of their own: those of the curves' labels would make the maps small.
    grid = figure.add_gridspec(2, 1, height_ratios=heights)
    parts = [figure.add_subfigure(grid[row]) for row in range(2)]
    panels = [axes for part in parts for axes in part.subplots(*shape).ravel()]
    maps = (
        (found.shear_strain[frame], "magma_r", "local shear strain", False),
        (np.sqrt(found.d2min[frame]) * 1e6, "viridis_r", "√D²$_{min}$ [µm]", False),
        (np.degrees(found.rotation[frame]), SIGNED, "rotation [°]", True),
    )
    _draw_fluctuations(panels[0], results, frame, found)
    for axes in panels[:4]:
        axes.set_anchor("N")
    for axes, (value, colours, label, signed) in zip(panels[1:4], maps, strict=True):
        draw_map(axes, results, frame, value, colours, label, signed=signed)
    add_title(panels[0], f"{results.name}, frames {max(frame - found.window, 0)} to {frame}\nfluctuations")
    add_title(panels[1], _describe_band(found, frame, results))
    add_title(panels[2], "departure of the neighbours\nfrom the local field")
    add_title(panels[3], "rotation minus that\nof the local field")
    _draw_distribution(panels[4], found)
    _draw_correlation(panels[5], found)
    parts[1].legend(
        *panels[4].get_legend_handles_labels(),
        loc="outside upper left",
        ncols=5 if width == "double" else 2,
        fontsize=5.5,
    )
    _draw_growth(panels[6], found, 2.0 * float(results.tracks.radius.mean()))
    _draw_localisation(panels[7], results, found)
    return figure


def draw_map(axes: Axes, results: Results, frame: int, value: Array, colours: str, label: str, *, signed: bool) -> None:
    """Draw a quantity (n,) of the grains of a frame by colour, with its scale."""
    draw_packing(axes, results, frame)
    here = results.tracks.present[frame]
    known = value[here & np.isfinite(value)]
    top = float(np.quantile(np.abs(known), TOP_QUANTILE)) if len(known) else 1.0
    place, size = results.tracks.position[frame, here], 2.0 * results.tracks.radius[here]
    rods = EllipseCollection(
        size, size, np.zeros(len(size)), units="xy", offsets=place, offset_transform=axes.transData,
        cmap=colormaps[colours].with_extremes(bad="#f4f4f4"), norm=Normalize(-top if signed else 0.0, top),
        edgecolor=OUTLINE, linewidth=0.2, zorder=1,
    )  # fmt: skip
    rods.set_array(np.ma.masked_invalid(value[here]))
    axes.add_collection(rods)
    bar = axes.figure.colorbar(
        rods, ax=axes, location="bottom", shrink=0.85, aspect=22, pad=0.02, extend="both" if signed else "max"
    )
    bar.set_label(label)
    bar.ax.locator_params(nbins=2)


def _draw_fluctuations(axes: Axes, results: Results, frame: int, found: SequenceKinematics) -> None:
    """Draw fluctuations as arrows, their rms LONGEST_ARROW mean radii long."""
    draw_packing(axes, results, frame)
    vector, place = found.fluctuation[frame], results.tracks.position[frame]
    known = np.isfinite(vector).all(axis=1)
    rms = float(np.sqrt(np.mean(np.sum(vector[known] ** 2, axis=1)))) if known.any() else 0.0
    if rms > 0.0:
        scale = rms / (LONGEST_ARROW * float(results.tracks.radius.mean()))
        axes.quiver(
            *place[known].T, *vector[known].T, angles="xy", scale_units="xy", scale=scale, width=6e-3, color=BLUE,
            zorder=3,
        )  # fmt: skip


def _shown_windows(found: SequenceKinematics) -> list[int]:
    count = len(found.window_frames)
    return even_subset(count, SHOWN_WINDOWS).tolist()


def _draw_distribution(axes: Axes, found: SequenceKinematics) -> None:
    middle = 0.5 * (FLUCTUATION_EDGES[1:] + FLUCTUATION_EDGES[:-1])
    for w, colour, dash in zip(_shown_windows(found), COLOURS, DASHES, strict=False):
        label = f"strain {found.window_strain[w]:.2g}"
        axes.plot(middle, _positive(found.window_density[w]), color=colour, linestyle=dash, label=label)
    axes.plot(middle, np.exp(-0.5 * middle**2) / np.sqrt(2.0 * np.pi), color=INK, linewidth=0.6, label="Gaussian")
    axes.set(yscale="log", ylim=(1e-4, 1.5), xlabel="fluctuation over rms", ylabel="density")
    add_title(axes, "distribution")


def _draw_correlation(axes: Axes, found: SequenceKinematics) -> None:
    middle = 0.5 * (DISTANCE_EDGES[1:] + DISTANCE_EDGES[:-1])
    for w, colour, dash in zip(_shown_windows(found), COLOURS, DASHES, strict=False):
        axes.plot(middle, found.window_correlation[w], color=colour, linestyle=dash)
    axes.axhline(0.0, color=INK, linewidth=0.5)
    axes.set(xlabel="distance over d", ylabel="correlation C(r)", ylim=(-0.6, 1.0))
    add_title(axes, "spatial correlation")


def _draw_growth(axes: Axes, found: SequenceKinematics, diameter: float) -> None:
    """Draw rms fluctuations over d times the strain, and the kurtosis, over the strain of the window."""
    strain = found.window_strain
    with np.errstate(divide="ignore", invalid="ignore"):
        axes.plot(strain, found.window_rms / (diameter * strain), "o-", color=BLUE)
    axes.set(xscale="log", xlabel="strain of the window", ylim=(0.0, None))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel("rms / (d · strain)", color=BLUE)
    other = axes.twinx()
    other.plot(strain, found.window_kurtosis, "s--", color=VERMILION)
    other.set_ylim(min(0.0, 1.1 * float(np.nanmin(found.window_kurtosis))), None)
    other.set_ylabel("excess kurtosis", color=VERMILION)
    other.spines["right"].set_visible(True)
    noisy = found.window_noise > found.window_rms
    add_title(axes, f"{noisy.sum()} windows below the noise" if noisy.any() else "size and shape")


def _draw_localisation(axes: Axes, results: Results, found: SequenceKinematics) -> None:
    """Draw the participation ratio of the local shear and the mean local solid fraction over time."""
    time = results.tracks.time
    axes.plot(time, found.participation, color=BLUE)
    axes.set(xlabel="time [s]", ylim=(0.0, 1.0))
    axes.set_ylabel("participation of shear", color=BLUE)
    known = np.isfinite(found.solid_fraction)
    mean = np.where(known, found.solid_fraction, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    other = axes.twinx()
    other.plot(time, mean, "--", color=VERMILION)
    other.set_ylabel("solid fraction", color=VERMILION)
    other.spines["right"].set_visible(True)
    add_title(axes, "1: homogeneous")


def _describe_band(found: SequenceKinematics, frame: int, results: Results) -> str:
    if not np.isfinite(found.band_angle[frame]):
        return f"no shear band\nparticipation {found.participation[frame]:.2f}"
    thickness = found.band_thickness[frame] / (2.0 * float(results.tracks.radius.mean()))
    return f"shear band at {np.degrees(found.band_angle[frame]):.0f}°,\n{thickness:.1f} d thick"


def _positive(density: Array) -> Array:
    return np.where(density > 0, density, np.nan)
