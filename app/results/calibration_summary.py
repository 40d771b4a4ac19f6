"""What self-calibration found, in numbers for summary.json and in words for a person."""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.bodies.grains import Array
from solver.calibration.calibrate import Calibration

NOTICEABLE = 1.0  # standard deviations: a correction of a wall or of the scale below this is not worth words


def calibration_facts(found: Calibration, walls: tuple[str, ...]) -> dict[str, Any]:
    """Corrections with their standard deviations, and how far touching surfaces were apart before and after [m, rad].

    Standard deviations of centres and radii are rms over grains, of a component and of a radius.
    """
    return {
        "applied": found.applied,
        "verdict": found.verdict,
        "centre_rms": _rms(found.offset),
        "centre_sd": _rms(found.offset_sd),
        "radius_rms": _rms(found.radius),
        "radius_sd": _rms(found.radius_sd),
        "wall": {
            name: {
                "outward": float(found.wall[w]),
                "outward_sd": float(found.wall_sd[w]),
                "tilt": float(found.wall_tilt[w]),
                "tilt_sd": float(found.wall_tilt_sd[w]),
            }
            for w, name in enumerate(walls)
        },
        "pixel_size": found.pixel_size,
        "pixel_size_sd": found.pixel_size_sd,
        "walls_follow_pixel_size": found.walls_follow,
        "lens": found.lens,
        "lens_sd": found.lens_sd,
        "gap_rms_before": found.before.spread,
        "gap_rms_after": found.after.spread,
        "wall_gap_rms_before": found.before.wall_spread,
        "wall_gap_rms_after": found.after.wall_spread,
        "noise_factor": found.noise_factor,
    }


def calibration_lines(facts: dict[str, Any]) -> list[str]:
    """The same in a few sentences."""
    lines = [f"Self-calibration {facts['verdict']}."]
    if not facts["applied"]:
        return [*lines, *_scale_line(facts)]
    centre, radius = _pair(facts, "centre"), _pair(facts, "radius")
    lines.append(
        f"Corrected (rms ± standard deviation of what is left): centres by {centre} µm, radii by {radius} µm"
        f"{_walls(facts['wall'])}."
    )
    lines += _scale_line(facts)
    if facts["lens"] != 0.0:
        lines.append(
            f"Lens: what is left of its radial distortion moves the farthest corner by {1e6 * facts['lens']:+.0f} ± "
            f"{1e6 * facts['lens_sd']:.0f} µm outward of where it was seen."
        )
    lines.append(
        f"Distance of touching surfaces from contact, before → after: between grains "
        f"{_micro(facts['gap_rms_before'])} → {_micro(facts['gap_rms_after'])} µm rms, at walls "
        f"{_micro(facts['wall_gap_rms_before'])} → {_micro(facts['wall_gap_rms_after'])} µm rms."
    )
    return lines


def _scale_line(facts: dict[str, Any]) -> list[str]:
    value, sd = 100 * facts["pixel_size"], 100 * facts["pixel_size_sd"]
    if sd == 0.0:
        return []  # it was not asked for: nothing to say
    if value == 0.0:
        return [f"Pixel size: as given, in agreement with the known radii within ± {sd:.2f} %."]
    walls = "the walls were measured with it and follow" if facts["walls_follow_pixel_size"] else "the walls stay"
    return [f"Pixel size: {value:+.2f} ± {sd:.2f} % from the known radii; {walls}."]


def _walls(walls: dict[str, dict[str, float]]) -> str:
    said = []
    for name, wall in walls.items():
        words = []
        if abs(wall["outward"]) > NOTICEABLE * wall["outward_sd"]:
            words.append(f"{1e6 * wall['outward']:+.0f} ± {1e6 * wall['outward_sd']:.0f} µm outward")
        if abs(wall["tilt"]) > NOTICEABLE * wall["tilt_sd"]:
            words.append(f"turned by {1e3 * wall['tilt']:+.2f} ± {1e3 * wall['tilt_sd']:.2f} mrad")
        if words:
            said.append(f"wall {name} {' and '.join(words)}")
    return "".join(f", {words}" for words in said)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else 0.0


def _pair(facts: dict[str, Any], part: str) -> str:
    return f"{_micro(facts[f'{part}_rms'])} ± {_micro(facts[f'{part}_sd'])}"


def _micro(metres: float) -> str:
    return f"{1e6 * metres:.1f}"
