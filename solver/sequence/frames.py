"""Frames in order: each is solved from what the one before it left behind, and judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, without_ignored
from solver.detection.precision import believed_precision, measure_precision, with_precision
from solver.detection.refinement import block_of, refine
from solver.sequence.frame import pose_frame, solve_frame
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frame_problem import SequenceProblem
from solver.sequence.settings import SequenceSettings
from solver.sequence.state import SequenceState


def solve_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    *,
    state: SequenceState | None = None,
    first: int = 0,
    verdicts: Mapping[int, Verdicts] | None = None,
) -> Iterator[tuple[FrameForces, SequenceState]]:
    """Solve the frames first, first + 1, … one after the other; yields each frame with the state after it.

    The motion that leads to a frame is that since the frame before. Nothing leads to frame 0: it takes the motion
    that follows it. After it a single chain starts afresh, the ensemble from what its convex members read of frame 0.
    verdicts: what people said of frames, by frame.
    """
    state = SequenceState.first(packing) if state is None else state
    verdicts = {} if verdicts is None else verdicts
    snapshots = without_ignored(snapshots, verdicts)
    settings = settings.for_radii(packing.grains.radius)
    snapshots, settings, remark = _with_measured_precision(packing, snapshots, settings)
    sequence = SequenceProblem(packing, snapshots, settings)
    refined, number = None, -1
    for k in range(first, len(snapshots)):
        if settings.estimator == "ensemble" and len(snapshots) > 1 and block_of(k, len(snapshots))[0] != number:
            number, start, end = block_of(k, len(snapshots))
            refined = refine(packing.grains, snapshots[start:end], settings.ensemble.probability, start=start)
        problem = pose_frame(sequence, k, state, refined, verdicts.get(k, NO_VERDICTS))
        frame, state = solve_frame(problem, state)
        if remark and k == 0:
            frame = replace(frame, reason=f"{remark}; {frame.reason}")
        yield frame, state


def _with_measured_precision(
    packing: Packing, snapshots: Sequence[Snapshot], settings: SequenceSettings
) -> tuple[Sequence[Snapshot], SequenceSettings, str]:
    """Put what the gaps say of the precision in the place of what is stated, and say so."""
    found = measure_precision(packing.grains, snapshots) if settings.measure_precision else None
    if found is None:
        return snapshots, settings, ""
    assert settings.overlap is not None
    factor, overlap = believed_precision(found, [each.sigma for each in snapshots], settings.overlap)
    if settings.estimator == "nlgs":  # its threshold is all that it has against errors that stay
        factor = max(factor, 1.0)
    remark = ""
    if factor != 1.0:
        told = f"{1e6 * found.sigma:.2g} µm from photograph to photograph, {factor:.2g} times the stated precision"
        remark = f"positions scatter by {told}, as the gaps of touching rods show"
        snapshots = with_precision(snapshots, factor)
    if settings.measure_overlap:
        ensemble = settings.ensemble
        probability = replace(ensemble.probability, overlap=overlap)
        settings = replace(settings, ensemble=replace(ensemble, probability=probability))
    return snapshots, settings, remark
