"""Trial solution: the forces of the first photographs, solved as a run does, and what their evidence leads to expect.

A prediction that does not solve anything cannot see wrong input; the evidence of solved frames can.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...process.counts import mean_of_known
from ...process.errors import UndeterminedError
from ...process.machine.linear_algebra import one_thread_each
from ...solver.assessment.evidence import Evidence
from ...solver.assessment.expected_correlation import correlation_score, expect_correlation, predict_correlation
from ...solver.assessment.penalties import NO_PENALTY, Penalty, assess, find_penalties, most_by_intervals
from ..corrected_sequence import CorrectedSequence
from ..correction.close_photographs import choose_span
from ..correction.correct_sequence import correct_sequence
from ..correction.hard_grain_errors import correct_hard_grains
from ..frame_store import MemoryStore
from ..inputs import Inputs
from ..solve_frames import InferenceObserver, solve_frames

PREDICTED_PHOTOGRAPHS = 12  # at most, from which the accuracy of a whole test is predicted
TRIAL_PHOTOGRAPHS = 6  # on which rivals are compared
SETTLED = 2  # frames from which on a trial is judged: earlier ones lack a history


@dataclass(frozen=True, slots=True)
class Trial:
    """Evidence of the first frames of a sequence, solved on a trial basis."""

    evidence: tuple[Evidence, ...]  # of the judged frames
    stride: int  # between the photographs that were solved
    photographs: int = PREDICTED_PHOTOGRAPHS  # that were at hand
    most: float = 1.0  # mean limit of the trust by the error bars of the judged frames

    @property
    def expected(self) -> tuple[float, float, float]:
        """Predicted r(f_n) of the whole test, and an interval with a coverage of two thirds."""
        return self.expect(contradicted=False)

    def expect(self, *, contradicted: bool) -> tuple[float, float, float]:
        """The same where a cause of wrong forces was named, or not."""
        found = [each for each in self.evidence if not math.isnan(each.disagreement)]
        if not found:
            return math.nan, math.nan, math.nan
        kept = float(np.mean([_kept(each) for each in found]))
        r, low, high = (kept * each for each in predict_correlation(found, contradicted=contradicted))
        return min(r, self.most), min(low, self.most), high

    @property
    def score(self) -> float:
        """Mean arctanh of the expected r(f_n), by which trials are compared; −∞ without forces."""
        found = [correlation_score(each) for each in self.evidence if not math.isnan(each.disagreement)]
        return float(np.mean(found)) if found else -math.inf

    @property
    def agreement(self) -> float:
        """Mean correlation of the forces from the motion with those from the positions alone; NaN where not known."""
        return mean_of_known(each.agreement for each in self.evidence)

    @property
    def overlap_agreement(self) -> float:
        """The same of the forces from positions with the motion-free balance of the overlaps."""
        return mean_of_known(each.position_agreement for each in self.evidence)

    @property
    def loaded(self) -> bool:
        """Whether a known load or the weight sets the scale."""
        return all(each.loaded for each in self.evidence)

    @property
    def soft(self) -> bool:
        """Whether the gaps are overlaps that forces make."""
        return any(each.information.soft for each in self.evidence)

    @property
    def worst(self) -> Penalty:
        """The weightiest reason against the forces; without words: none."""
        return max((each for evidence in self.evidence for each in find_penalties(evidence)[:1]), default=NO_PENALTY)


@one_thread_each
def solve_trial(
    inputs: Inputs,
    photographs: int = TRIAL_PHOTOGRAPHS,
    observer: InferenceObserver | None = None,
    *,
    first: int = 0,
    by_forces: bool = False,
    corrected: CorrectedSequence | None = None,
) -> Trial | None:
    """Solve the first photographs of a sequence as a run would.

    Parameters
    ----------
    inputs : Inputs
        Of the whole test, or of its first photographs.
    photographs : int
        How many are solved. Where noise hides the sliding between neighbouring ones, one in several is taken.
    observer : InferenceObserver, optional
        Receives the progress.
    first : int
        First photograph.
    by_forces : bool
        Whether errors of centres are found by forces where a run would. Rivals of the input are compared without it.
    corrected : CorrectedSequence, optional
        The same photographs, where they are corrected already.

    Returns
    -------
    Trial or None
        None: fewer than two photographs, no walls, or no forces.
    """
    given, stride = select_window(inputs, photographs, first)
    if given.tracks.frame_count < 2:
        return None
    store, observer = MemoryStore(), InferenceObserver() if observer is None else observer
    sequence, beginning = correct_sequence(given) if corrected is None else corrected, None
    if by_forces:
        sequence, beginning = correct_hard_grains(sequence, observer)
    solve_frames(sequence, store, observer, beginning)
    judged = store.frames[min(SETTLED, len(store.frames) - 1) :]
    judged = [each for each in judged if each.state.evidence.assessed]
    if not judged:
        return None
    most = float(np.mean([most_by_intervals(each.forces) for each in judged]))
    return Trial(tuple(each.state.evidence for each in judged), stride, inputs.tracks.frame_count, most)


def select_window(inputs: Inputs, photographs: int = TRIAL_PHOTOGRAPHS, first: int = 0) -> tuple[Inputs, int]:
    """Select the photographs of a trial solution; also return the step between them."""
    stride, _ = choose_span(inputs.tracks)
    part = (first, min(first + stride * (photographs - 1) + 1, inputs.tracks.frame_count), stride)
    tracks, walls = inputs.tracks.frames(*part), inputs.walls.frames(*part)
    return replace(inputs, tracks=tracks, walls=walls, settings=inputs.settings.without_sweeps()), stride


def try_rival(inputs: Inputs, first: int = 0) -> Trial | None:
    """Solve a trial of other inputs; None where they allow none."""
    try:
        return solve_trial(inputs, first=first)
    except (UndeterminedError, ValueError, FloatingPointError):  # a rival that cannot be true
        return None


def trial_score(inputs: Inputs, first: int = 0) -> float:
    """Score of a trial solution; −∞ where the input allows none."""
    trial = try_rival(inputs, first)
    return -math.inf if trial is None else trial.score


def remainder(gain: float) -> str:
    """1 − r of the rival over that of the input, for a rise of arctanh r: about exp(−2 rise)."""
    return f"{100.0 * math.exp(-2.0 * gain):.0f} %"


def _kept(evidence: Evidence) -> float:
    """Fraction of the expected correlation that is left by penalties outside of the fitted model."""
    expected = expect_correlation(evidence)
    return assess(evidence).expected_correlation / expected if expected > 0.0 else 0.0
