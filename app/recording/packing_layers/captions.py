"""Writes the caption above every packing view, and the card of a frame: how far to trust it and why."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ...drawing.frame_caption import caption_of_strain, caption_of_time, caption_of_trust
from ...process.counts import state_count
from ...solver.assessment.reasons import split_reasons
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.statistics.frame_statistics import FrameStatistics
from ..look import entities
from ..look.axes import log_texts
from ..look.clock import Clock
from ..look.colours import INK, SUSPECT
from ..look.printable_text import printable
from ..look.scene import Scene

ACROSS = (0.64, 0.02)  # place of the caption over the width and the height of the header


def log_caption(clock: Clock, scene: Scene, forces: FrameForces) -> None:
    """Log the caption: during the sweeps that the field is not the reported one, in the last row status and trust."""
    canvas, when = scene.canvas, caption_of_time(forces, clock.time)
    place = np.array([
        canvas.left + ACROSS[0] * canvas.width, canvas.top - (1.0 - ACROSS[1]) * canvas.header_height
    ])  # fmt: skip
    if clock.last > clock.first:
        clock.start()
        text = f"{when}\n{state_count(forces.history.count, 'sweep')}: not yet the reported field"
        log_texts(clock, entities.CAPTION, [(place, printable(text), INK)], static=False)
    clock.end()
    colour = SUSPECT if forces.status in (FrameStatus.SUSPECT, FrameStatus.FAILED) else INK
    text = f"{when}\n{caption_of_trust(forces)}"
    log_texts(clock, entities.CAPTION, [(place, printable(text), colour)], static=False)


def log_card(clock: Clock, scene: Scene, forces: FrameForces, statistics: FrameStatistics) -> None:
    """Log the card of a frame as a document, whose lines wrap."""
    clock.start()
    text = printable(write_card(scene, forces, statistics, clock.time))
    clock.log(entities.FRAME_CARD, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def write_card(scene: Scene, forces: FrameForces, statistics: FrameStatistics, time: float) -> str:
    """Return the card of a frame as Markdown: status, trust and its reasons, strain, main quantities, lost rods."""
    expected = (
        f", expected correlation {forces.expected_correlation:.2f}" if _known(forces.expected_correlation) else ""
    )
    head = f"**Frame {forces.frame}** at {time:.4g} s, {caption_of_strain(forces) or 'strain unknown'}: "
    head += f"**{forces.status.name.lower()}**, " + (f"trust **{forces.trust:.2f}**" if _known(forces.trust) else "")
    angle, angle_sd = np.degrees(statistics.friction_angle), np.degrees(statistics.friction_angle_sd)
    values = [
        f"φ {angle:.1f}°" + (f" ± {angle_sd:.1f}°" if _known(angle_sd) else ""),
        f"z {statistics.coordination_number:.2f}",
        f"{statistics.contact_count} of {state_count(forces.contacts.count, 'contact')} bear force",
        f"mean f_n {statistics.mean_fn:.3g} {scene.force_unit}",
        f"scale of all forces ± {100.0 * forces.scale_sd:.0f} %" if _known(forces.scale_sd) else "",
    ]
    lost = scene.tracks.id[scene.tracks.frame(forces.frame).lost[0]].tolist()
    lines = [head + expected + ".", ", ".join(each for each in values if each) + "."]
    if lost:
        lines.append(
            f"Lost: {state_count(len(lost), 'rod')}: {', '.join(map(str, lost[:12]))}{' …' if len(lost) > 12 else ''}."
        )
    penalties = list(split_reasons(forces.trust_penalties))
    reasons = [each.strip() for each in forces.reason.split(";")]
    for title, listed in (
        ("What lowers the trust:", penalties),
        (f"Why {forces.status.name.lower()}, and how the forces were found:", reasons),
    ):
        if known := [each for each in dict.fromkeys(listed) if each]:
            lines.append(f"{title}\n\n" + "\n".join(f"- {each}" for each in known))
    return "\n\n".join(lines)


def _known(value: float | None) -> bool:
    return value is not None and bool(np.isfinite(value))
