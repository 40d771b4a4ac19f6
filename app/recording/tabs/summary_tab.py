"""Writes the summary: what this recording shows, how far to trust it, how it was made."""

from __future__ import annotations

import platform
from collections import Counter
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
import rerun as rr

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.agreement import Agreement
from solver.statistics.frame_statistics import FrameStatistics

from ..look import entities
from ..look.scene import Scene, setting
from ..look.texts import printable
from ..packing_layers.film import STRONG, STRONG_SWEEPS

MOST_DOUBTS = 5  # frames whose reasons are told
PACKAGES = ("rodsight", "numpy", "numba", "scipy", "rerun-sdk")


@dataclass(frozen=True, slots=True)
class FrameFacts:
    """What the summary keeps of one frame."""

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
    doubt: str = ""

    @classmethod
    def of(
        cls,
        forces: FrameForces,
        statistics: FrameStatistics,
        *,
        lost: int,
        agreement: Agreement | None,
    ) -> FrameFacts:
        return cls(
            forces.frame, forces.status, forces.reason, forces.trust, forces.similarity, forces.sweeps,
            forces.natural_map, forces.unbalance, statistics.contact_count, statistics.friction_angle, lost, agreement,
            forces.doubt,
        )  # fmt: skip


def log_summary(
    stream: rr.RecordingStream, scene: Scene, facts: list[FrameFacts], clipped: int, drawn: int, notes: list[str]
) -> None:
    """Log the summary, static; it replaces the one before."""
    text = write_summary(scene, facts, clipped, drawn, notes)
    stream.log(entities.SUMMARY, rr.TextDocument(printable(text), media_type=rr.MediaType.MARKDOWN), static=True)


def write_summary(scene: Scene, facts: list[FrameFacts], clipped: int, drawn: int, notes: list[str]) -> str:
    """The summary as Markdown. clipped of drawn forces are above the top of the drawn range."""
    return "\n\n".join(
        part
        for part in (
            f"# {scene.name}",
            _counts(scene, facts),
            _trust(facts),
            _accuracy(facts),
            "\n".join(f"- {note}" for note in notes),
            _legend(scene, clipped, drawn),
            _frames(facts),
            _versions(),
            f"## Configuration\n\n```toml\n{scene.configuration.strip()}\n```",
        )
        if part
    )


def _counts(scene: Scene, facts: list[FrameFacts]) -> str:
    walls, usual = scene.walls, scene.walls.usual_pressure(scene.rod_length)
    pressures = ", ".join(
        f"{walls.name[w]} {1e-3 * usual[w]:.4g} kPa{' on average, measured' if np.isnan(walls.pressure[w]) else ''}"
        for w in np.flatnonzero(walls.loaded)
    )
    said = setting(scene.configuration, "material", "length") is not None
    return (
        f"{scene.tracks.frame_count} frames, {scene.grains.count} rods of {1e3 * scene.rod_length:g} mm"
        f"{'' if said else ' (usual length: the configuration does not say)'}, {scene.walls.count} walls "
        f"({'loaded: ' + pressures if pressures else 'none loaded: forces are known up to a scale'}), "
        f"friction {scene.friction:g}. {sum(f.sweeps for f in facts)} sweeps in {len(facts)} frames."
    )


def _trust(facts: list[FrameFacts]) -> str:
    if not facts:
        return ""
    status = Counter(f.status for f in facts)
    settled = next((f.frame for f in facts if f.status is FrameStatus.SETTLED), None)
    rows = [
        ("settled from", "never" if settled is None else f"frame {settled}"),
        ("status", ", ".join(f"{status[s]} {s.name.lower()}" for s in FrameStatus if status[s])),
        ("trust T (median, least)", _spread([f.trust for f in facts], np.nanmin)),
        ("similarity with the frame before (median, least)", _spread([f.similarity for f in facts], np.nanmin)),
        ("worst grain unbalance over mean f_n (median, greatest)", _spread([f.unbalance for f in facts], np.nanmax)),
        ("natural-map residual reached (median, greatest)", _spread([f.natural_map for f in facts], np.nanmax)),
        ("grains lost, most in a frame", str(max(f.lost for f in facts))),
    ]
    return (
        "## How far to trust it\n\n| | |\n|---|---|\n"
        + "\n".join(f"| {name} | {value} |" for name, value in rows)
        + "\n\nT estimates the correlation with the true forces *given these inputs*: it does not see a wrong friction "
        "coefficient, wrong radii or a missed contact. Read forces of frames that are not *settled* with care."
    )


def _doubts(facts: list[FrameFacts]) -> str:
    """The reasons of the least trusted frames."""
    doubted = sorted((f.trust, f.frame, f.doubt) for f in facts if f.doubt and np.isfinite(f.trust))
    rows = [f"- frame {frame}, T {trust:.2f}: {_cell(doubt)}" for trust, frame, doubt in doubted[:MOST_DOUBTS]]
    return "\n".join(rows) if rows else "- nothing that is worth words."


def _accuracy(facts: list[FrameFacts]) -> str:
    known = [f.agreement for f in facts if f.agreement is not None]
    if not known:
        return ""
    return (
        "## Against the truth\n\n| | median | worst |\n|---|---|---|\n"
        f"| r(f_n) | {_pair([a.r_fn for a in known], np.nanmin)} |\n"
        f"| r(f_t) | {_pair([a.r_ft for a in known], np.nanmin)} |\n"
        f"| relative L2 of (f_n, f_t) | {_pair([a.relative_l2 for a in known], np.nanmax)} |\n\n"
        "Over all contacts that are true or detected; absent counts as 0."
    )


def _frames(facts: list[FrameFacts]) -> str:
    rows = [
        f"| {f.frame} | {f.status.name.lower()} | {_number(f.trust)} | {_number(f.similarity)} | {f.sweeps} "
        f"| {f.natural_map:.1e} | {f.unbalance:.1e} | {f.contacts} | {np.degrees(f.friction_angle):.1f} | {f.lost} "
        f"| {_cell(f.reason)} |"
        for f in facts
    ]
    head = "| frame | status | T | similarity | sweeps | natural map | unbalance | contacts | φ [°] | lost | why |"
    return "\n".join(["## Frames", "", head, "|" + "---|" * 11, *rows]) if rows else ""


def _legend(scene: Scene, clipped: int, drawn: int) -> str:
    force = scene.style.range
    return (
        "## Legend\n\n"
        f"- **Lines** join the centres of two rods in contact (or a rod and its contact point on a wall). Width and "
        f"colour grow linearly with f_n, the same in every frame: grey and thin below {force.weak:.3g} N (half the "
        f"mean), then deep red, orange, yellow, up to cream at {force.top:.3g} N. "
        f"{clipped} of {drawn} forces are above and drawn as {force.top:.3g} N.\n"
        "- **Dim edges** of lines: as wide as a force that is two standard deviations larger; sweeps have none.\n"
        "- **Cyan dots**: contacts at the Coulomb limit (sliding).\n"
        "- **Strokes at the rim** show rotation: they pointed up in frame 0. Amber outline: doubtful pose. "
        "Blue outline: a rod that no photograph shows, inferred from its neighbours. "
        "Red cross: no pose, drawn where the grain was last seen.\n"
        "- **Click** a contact or a grain and open the right panel for its values (fn, ft, gap_um, fn_sd, "
        "mobilisation, state, age, probability …): they are those of the reported field.\n"
        "- Timeline **frame**: one step per photograph, reported forces. Timeline **sweep**: the solve itself; "
        "switch to it for the tab *Convergence*. After the last sweep of a frame one more value shows the "
        "reported field: the estimator *ensemble* makes it of several chains and convex members, so that the "
        "forces may step there. Timelines **time** and **microstrain**: the same frames by when they were taken, and "
        "by how far the packing had been strained, in millionths.\n"
        "- **Unbalance and change**: grains glow by the force that is missing to their balance, contacts by how much "
        "a sweep changes them, on average since the recorded sweep before (in a frame's last row: as the sweeps "
        "ended), both over the mean f_n.\n"
        "- **Warm and cold start**: the residual after one sweep from the former forces, and after one from zero "
        "forces, on the problem of the frame's last sub-step. The sweeps saved are those that zero forces need to "
        "come as far.\n"
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


def _cell(text: str) -> str:
    """A sentence that does not break a Markdown table."""
    return " ".join(text.replace("|", "/").split())


def _spread(values: list[float], worst: np.ufunc | object) -> str:
    return _pair(values, worst).replace(" | ", ", ")


def _pair(values: list[float], worst: object) -> str:
    """Median and worst of the values that are numbers."""
    known: Array = np.array([v for v in values if np.isfinite(v)])
    if len(known) == 0 or not callable(worst):
        return "– | –"
    return f"{np.median(known):.3g} | {worst(known):.3g}"
