"""The detector compared with the verdicts: precision, recall and F1 by frame, recommended threshold and radii."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from ...process.counts import state_count
from ...process.errors import InputError
from ...process.frame_range import FrameRange
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import measure_pairs
from ...solver.contacts.pairs import are_among, are_present, join_keys, match_values
from ...solver.even_subset import even_subset
from ...verdicts.decisions import Decisions, decide
from ..reviewed_run import ReviewedRun
from .candidate_pairs import CandidatePairs, find_candidate_pairs
from .estimate import NO, UNJUDGED, YES, DetectorEstimate, estimate_detector
from .queue import strata
from .threshold import ThresholdCurve, ThresholdFit, even_thresholds, fit_threshold, threshold_curve

_SEED = 11  # of the bootstrap
_ENOUGH = 5  # verdicts of a stratum that are used for the rest of it
_CURVE_ROWS = 9  # of the curve on the terminal


@dataclass(frozen=True, slots=True)
class FrameScore:
    """The judged pairs of one frame by verdict and detection."""

    frame: int  # of the experiment
    hits: int  # detected, and a contact
    false: int  # detected, but no contact
    missed: int  # a contact, but not detected
    rejected: int  # neither detected nor a contact

    @property
    def judged(self) -> int:
        return self.hits + self.false + self.missed + self.rejected

    @property
    def precision(self) -> float:
        return self.hits / (self.hits + self.false) if self.hits + self.false else float("nan")

    @property
    def recall(self) -> float:
        return self.hits / (self.hits + self.missed) if self.hits + self.missed else float("nan")

    @property
    def f1(self) -> float:
        all_named = 2 * self.hits + self.false + self.missed
        return 2 * self.hits / all_named if all_named else float("nan")


@dataclass(frozen=True, slots=True)
class JudgedPairs:
    """All candidate pairs, and contacts that reviewers added, of the frames with a verdict (c,)."""

    gap: Array  # (c,) [m]
    with_wall: NDArray[np.bool_]
    stratum: NDArray[np.int64]  # −1: no candidate pair
    detected: NDArray[np.bool_]
    probability: Array  # P(touch) by the detector
    outcome: NDArray[np.int64]  # UNJUDGED, NO or YES

    @property
    def touching(self) -> Array:
        """Weight of each pair as a contact (c,), 0 … 1.

        A pair without a verdict gets the fraction of contacts among the verdicts of its stratum, or, where these are
        few, the detector's probability: without those pairs the ambiguous ones, which are judged first, would dominate.
        """
        weight = self.probability.copy()
        for h in np.unique(self.stratum):
            judged = self.outcome[(self.stratum == h) & (self.outcome != UNJUDGED)]
            if len(judged) >= _ENOUGH:
                weight[self.stratum == h] = (judged == YES).mean()
        weight[self.outcome == YES], weight[self.outcome == NO] = 1.0, 0.0
        return weight


@dataclass(frozen=True, slots=True)
class VerdictScore:
    frames: list[FrameScore]  # those with a verdict
    total: FrameScore
    estimate: DetectorEstimate  # over all candidate pairs of those frames, judged or not
    pairs: JudgedPairs
    curve: ThresholdCurve
    disputed: int


def score_verdicts(run: ReviewedRun) -> VerdictScore | None:
    """Compare the detector with the verdicts in the log; return None if there are none.

    A pair that a verdict added or forbade counts as the detector found it: results store its P(touch).
    """
    results = run.results
    decisions = decide(run.log, run.bodies, frames=FrameRange(run.first_frame), frame_count=len(results.frames))
    if decisions.count == 0:
        return None
    frames, parts = [], []
    for frame in sorted({k for k, _ in decisions.contact | decisions.no_contact}):
        pairs = _pairs_of(run, find_candidate_pairs(results, frame, run.threshold), decisions)
        yes, no = pairs.outcome == YES, pairs.outcome == NO
        seen = pairs.detected
        counts = (int(each.sum()) for each in (yes & seen, no & seen, yes & ~seen, no & ~seen))
        frames.append(FrameScore(frame + run.first_frame, *counts))
        parts.append(pairs)
    pairs = JudgedPairs(*(np.concatenate([getattr(p, name) for p in parts]) for name in JudgedPairs.__slots__))
    total = FrameScore(-1, *(sum(getattr(f, name) for f in frames) for name in ("hits", "false", "missed", "rejected")))
    known = pairs.stratum >= 0
    estimated = estimate_detector(
        pairs.stratum[known], pairs.detected[known], pairs.probability[known], pairs.outcome[known],
        pairs.outcome[known] != UNJUDGED, int((pairs.outcome[~known] == YES).sum()), np.random.default_rng(_SEED),
    )  # fmt: skip
    curve = threshold_curve(pairs.gap, pairs.touching, even_thresholds(pairs.gap))
    return VerdictScore(frames, total, estimated, pairs, curve, len(decisions.disputed))


def fit_to_verdicts(run: ReviewedRun, score: VerdictScore) -> ThresholdFit:
    """Fit threshold and radius correction to the verdicts; raise InputError if they are too few."""
    position_sd = float(np.mean(run.results.tracks.position_sigma))
    pairs, rng = score.pairs, np.random.default_rng(_SEED)
    try:
        return fit_threshold(pairs.gap, pairs.touching, pairs.with_wall, pairs.outcome != UNJUDGED, position_sd, rng)
    except ValueError as error:
        raise InputError(run.log.file, "", str(error)) from None


def as_json(score: VerdictScore, fitted: ThresholdFit | None) -> dict[str, Any]:
    """Return the public `verdicts` object of `rodsight score --json`."""
    values: dict[str, Any] = {
        "frame": [each.frame for each in score.frames],
        **{name: [_plain(getattr(f, name)) for f in score.frames] for name in ("precision", "recall", "f1")},
        "judged": [f.judged for f in score.frames],
        "total": {name: _plain(getattr(score.total, name)) for name in ("precision", "recall", "f1")},
        "estimate": {name: asdict(getattr(score.estimate, name)) for name in ("precision", "recall", "f1")},
        "disputed": score.disputed,
        "curve": {
            name: [_plain(v) for v in getattr(score.curve, name)] for name in ("threshold", "precision", "recall", "f1")
        },
    }
    if fitted is not None:
        values["fit"] = {name: _plain(value) for name, value in asdict(fitted).items()}
    return values


def print_score(console: Console, score: VerdictScore, fitted: ThresholdFit | None) -> None:
    """Print the frames, the curve and the recommended values."""
    table = Table(title="Detector against verdicts, judged pairs only", box=None, header_style="bold")
    for heading in ("frame", "judged", "precision", "recall", "F1"):
        table.add_column(heading, justify="right")
    for each in [*score.frames, score.total]:
        name = "all" if each is score.total else str(each.frame)
        cells = (f"{value:.3f}" for value in (each.precision, each.recall, each.f1))
        table.add_row(name, str(each.judged), *cells)
    console.print(table)
    over = ", ".join(
        f"{name} {each.value:.3f} ({each.low:.3f} to {each.high:.3f})"
        for name, each in (("precision", score.estimate.precision), ("recall", score.estimate.recall))
    )
    console.print(
        f"Over all {score.estimate.total} candidate pairs of these frames, estimated from {score.estimate.judged} "
        f"verdicts: {over}.",
        highlight=False,
        soft_wrap=True,
    )
    if score.disputed:
        console.print(f"Disputed or unsure, and not counted: {state_count(score.disputed, 'pair')}.", highlight=False)
    curve = Table(title="Touching below a gap of", box=None, header_style="bold")
    for heading in ("gap [µm]", "precision", "recall", "F1"):
        curve.add_column(heading, justify="right")
    for row in even_subset(len(score.curve.threshold), _CURVE_ROWS):
        cells = (f"{getattr(score.curve, name)[row]:.3f}" for name in ("precision", "recall", "f1"))
        curve.add_row(f"{1e6 * score.curve.threshold[row]:.1f}", *cells)
    console.print(curve)
    if fitted is not None:
        console.print(
            f"Recommended from {state_count(fitted.contacts, 'contact')} and {state_count(fitted.others, 'other')}: "
            f"threshold {1e6 * fitted.threshold:.1f} µm (with estimator nlgs contacts.threshold="
            f"{fitted.threshold:.4g}, or contacts.threshold_sigmas={fitted.threshold_sigmas:.3g}). Radius correction "
            f"{1e6 * fitted.radius_change:+.2f} ± {1e6 * fitted.radius_change_sd:.2f} µm on every grain; with it the "
            f"threshold is {1e6 * fitted.threshold_with_change:.1f} µm.",
            highlight=False,
            soft_wrap=True,
        )


def _pairs_of(run: ReviewedRun, candidates: CandidatePairs, decisions: Decisions) -> JudgedPairs:
    results, frame = run.results, candidates.frame
    yes, no = decisions.forced(frame), decisions.forbidden(frame)
    key = join_keys(candidates.key, yes, no)
    key = key[are_present(key, results.tracks.present_in(frame), candidates.contacts.body_count)]
    contacts = measure_pairs(results.grains, results.tracks.position[frame], results.walls.at_rest(frame), key)
    stratum = match_values(key, candidates.key, strata(candidates), fill=-1)
    detected = match_values(key, candidates.key, candidates.detected, fill=False)
    probability = match_values(key, candidates.key, candidates.probability)
    outcome = np.where(are_among(key, yes), YES, np.where(are_among(key, no), NO, UNJUDGED))
    return JudgedPairs(contacts.gap, contacts.with_wall, stratum, detected, probability, outcome)


def _plain(value: Any) -> Any:
    value = float(value) if isinstance(value, float | np.floating) else value
    return None if isinstance(value, float) and not np.isfinite(value) else value
