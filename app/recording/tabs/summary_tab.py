"""Writes the summary: contents of the recording, trust and its reasons, settings and versions."""

from __future__ import annotations

import platform
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import rerun as rr

from ...drawing.uncertainty import SURE
from ...process.counts import state_count
from ...results.results import setting
from ...solver.assessment.reasons import split_reasons, without_numbers
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.statistics.agreement import Agreement
from ...solver.statistics.frame_statistics import FrameStatistics
from ..look import entities
from ..look.printable_text import printable
from ..look.scene import Scene
from ..packing_layers.film import STRONG, STRONG_SWEEPS

MAX_REASONS = 8  # that are listed
PACKAGES = ("rodsight", "numpy", "numba", "scipy", "rerun-sdk")


@dataclass(frozen=True, slots=True)
class FrameSummary:
    """The values of one frame that the summary shows."""

    frame: int
    status: FrameStatus
    reason: str
    trust: float
    similarity: float
    sweeps: int
    natural_map: float
    unbalance: float
    contacts: int
    friction_angle: float  # [rad]
    lost: int
    agreement: Agreement | None
    trust_penalties: str = ""  # the reasons that lower the trust, with cures, the worst first

    @classmethod
    def of(
        cls,
        forces: FrameForces,
        statistics: FrameStatistics,
        *,
        lost: int,
        agreement: Agreement | None,
    ) -> FrameSummary:
        """Collect the values of one frame."""
        return cls(
            forces.frame, forces.status, forces.reason, forces.trust, forces.similarity, forces.sweeps,
            forces.natural_map, forces.unbalance, statistics.contact_count, statistics.friction_angle, lost, agreement,
            forces.trust_penalties,
        )  # fmt: skip


def log_summary(
    stream: rr.RecordingStream, scene: Scene, frames: list[FrameSummary], clipped: int, total: int, notes: list[str]
) -> None:
    """Log the summary of `write_summary`, static; it replaces an earlier one."""
    text = write_summary(scene, frames, clipped, total, notes)
    stream.log(entities.SUMMARY, rr.TextDocument(printable(text), media_type=rr.MediaType.MARKDOWN), static=True)


def write_summary(scene: Scene, frames: list[FrameSummary], clipped: int, total: int, notes: list[str]) -> str:
    """Return the summary as Markdown.

    Parameters
    ----------
    scene : Scene
        The run.
    frames : list of FrameSummary
        The recorded frames.
    clipped, total : int
        Number of forces above the drawn range, and of all forces.
    notes : list of str
        Sentences for the user.
    """
    return "\n\n".join(
        part
        for part in (
            f"# {scene.name}",
            _counts(scene, frames),
            _diagnosis(scene),
            _trust(frames),
            _trust_penalties(frames),
            _camera(scene),
            _accuracy(frames),
            "\n".join(f"- {note}" for note in notes),
            _legend(scene, clipped, total),
            _frames(frames),
            _versions(),
            f"## Configuration\n\n```toml\n{scene.configuration.strip()}\n```",
        )
        if part
    )


def _counts(scene: Scene, frames: list[FrameSummary]) -> str:
    walls, usual = scene.walls, scene.walls.usual_pressure(scene.rod_length)
    pressures = ", ".join(
        f"{walls.name[w]} {1e-3 * usual[w]:.4g} kPa{' on average, measured' if np.isnan(walls.pressure[w]) else ''}"
        for w in np.flatnonzero(walls.loaded)
    )
    scale = "the weight sets the scale" if scene.weight.any() else "forces are known up to a factor"
    loads = f"loaded: {pressures}" if pressures else f"none loaded: {scale}"
    length_given = setting(scene.configuration, "material", "length") is not None
    return (
        f"{state_count(scene.tracks.frame_count, 'frame')}, {state_count(scene.grains.count, 'rod')} of "
        f"{1e3 * scene.rod_length:g} mm"
        f"{'' if length_given else ' (assumed length: the configuration gives none)'}, "
        f"{state_count(walls.count, 'wall')} "
        f"({loads}), "
        f"friction {scene.friction:g}. {state_count(sum(f.sweeps for f in frames), 'sweep')} in "
        f"{state_count(len(frames), 'frame')}."
    )


def _trust(frames: list[FrameSummary]) -> str:
    if not frames:
        return ""
    status = Counter(f.status for f in frames)
    settled = next((f.frame for f in frames if f.status is FrameStatus.SETTLED), None)
    quantities = (
        ("trust T", [f.trust for f in frames], np.nanmin),
        ("similarity with the frame before", [f.similarity for f in frames], np.nanmin),
        ("greatest force residual / mean f_n", [f.unbalance for f in frames], np.nanmax),
        ("residual of the natural map", [f.natural_map for f in frames], np.nanmax),
    )
    rows = [
        ("settled from", "never" if settled is None else f"frame {settled}"),
        ("status", ", ".join(f"{status[s]} {s.name.lower()}" for s in FrameStatus if status[s])),
        ("most rods lost in a frame", str(max(f.lost for f in frames))),
    ]
    return (
        "## How far to trust it\n\n"
        + "\n".join(f"- {name}: {value}" for name, value in rows)
        + "\n\n| of the frames | median | worst |\n|---|---|---|\n"
        + "\n".join(f"| {name} | {_median_and_worst_cells(values, worst)} |" for name, values, worst in quantities)
        + "\n\nT is a lower bound of the correlation with the true forces, by the evidence of the frame and by what "
        "was found wrong: errors of the input that leave no trace are not included. It holds in every status, which "
        "names what happened to the packing."
    )


def _diagnosis(scene: Scene) -> str:
    """Return what makes the forces wrong; empty where nothing contradicts the model."""
    if not scene.diagnosis:
        return ""
    return "\n".join(["## Found wrong", "", *(f"- {printable(each)}" for each in scene.diagnosis)])


def _camera(scene: Scene) -> str:
    """Return what the gaps of near grains show of the camera and of the radii; empty where this was not sought."""
    if not scene.camera:
        return ""
    found = scene.camera
    return f"## Camera and radii\n\n{found[0].upper()}{found[1:]}. (One standard error; see `lens` in results.h5.)"


def _trust_penalties(frames: list[FrameSummary]) -> str:
    """Return each reason that lowers the trust once, with the least trusted frame; empty if there are none."""
    lowest = sorted((f.trust, f.frame, f.trust_penalties) for f in frames if f.trust_penalties and np.isfinite(f.trust))
    found: dict[str, list[tuple[float, int, str]]] = {}
    for trust, frame, reasons in lowest:
        for each in split_reasons(reasons):
            found.setdefault(without_numbers(each), []).append((trust, frame, each))
    if not found:
        return ""
    rows: list[str] = []
    for (trust, frame, reason), *others in list(found.values())[:MAX_REASONS]:
        more = f" and {state_count(len(others), 'more frame')}" if others else ""
        rows.append(f"- frame {frame}, T {trust:.2f}{more}: {printable(reason)}")
    some = f" ({MAX_REASONS} of {len(found)})" if len(found) > MAX_REASONS else ""
    return "\n".join([f"Reasons that lower T{some}, each with the least trusted frame:", "", *rows])


def _accuracy(frames: list[FrameSummary]) -> str:
    known = [f.agreement for f in frames if f.agreement is not None]
    if not known:
        return ""
    return (
        "## Against the truth\n\n| | median | worst |\n|---|---|---|\n"
        f"| r(f_n) | {_median_and_worst_cells([a.r_fn for a in known], np.nanmin)} |\n"
        f"| r(f_t) | {_median_and_worst_cells([a.r_ft for a in known], np.nanmin)} |\n"
        f"| relative L2 of (f_n, f_t) | {_median_and_worst_cells([a.relative_l2 for a in known], np.nanmax)} |\n\n"
        "Over all contacts that are true or detected; absent counts as 0."
    )


def _frames(frames: list[FrameSummary]) -> str:
    rows = [
        f"| {f.frame} | {f.status.name.lower()} | {_number(f.trust)} | {_number(f.similarity)} | {f.sweeps} "
        f"| {f.natural_map:.1e} | {f.unbalance:.1e} | {f.contacts} | {np.degrees(f.friction_angle):.1f} | {f.lost} |"
        for f in frames
    ]
    head = "| frame | status | T | similarity | sweeps | natural map | residual | bearing contacts | φ [°] | lost |"
    return "\n".join(["## Frames", "", head, "|" + "---|" * 10, *rows]) if rows else ""


def _legend(scene: Scene, clipped: int, total: int) -> str:
    force, unit = scene.style.range, scene.force_unit
    return (
        "## Legend\n\n"
        f"- **Lines** join the centres of two rods in contact (or a rod and its contact point on a wall). Width and "
        f"colour increase linearly with f_n, the same in every frame: grey and thin below {force.weak:.3g} {unit} "
        f"(half the mean), then deep red, orange, yellow, up to cream at {force.top:.3g} {unit}. "
        f"{clipped} of {total} forces are above and drawn as {force.top:.3g} {unit}.\n"
        f"- **Gaps** in a line: the fraction of it that is missing is σ(f_n) / f_n, from {SURE:g} on; a row of dots "
        "is a force about which little is known. Sweeps have no gaps, as their uncertainty is not known.\n"
        "- **Caption** above the packing: frame, time, shear or change of area since frame 0, status, trust.\n"
        "- **Inferred − true**: width by the magnitude of the difference, yellow where the inferred force is greater, "
        "blue where it is less.\n"
        "- **Cyan dots**: contacts at the Coulomb limit (sliding).\n"
        "- **Strokes at the rim** show rotation: they pointed up in frame 0. Amber outline: suspect pose. "
        "Blue outline: a rod that no photograph shows, inferred from its neighbours. "
        "Red cross: no pose, drawn where the grain was last seen.\n"
        "- **Click** a contact or a grain and open the right panel for its values (fn, ft, gap_um, fn_sd, "
        "mobilisation, state, age, probability …): they are those of the reported field.\n"
        "- Timeline **frame**: one step per photograph, reported forces. Timeline **sweep**: the solve itself; "
        "switch to it for the tab *Convergence*. After the last sweep of a frame one more value shows the "
        "reported field: the estimator *ensemble* computes it from several chains and convex programmes, so that the "
        "forces may jump there. Timelines **time** and **microstrain**: the same frames by the time at which they were "
        "taken, and by the accumulated strain of the packing, in millionths.\n"
        "- **Force residuals and change**: grains are coloured by their force residual, contacts by their change per "
        "sweep, averaged since the recorded sweep before (in the last row of a frame: at the end of the sweeps), both "
        "over the mean f_n.\n"
        "- **Warm and cold start**: the residual after one sweep from the previous forces, and after one from zero "
        "forces, on the problem of the last sub-step of the frame. The sweeps saved are those that zero forces need to "
        "reach the same residual.\n"
        f"- **Film**: forces above {STRONG:g} times the mean of some frames, and above {STRONG_SWEEPS:g} times the "
        "mean of some sweeps of this frame. The bright outline is about the frame that is nearest to this one."
    )


def _versions() -> str:
    found = [f"Python {platform.python_version()}"]
    for package in PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} (not installed)")
    return "Made with " + ", ".join(found) + "."


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "–"


def _median_and_worst_cells(values: list[float], worst: Callable[[Array], float]) -> str:
    """Return median and worst of the finite values as two cells of a Markdown table."""
    known: Array = np.array([v for v in values if np.isfinite(v)])
    if len(known) == 0:
        return "– | –"
    return f"{np.median(known):.3g} | {worst(known):.3g}"
