"""Quantities that depend on direction: the rose of contacts and forces, and the stress."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes

from ..results.results import Results
from ..solver.bodies.grains import Array
from .figure_style import BLUE, DASHES, INK, VERMILION, Width, add_title, new_figure

BINS = 36


def draw_rose(results: Results, frame: int, width: Width) -> Figure:
    """Draw the angular densities of contacts between grains and of their normal forces, over the isotropic density."""
    forces, here = results.frames[frame], results.statistics[frame]
    figure = new_figure(width, 1.12)
    axes = _polar(figure)
    between = (forces.fn > 0) & ~forces.contacts.with_wall
    normal, fn = forces.contacts.normal[between], forces.fn[between]
    bearing = np.ones(len(fn)) if forces.bearing_probability is None else forces.bearing_probability[between]
    for (name, weight), colour, dash in zip(
        (("contacts", bearing), ("normal forces", bearing * fn)), (BLUE, VERMILION), DASHES, strict=False
    ):
        density = _direction_density(normal, weight)
        edges = np.linspace(0.0, 2.0 * np.pi, BINS + 1)
        axes.stairs(density, edges, baseline=None, color=colour, linestyle=dash, label=name)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    axes.plot(angle, np.ones(181), color=INK, linewidth=0.6, label="isotropic")
    axes.axvline(here.principal_direction, color=INK, linestyle=":", linewidth=0.8)
    axes.axvline(here.principal_direction + np.pi, color=INK, linestyle=":", linewidth=0.8, label="σ$_1$")
    figure.legend(loc="outside lower center", ncols=4)
    figure.suptitle(f"{results.name}, frame {frame}: contacts between grains", x=0.02, ha="left", fontsize=7.0)
    return figure


def draw_stress(results: Results, frame: int, width: Width) -> Figure:
    """Draw Mohr's circle of the stress of one frame, and the principal stresses over time."""
    figure = new_figure(width, 0.55 if width == "double" else 1.05)
    pair = figure.subplots(1, 2) if width == "double" else figure.subplots(2, 1)
    circle, history = pair
    here = results.statistics[frame]
    major, minor = 1e-3 * here.sigma_1, 1e-3 * here.sigma_2
    angle = np.linspace(0.0, np.pi, 91)
    middle, radius = 0.5 * (major + minor), 0.5 * (major - minor)
    circle.plot(middle + radius * np.cos(angle), radius * np.sin(angle), color=BLUE)
    reach = np.array([0.0, major])
    label = rf"$\varphi$ = {np.degrees(here.friction_angle):.1f}°"
    circle.plot(reach, reach * np.tan(here.friction_angle), color=VERMILION, linestyle=DASHES[1], label=label)
    circle.set(
        xlim=(0.0, 1.06 * major), ylim=(0.0, 0.5 * major), xlabel="normal stress [kPa]", ylabel="shear stress [kPa]"
    )
    circle.set_aspect("equal", adjustable="box")
    circle.legend(loc="upper left")
    add_title(circle, f"{results.name}, frame {frame}: direction of σ$_1$ {np.degrees(here.principal_direction):.0f}°")
    time = results.tracks.time
    for name, values, colour, dash in (
        ("σ$_1$", [each.sigma_1 for each in results.statistics], BLUE, DASHES[0]),
        ("σ$_2$", [each.sigma_2 for each in results.statistics], VERMILION, DASHES[1]),
    ):
        history.plot(time, 1e-3 * np.array(values), color=colour, linestyle=dash, label=name)
    history.axvline(time[frame], color=INK, linewidth=0.5)
    history.set(xlabel="time [s]", ylabel="principal stress [kPa]", ylim=(0.0, None))
    history.legend()
    return figure


def _polar(figure: Figure) -> PolarAxes:
    axes = figure.add_subplot(projection="polar")
    assert isinstance(axes, PolarAxes)
    axes.set_yticks([1.0])
    axes.set_yticklabels([])
    axes.grid(linewidth=0.4)
    axes.spines["polar"].set_visible(False)
    return axes


def _direction_density(normal: Array, weight: Array) -> Array:
    """Return the angular density (BINS,) of normals (c, 2) and their opposites, over the isotropic density."""
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    both = np.mod(np.concatenate([angle, angle + np.pi]), 2.0 * np.pi)
    counts, _ = np.histogram(both, BINS, (0.0, 2.0 * np.pi), weights=np.tile(weight, 2))
    return counts * BINS / max(float(counts.sum()), 1e-300)
