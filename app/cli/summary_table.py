"""The summary at the end of a run: frames as a table, and their accuracy in sentences."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ..process.counts import state_count
from ..results.finding import Finding
from ..solver.assessment.reasons import split_reasons
from ..solver.convex.friction_check import LEAST_SLIDING
from ..solver.even_subset import even_subset
from ..solver.frame_forces import FrameStatus

STATUS_STYLE = {
    FrameStatus.SETTLED: "green",
    FrameStatus.SETTLING: "yellow",
    FrameStatus.REARRANGING: "magenta",
    FrameStatus.SUSPECT: "red",
    FrameStatus.RESET: "cyan",
    FrameStatus.FAILED: "bold red",
}
NOTICEABLE = 1.0  # [standard deviation]: smaller corrections of a wall are not reported
MAX_ROWS = 40  # frames in the terminal's table; more are thinned evenly
MOST_PENALTIES = 3  # reasons of the lowest trust that are listed


def print_summary(console: Console, summary: dict[str, Any]) -> None:
    """Print the frames as a table, and the accuracy below it."""
    console.print(frame_table(summary))
    if summary.get("out_of_date"):
        console.print(f"[bold red]Out of date:[/] {escape('; '.join(summary['out_of_date']))}.", highlight=False)
    for line in trust_lines(summary):
        console.print(line, highlight=False)


def inferred_line(count: int) -> str:
    """State how many rods no photograph shows."""
    if count == 1:
        return "1 rod that is in no photograph was inferred from its neighbours."
    return f"{count} rods that are in no photograph were inferred from their neighbours."


def trust_lines(summary: dict[str, Any]) -> list[str]:
    """Describe accuracy, events and corrections in sentences."""
    count = summary["status_count"]
    settled, total = count.get("settled", 0), summary["frame_count"]
    after = summary["settled_after"]
    how_many = f"{settled} of {state_count(total, 'frame')} {'is' if settled == 1 else 'are'} settled"
    lines = [
        f"[bold]{state_count(summary['grain_count'], 'grain')}, {state_count(total, 'frame')}.[/] "
        + (f"Settled from frame {after}; {how_many}." if settled else "No frame settled.")
    ]
    events = [
        f"{label} at frame{'s' if len(summary[key]) > 1 else ''} {_listed(summary[key])}"
        for key, label in (("resets", "reset"), ("rearrangements", "rearrangement"), ("suspects", "suspect"))
        if summary[key]
    ]
    if events:
        lines.append("Events: " + "; ".join(events) + ".")
    lines += _failure_lines(summary["failures"])
    poses, grains = state_count(summary["lost_poses"], "pose"), state_count(summary["lost_grains"], "grain")
    lost = f"{poses} of {grains} lost" if summary["lost_poses"] else ""
    suspect = f"{state_count(summary['suspect_poses'], 'pose')} suspect" if summary["suspect_poses"] else ""
    border = "cut by the picture's border"
    cut = f"{state_count(summary['cut_grains'], 'rod')} {border}" if summary.get("cut_grains") else ""
    tracked = ", ".join(part for part in (lost, suspect, cut) if part) or "every grain has a pose in every frame"
    worst = _cell(summary["worst_unbalance"], ".2g")
    lines.append(
        f"Greatest force residual of a grain {worst} of the mean force "
        f"(frame {summary['worst_unbalance_frame']}); {tracked}."
    )
    trusted = [t for t, s in zip(summary["trust"], summary["status"], strict=True) if s == "settled" and t is not None]
    if trusted:
        lines.append(
            f"Trust (lower bound of the correlation with the true forces): {min(trusted):.2f} to "
            f"{max(trusted):.2f} over settled frames."
        )
    for each in map(Finding.of_plain, summary.get("diagnosis", [])):
        kind = "[bold]Corrected by the run:[/] " if each.corrected else "[bold red]Something is wrong:[/] "
        lines.append(kind + escape(each.sentence()))
    lines += _sd_line(summary) + budget_lines(summary) + penalty_lines(summary)
    lines += [load_line(each) for each in summary.get("loads", [])]
    scale = [each for each in summary.get("scale_sd", []) if each is not None]
    if scale:
        lines.append(f"Scale of all forces: standard deviation {100 * np.median(scale):.0f} % (median over frames).")
    if summary.get("weight") and not summary["loaded_walls"]:
        lines.append(weight_line(summary))
    elif not summary["loaded_walls"]:
        lines.append(
            "[bold]No wall has a given pressure:[/] forces are known up to a scale, which differs between frames."
        )
    friction = summary["friction"]
    if friction is not None and friction["enclosed"]:
        lines.append(friction_line(friction, [each["cause"] for each in summary.get("diagnosis", [])]))
    elif friction is not None and friction.get("sliding") is not None and friction["sliding"] < LEAST_SLIDING:
        lines.append(hidden_friction_line(friction["sliding"]))
    if summary.get("base_friction"):
        lines.append(f"Friction of the base that was used: {summary['base_friction']:.3g}.")
    if friction is not None and friction["walls"][0] is not None:
        measured, low, high = (_cell(value, ".2f") for value in friction["walls"])
        lines.append(f"Friction of the walls from the motion: {measured} ({low} to {high}), which was used.")
    if summary["wall_force_error"]:
        errors = ", ".join(f"{name} {100 * error:.0f} %" for name, error in summary["wall_force_error"].items())
        lines.append(f"Inferred against recorded wall forces, rms difference over settled frames: {errors}.")
    if summary["corrections"] is not None:
        lines += calibration_lines(summary["corrections"])
    lines += [f"Boundary: {each}." for each in summary.get("boundary") or []]
    if summary.get("inferred_grains"):
        lines.append(inferred_line(summary["inferred_grains"]))
    if summary["radius_change"] is not None:
        lines.append(_curve_line(summary["radius_curve"]))
        lines.append(
            f"All radii changed by {summary['radius_change'] * 1e6:+.1f} µm for the specified coordination number."
        )
    if "accuracy" in summary:
        first = min(5, total - 1)
        late = [value for value in summary["accuracy"]["r_fn"][first:] if value is not None]
        late_t = [value for value in summary["accuracy"]["r_ft"][first:] if value is not None]
        if late and late_t:
            lines.append(
                f"[bold]Against the truth, from frame {first} on: r(f_n) {np.mean(late):.3f} (least {min(late):.3f}), "
                f"r(f_t) {np.mean(late_t):.3f}.[/]"
            )
    return lines


def hidden_friction_line(sliding: float) -> str:
    """State that the motion does not show the friction, by the fraction of contacts that slide by more than noise."""
    seen = f"{100.0 * sliding:.0f} % of the contacts slide by more than 1.5 standard deviations"
    return f"The motion does not show the friction: {seen} of noise, by noise alone 13 %."


def friction_line(friction: dict[str, Any], causes: list[str]) -> str:
    """State the friction that fits the motion; it is that of the rods unless other causes of wrong forces are named."""
    measured, low, high = (_cell(friction[key], ".2f") for key in ("measured", "low", "high"))
    if friction["agrees"]:
        verdict = f"which agrees with the given {friction['given']:g}"
    elif causes and "friction" not in causes:
        verdict = "which is not that of the rods: something else is wrong"
    else:
        verdict = f"which [bold red]contradicts[/] the given {friction['given']:g}"
    return f"Friction from the motion: {measured} ({low} to {high}), {verdict}."


# Statistics with a reported standard deviation: name, label, factor, unit, format.
REPORTED_SDS = (
    ("friction_angle", "friction angle", 180.0 / np.pi, "°", ".1f"),
    ("principal_direction", "direction of σ₁", 180.0 / np.pi, "°", ".1f"),
    ("coordination_number", "z", 1.0, "", ".2f"),
    ("sliding_fraction", "fraction of sliding contacts", 1.0, "", ".2f"),
)


def _sd_line(summary: dict[str, Any]) -> list[str]:
    """Report one standard deviation of statistics and forces, median of the frames that have one."""
    parts = []
    for name, label, factor, unit, form in REPORTED_SDS:
        known = [value for value in summary.get("deviations", {}).get(name, []) if value is not None]
        if known:
            parts.append(f"{label} ± {factor * np.median(known):{form}}{unit}")
    forces = [value for value in summary.get("fn_deviation", []) if value is not None]
    if forces:
        parts.append(f"one f_n ± {np.median(forces):.2f} of the mean f_n")
    return [f"One standard deviation, median of the frames: {', '.join(parts)}."] if parts else []


LARGEST_CAUSE = {
    "positions": "positions and rotations", "radii": "radii and centres", "friction": "the coefficient of friction",
    "contacts": "the roughness of surfaces, which decides on uncertain contacts",
    "steps": "the step between photographs",
}  # fmt: skip


def budget_lines(summary: dict[str, Any]) -> list[str]:
    """Describe the error of the forces, its causes and the effect of halving the largest one; means over frames."""
    budget = summary.get("error_budget")
    if not budget:
        return []
    known = [each for each in budget["relative_error"] if each is not None]
    if not known:
        return []
    fraction = {
        name: float(np.mean([each for each in values if each is not None])) for name, values in budget["share"].items()
    }
    error = 100.0 * float(np.mean(known))
    causes = ", ".join(f"{name} {100.0 * part:.0f} %" for name, part in fraction.items())
    worst = max(LARGEST_CAUSE, key=lambda name: fraction.get(name, 0.0))
    after = error * float(np.sqrt(1.0 - 0.75 * fraction[worst]))
    return [
        f"Error budget: the forces have an error of {error:.0f} % (relative L2); of the variance {causes}.",
        f"Halving the error of {LARGEST_CAUSE[worst]} would reduce it to {after:.1f} % from {error:.1f} %.",
    ]


def load_line(load: dict[str, Any]) -> str:
    """State the load on a wall in newtons, which sets the scale of the forces."""
    wall, force = escape(load["wall"]), load["force"]
    rest = 1.0 - load.get("fraction_on_free_rods", 1.0)
    part = f" Rods of the boundary are on {100.0 * rest:.0f} % of its width." if rest > 0.0 else ""
    if load["pressure"] is None:
        low, high = load["range"]
        return f"Load on '{wall}', measured: {force:.4g} N in the mean ({low:.4g} to {high:.4g} N).{part}"
    parts = f"{load['pressure'] / 1e3:.4g} kPa × {load['width']:.4g} m × {load['length']:.3g} m"
    return f"Load on '{wall}': {parts} = {force:.4g} N; it sets the scale of all forces.{part}"


def weight_line(summary: dict[str, Any]) -> str:
    """State the weight of the rods, and which walls add a force that is not given to it."""
    weight = f"No wall has a given load: the weight of the rods, {summary['weight']:.3g} N, sets the scale"
    added = [f"'{escape(wall)}' {ratio:.2g} times" for wall, ratio in summary.get("walls_above", {}).items()]
    if not added:
        return f"{weight}."
    return (
        f"{weight}, but walls above press on them with a force that is not given ({', '.join(added)} the weight, by "
        "these forces): only sliding determines it. Give their load."
    )


def penalty_lines(summary: dict[str, Any]) -> list[str]:
    """State the lowest trust, and the largest penalties there, or of the least trusted frame that has some."""
    known = [(t, k) for k, t in enumerate(summary["trust"]) if t is not None]
    if not known:
        return []
    trust, frame = min(known)
    reasons = summary.get("trust_penalties", [])
    penalised = [(t, k) for t, k in known if any(reasons[k : k + 1])]
    if not penalised:
        return []
    least, of = min(penalised)
    other = "" if of == frame else f"; {least:.2f} in frame {of}"
    named = split_reasons(reasons[of])
    left = len(named) - MOST_PENALTIES
    more = [f"- {state_count(left, 'smaller reason')}: see the tab Summary of the recording"] if left > 0 else []
    shown = [f"- {escape(each)}" for each in named[:MOST_PENALTIES]]
    return [f"Lowest trust {trust:.2f} in frame {frame}{other}, because", *shown, *more]


def _failure_lines(failures: dict[int, str]) -> list[str]:
    """List the failed frames by reason."""
    frames: dict[str, list[int]] = {}
    for frame, reason in failures.items():
        frames.setdefault(reason, []).append(frame)
    return [
        f"[bold red]Frame{'s' if len(at) > 1 else ''} {_listed(at)} failed[/], without forces: {escape(reason)}."
        for reason, at in frames.items()
    ]


def calibration_lines(facts: dict[str, Any]) -> list[str]:
    """Describe the self-calibration in sentences."""
    lines = [f"Self-calibration {facts['verdict']}."]
    if not facts["applied"]:
        return [*lines, *_scale_line(facts)]
    centre, radius = _pair(facts, "centre"), _pair(facts, "radius")
    lines.append(
        f"Corrected (rms ± residual standard deviation): centres by {centre} µm, radii by {radius} µm"
        f"{_walls(facts['wall'])}."
    )
    lines += _scale_line(facts)
    if facts["lens"] != 0.0:
        lines.append(
            "Lens: the residual radial distortion moves the farthest corner by "
            f"{_moved(facts['lens'], facts['lens_sd'])}."
        )
    lines.append(
        f"Gap of touching surfaces, before → after: between grains "
        f"{_micro(facts['gap_rms_before'])} → {_micro(facts['gap_rms_after'])} µm rms, at walls "
        f"{_micro(facts['wall_gap_rms_before'])} → {_micro(facts['wall_gap_rms_after'])} µm rms."
    )
    return lines


def frame_table(summary: dict[str, Any]) -> Table:
    """Table of the frames, thinned to MAX_ROWS; a mean force of arbitrary scale has no unit."""
    table = Table(title=summary["name"], box=None, header_style="bold", pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("frame", justify="right")
    table.add_column("status")
    mean = "⟨f_n⟩/N" if summary.get("force_unit", "N") == "N" else "⟨f_n⟩"
    for heading in ("contacts", "z", "φ/°", mean, "nat. map", "ε", "trust"):
        table.add_column(heading, justify="right", no_wrap=True)
    truth = summary.get("accuracy")
    if truth:
        table.add_column("r(f_n)", justify="right", no_wrap=True)
        table.add_column("r(f_t)", justify="right", no_wrap=True)
    total = summary["frame_count"]
    shown = even_subset(total, MAX_ROWS)
    for k in shown:
        status = summary["status"][k]
        cells = [
            str(k),
            f"[{STATUS_STYLE[FrameStatus[status.upper()]]}]{status}[/]",
            str(summary["contact_count"][k]),
            _cell(summary["coordination_number"][k], ".2f"),
            _cell(summary["friction_angle_degrees"][k], ".1f"),
            _cell(summary["mean_fn"][k], ".3g"),
            _cell(summary["natural_map"][k], ".0e"),
            _cell(summary["correction"][k], ".3f"),
            _cell(summary["trust"][k], ".2f"),
        ]
        if truth:
            cells += [_cell(truth["r_fn"][k], ".3f"), _cell(truth["r_ft"][k], ".3f")]
        table.add_row(*cells)
    return table


def _cell(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _curve_line(curve: dict[str, list[float]]) -> str:
    """Describe the curve in one line, thinned to nine points."""
    shown = np.linspace(0, len(curve["change"]) - 1, 9).round().astype(int)
    points = (f"{curve['change'][k] * 1e6:+.0f}: {curve['coordination_number'][k]:.2f}" for k in shown)
    return "Coordination number without rattlers against the change of all radii [µm]: " + ", ".join(points) + "."


def _listed(frames: list[int]) -> str:
    return ", ".join(str(k) for k in frames[:8]) + (f" and {len(frames) - 8} more" if len(frames) > 8 else "")


def _scale_line(facts: dict[str, Any]) -> list[str]:
    if facts.get("radius_factor", 0.0):
        factor, deviation = 100.0 * facts["radius_factor"], 100.0 * facts["radius_factor_sd"]
        reason = (
            "rods at walls and corner discs distinguish it from a wrong pixel size"
            if facts["walls_decide"]
            else f"a pixel size wrong by {-factor / (1.0 + 0.01 * factor):+.2f} % would look the same"
        )
        low, high = (1.0 + 0.01 * (factor + sign * deviation) for sign in (-2.0, 2.0))
        return [f"Radii: all {factor:+.2f} ± {deviation:.2f} %, a common factor of {low:.4f} to {high:.4f}; {reason}."]
    value, sd = 100 * facts["pixel_size"], 100 * facts["pixel_size_sd"]
    if sd == 0.0:
        return []  # not estimated
    if value == 0.0:
        return [f"Pixel size: as given, in agreement with the known radii within ± {sd:.2f} %."]
    walls = "the walls were measured with it and follow" if facts["walls_follow_pixel_size"] else "the walls stay"
    return [f"Pixel size: {value:+.2f} ± {sd:.2f} % from the known radii; {walls}."]


def _walls(walls: dict[str, dict[str, float]]) -> str:
    parts = []
    for name, wall in walls.items():
        words = []
        if abs(wall["outward"]) > NOTICEABLE * wall["outward_sd"]:
            words.append(_moved(wall["outward"], wall["outward_sd"]))
        if abs(wall["tilt"]) > NOTICEABLE * wall["tilt_sd"]:
            words.append(f"rotated by {1e3 * wall['tilt']:+.2f} ± {1e3 * wall['tilt_sd']:.2f} mrad")
        if words:
            parts.append(f"wall {name} {' and '.join(words)}")
    return "".join(f", {words}" for words in parts)


def _moved(outward: float, sd: float) -> str:
    """State how far something moves outward or inward [m], with its standard deviation [m]."""
    return f"{1e6 * abs(outward):.0f} ± {1e6 * sd:.0f} µm {'inward' if outward < 0.0 else 'outward'}"


def _pair(facts: dict[str, Any], part: str) -> str:
    return f"{_micro(facts[f'{part}_rms'])} ± {_micro(facts[f'{part}_sd'])}"


def _micro(metres: float) -> str:
    return f"{1e6 * metres:.1f}"
