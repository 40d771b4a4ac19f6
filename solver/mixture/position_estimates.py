"""Position-only estimates of a sequence, computed frame by frame on demand.

Gathering the evidence of all frames takes as long as a frame or two; it is done at the first request. Where forces rest
on positions alone, those of a frame are averaged with those of its neighbours, so that these are estimated as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.verdicts import NO_VERDICTS, Verdicts
from ..posterior.frame_evidence import FrameEvidence
from ..posterior.frame_posterior import FramePosterior, infer_frame
from ..posterior.fringe_calibration import FringeCalibration
from ..posterior.posterior_settings import PosteriorSettings
from ..posterior.sequence_evidence import SequenceEvidence, gather_position_evidence
from .force_smoothing import WINDOW, smooth_forces
from .fringe_evidence import calibrate_sequence_fringes

STEADY_LOAD = 0.1  # relative change of a load, beyond which photographs share no estimate
# Of standard deviations from positions alone, whose draws are stricter in balance: on twelve simulated packings of soft
# grains one and two of them then cover 79 and 97 % of the forces.
ALONE_FACTOR = 1.25
SEED = 0  # of the draws, with the number of the frame: the same bits for any order of requests


class PositionEstimates:
    """Posteriors of the forces of each frame from positions and balance alone."""

    def __init__(
        self,
        packing: Packing,
        snapshots: Sequence[Snapshot],
        settings: PosteriorSettings,
        workers: int | None = None,
        given: Mapping[int, FramePosterior] | None = None,
        *,
        alike: int = 1,
        alone: bool = False,
    ) -> None:
        """Prepare the estimates of a sequence.

        Parameters
        ----------
        packing : Packing
        snapshots : sequence of Snapshot
        settings : PosteriorSettings
            Settings before the sequence's own standard deviations replace them.
        workers : int, optional
            Threads; None: one for every core.
        given : mapping of int to FramePosterior, optional
            Posteriors of some frames, used as they are.
        alike : int
            Photographs so close together that they share one posterior, that of the first of every so many; where a
            measured load changes by more than a tenth, the next ones begin.
        alone : bool
            Whether forces rest on positions alone, as those of soft grains: balance then counts more, and every
            photograph has its own posterior, whose forces are averaged with those of its neighbours.
        """
        self._workers = workers
        self._packing, self._snapshots, self._settings = packing, snapshots, settings
        self._evidence: SequenceEvidence | None = None
        self._alone = alone
        self._shared = _shared_frames(snapshots, 1 if alone else alike)
        self._fringes: FringeCalibration | None = None
        self._known: dict[int, FramePosterior | None] = dict(given or {})
        self._brief: dict[int, FramePosterior | None] = {}  # of the last frame that was compared
        self._single: dict[int, FramePosterior | None] = {}  # of the neighbours of a frame, without verdicts

    def at(self, k: int, verdicts: Verdicts = NO_VERDICTS) -> FramePosterior | None:
        """Return the posterior of frame k with its reviewed pairs; None where no two bodies are near."""
        if k not in self._known:
            k = self.frame_of(k, verdicts)
        if k not in self._known:
            # Only the last one is kept: a frame is requested again only while it is being solved.
            self._known = {k: self._smooth(k, verdicts) if self._alone else self._infer(k, verdicts)}
        return self._known[k]

    def compared(self, k: int, verdicts: Verdicts = NO_VERDICTS) -> FramePosterior | None:
        """Return a posterior of frame k from fewer draws, to be compared with forces from elsewhere."""
        k = self.frame_of(k, verdicts)
        if k not in self._brief:
            self._brief = {k: self._infer(k, verdicts, brief=True)}
        return self._brief[k]

    def frame_of(self, k: int, verdicts: Verdicts = NO_VERDICTS) -> int:
        """Return the frame whose positions serve frame k: with verdicts its own, else the first of those alike."""
        return self._shared[k] if verdicts is NO_VERDICTS else k

    @property
    def fringes(self) -> FringeCalibration | None:
        """Calibration of the fringes, once a frame has been estimated; None: no photoelastic photographs."""
        return self._fringes

    def _smooth(self, k: int, verdicts: Verdicts) -> FramePosterior | None:
        """Average the forces of frame k with those of its neighbours, which are kept for the next request."""
        near = range(max(k - WINDOW, 0), min(k + WINDOW + 1, len(self._snapshots)))
        self._single = {f: self._single[f] if f in self._single else self._infer(f, NO_VERDICTS) for f in near}
        window = dict(self._single)
        if verdicts is not NO_VERDICTS:
            window[k] = self._infer(k, verdicts)
        own, known = window[k], [f for f in near if window[f] is not None]
        if own is None:
            return None
        return smooth_forces([each for each in window.values() if each is not None], known.index(k), verdicts.forced)

    def _infer(self, k: int, verdicts: Verdicts, *, brief: bool = False) -> FramePosterior | None:
        if self._evidence is None:
            try:
                self._evidence = gather_position_evidence(
                    self._packing, self._snapshots, self._settings, soft=self._alone
                )
            except ValueError:  # no two bodies are near
                return None
            self._evidence, self._fringes = calibrate_sequence_fringes(self._evidence, self._workers)
        evidence = self._evidence.of_frame(k, verdicts=verdicts, fringes=self._fringes)
        if evidence.contacts.count == 0:
            return None
        infer = infer_alone if self._alone else infer_frame
        settings = self._evidence.settings.for_comparison() if brief else self._evidence.settings
        return infer(evidence, settings, frame_generator(k), self._workers)


def infer_alone(
    evidence: FrameEvidence, settings: PosteriorSettings, rng: np.random.Generator, workers: int | None = None
) -> FramePosterior:
    """Sample the posterior of a frame whose forces rest on positions alone; parameters as of `infer_frame`."""
    found = infer_frame(evidence, settings.for_positions_alone(), rng, workers)
    return replace(found, fn_sd=ALONE_FACTOR * found.fn_sd, ft_sd=ALONE_FACTOR * found.ft_sd)


def _shared_frames(snapshots: Sequence[Snapshot], alike: int) -> list[int]:
    """Return the first of the photographs that each is alike to, whatever is requested in which order."""
    first: list[int] = []
    for k, snapshot in enumerate(snapshots):
        begin = first[-1] if k else 0
        begin = k if k - begin >= alike or _load_changes(snapshots[begin], snapshot) else begin
        first.append(begin)
    return first


def _load_changes(one: Snapshot, two: Snapshot) -> bool:
    if one.load is None or two.load is None:
        return False
    return bool(np.any(np.abs(two.load - one.load) > STEADY_LOAD * np.abs(two.load)))


def frame_generator(k: int) -> np.random.Generator:
    """Make the random generator of frame k."""
    return np.random.default_rng([SEED, k])
