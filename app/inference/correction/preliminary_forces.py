"""Forces of the first photographs, from which errors of rods are found before all photographs are solved."""

from __future__ import annotations

from collections.abc import Iterator

from ...solver.frame_forces import FrameForces
from ...solver.sequence.frames import solve_sequence
from ..corrected_sequence import CorrectedSequence


def solve_first(sequence: CorrectedSequence, count: int) -> Iterator[FrameForces]:
    """Solve up to `count` photographs, one after the other, as far as they are read."""
    solved = solve_sequence(
        sequence.packing, sequence.snapshots[:count], sequence.settings.without_sweeps(),
        verdicts=sequence.verdicts, failed={k: why for k, why in sequence.failed.items() if k < count},
    )  # fmt: skip
    return (forces for forces, _ in solved)
