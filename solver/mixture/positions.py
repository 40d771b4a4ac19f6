"""What positions alone say of the forces of a sequence, asked frame by frame where it is needed.

Gathering what all frames tell takes as long as a frame or two; it is done when the first frame asks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.verdicts import NO_VERDICTS, Verdicts
from solver.posterior.frame_posterior import FramePosterior, infer_frame
from solver.posterior.sequence_evidence import SequenceEvidence, gather_evidence
from solver.posterior.settings import PosteriorSettings

SEED = 0  # of the draws, with the number of the frame: the same bits, whatever frame is asked first


class Positions:
    """The positions of a sequence as a witness of its forces."""

    def __init__(
        self,
        packing: Packing,
        snapshots: Sequence[Snapshot],
        settings: PosteriorSettings,
        workers: int | None = None,
        told: Mapping[int, FramePosterior] | None = None,
        *,
        first_again: bool = False,
    ) -> None:
        """workers: threads; None: one for every core. told: what they say of some frames, where it is known better.

        first_again: frame 0 is asked again when all are known, and need not be asked at length before.
        """
        self._workers, self._first_again = workers, first_again
        self._packing, self._snapshots, self._settings = packing, snapshots, settings
        self._gathered: SequenceEvidence | None = None
        self._known: dict[int, FramePosterior | None] = dict(told or {})

    def at(self, k: int, verdicts: Verdicts = NO_VERDICTS) -> FramePosterior | None:
        """What they say of frame k, in which people saw so much; None where no two bodies are near."""
        if k not in self._known:
            # The last one alone: a frame is asked again only while it is being solved.
            self._known = {k: self._ask(k, verdicts)}
        return self._known[k]

    def _ask(self, k: int, verdicts: Verdicts) -> FramePosterior | None:
        if self._gathered is None:
            try:
                self._gathered = gather_evidence(self._packing, self._snapshots, self._settings)
            except ValueError:  # no two bodies are near
                return None
        evidence = self._gathered.of_frame(k, verdicts=verdicts)
        if evidence.contacts.count == 0:
            return None
        settings = self._gathered.settings
        if k == 0 and not self._first_again:  # no motion leads to frame 0
            settings = settings.alone()
        return infer_frame(evidence, settings, draws_of(k), self._workers)


def draws_of(k: int) -> np.random.Generator:
    """The random numbers of frame k."""
    return np.random.default_rng([SEED, k])
