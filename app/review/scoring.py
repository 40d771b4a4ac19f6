"""The detector against the verdicts: precision, recall and F1 per frame, and what threshold and radii they ask for."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from app.errors import InputError
from app.review.candidates import Candidates, find_candidates, walls_at
from app.review.command import Reviewed
from app.review.decisions import Decisions, decide
from app.review.queue import strata
from app.review.threshold import ThresholdCurve, ThresholdFit, even_thresholds, fit_threshold, threshold_curve
from solver.contacts import measure_contacts
from solver.grains import Array

_SEED = 11  # of the bootstrap
_CURVE_ROWS = 9  # of the curve on the terminal


@dataclass(frozen=True, slots=True)
class FrameScore:
    """The judged pairs of one frame against the detector, plain counts."""

    frame: int  # of the experiment
    hits: int  # detected, and a contact
    false: int  # detected, but no contact
    missed: int  # a contact, but not detected

    @property
    def precision(self) -> float:
        return self.hits / (self.hits + self.false) if self.hits + self.false else float("nan")

    @property
    def recall(self) -> float:
        return self.hits / (self.hits + self.missed) if self.hits + self.missed else float("nan")

    @property
    def f1(self) -> float:
        judged = 2 * self.hits + self.false + self.missed
        return 2 * self.hits / judged if judged else float("nan")


@dataclass(frozen=True, slots=True)
class JudgedPairs:
    """All pairs with a verdict, over all frames."""

    gap: Array  # (c,) [m]
    touching: NDArray[np.bool_]  # (c,)
    with_wall: NDArray[np.bool_]  # (c,)
    weight: Array  # (c,) how many candidates of its frame and stratum each stands for


@dataclass(frozen=True, slots=True)
class VerdictScore:
    frames: list[FrameScore]  # those with a verdict
    total: FrameScore
    pairs: JudgedPairs
    curve: ThresholdCurve
    disputed: int


def score_verdicts(reviewed: Reviewed) -> VerdictScore | None:
    """Compare the detector with the verdicts in the log; None where there is none.

    What a reviewer forced or forbade counts as the detector saw it, as far as the results still tell: its P(touch).
    """
    results = reviewed.results
    decisions = decide(
        reviewed.log, reviewed.bodies, first_frame=reviewed.first_frame, frame_count=len(results.frames)
    )
    if decisions.count == 0:
        return None
    frames, parts = [], []
    for frame in sorted({k for k, _ in decisions.contact | decisions.no_contact}):
        candidates = find_candidates(results, frame, reviewed.threshold)
        scored, pairs = _score_frame(reviewed, frame, candidates, decisions)
        frames.append(scored)
        parts.append(pairs)
    pairs = JudgedPairs(*(np.concatenate([getattr(p, name) for p in parts]) for name in JudgedPairs.__slots__))
    total = FrameScore(-1, *(sum(getattr(f, name) for f in frames) for name in ("hits", "false", "missed")))
    curve = threshold_curve(pairs.gap, pairs.touching, pairs.weight, even_thresholds(pairs.gap))
    return VerdictScore(frames, total, pairs, curve, len(decisions.disputed))


def fit(reviewed: Reviewed, score: VerdictScore) -> ThresholdFit:
    """Threshold and radius correction that the verdicts recommend."""
    deviation = float(np.mean(reviewed.results.tracks.position_sigma))
    pairs = score.pairs
    try:
        return fit_threshold(
            pairs.gap, pairs.touching, pairs.with_wall, pairs.weight, deviation, np.random.default_rng(_SEED)
        )
    except ValueError as error:
        raise InputError(reviewed.log.file, "", str(error)) from None


def as_json(score: VerdictScore, fitted: ThresholdFit | None) -> dict[str, Any]:
    """The public `verdicts` object of `rodsight score --json`."""
    told: dict[str, Any] = {
        "frame": [each.frame for each in score.frames],
        **{name: [_plain(getattr(f, name)) for f in score.frames] for name in ("precision", "recall", "f1")},
        "judged": [f.hits + f.false + f.missed for f in score.frames],
        "total": {name: _plain(getattr(score.total, name)) for name in ("precision", "recall", "f1")},
        "disputed": score.disputed,
        "curve": {
            name: [_plain(v) for v in getattr(score.curve, name)] for name in ("threshold", "precision", "recall", "f1")
        },
    }
    if fitted is not None:
        told["fit"] = {name: _plain(value) for name, value in asdict(fitted).items()}
    return told


def print_score(console: Console, score: VerdictScore, fitted: ThresholdFit | None) -> None:
    """Print the frames, the curve and what is recommended."""
    table = Table(title="Detector against verdicts", box=None, header_style="bold")
    for heading in ("frame", "judged contacts", "precision", "recall", "F1"):
        table.add_column(heading, justify="right")
    for each in [*score.frames, score.total]:
        name = "all" if each is score.total else str(each.frame)
        shares = (f"{value:.3f}" for value in (each.precision, each.recall, each.f1))
        table.add_row(name, str(each.hits + each.missed), *shares)
    console.print(table)
    if score.disputed:
        console.print(f"{score.disputed} pairs are disputed or unsure and count for nothing.", highlight=False)
    curve = Table(title="Touching below a gap of", box=None, header_style="bold")
    for heading in ("gap [µm]", "precision", "recall", "F1"):
        curve.add_column(heading, justify="right")
    for row in np.unique(np.linspace(0, len(score.curve.threshold) - 1, _CURVE_ROWS).round().astype(int)):
        shares = (f"{getattr(score.curve, name)[row]:.3f}" for name in ("precision", "recall", "f1"))
        curve.add_row(f"{1e6 * score.curve.threshold[row]:.1f}", *shares)
    console.print(curve)
    if fitted is not None:
        console.print(
            f"Recommended from {fitted.contacts} contacts and {fitted.others} others: threshold "
            f"{1e6 * fitted.threshold:.1f} µm (contacts.threshold={fitted.threshold:.4g}, or "
            f"contacts.threshold_sigmas={fitted.threshold_sigmas:.3g}). Radius correction "
            f"{1e6 * fitted.radius_change:+.1f} ± {1e6 * fitted.radius_change_sd:.1f} µm on every grain; with it the "
            f"threshold is {1e6 * fitted.threshold_with_change:.1f} µm.",
            highlight=False,
            soft_wrap=True,
        )


def _score_frame(
    reviewed: Reviewed, frame: int, candidates: Candidates, decisions: Decisions
) -> tuple[FrameScore, JudgedPairs]:
    results = reviewed.results
    yes, no = decisions.forced(frame), decisions.forbidden(frame)
    here = results.tracks.present[frame]
    bodies, n = results.grains.count + results.walls.count, results.grains.count
    seen = np.concatenate([here, np.ones(results.walls.count, np.bool_)])
    key = np.union1d(yes, no)
    key = key[seen[key // bodies] & seen[key % bodies]]
    touching = np.isin(key, yes)
    position, walls = results.tracks.position[frame], walls_at(results, frame)
    contacts = measure_contacts(results.grains, position, walls, key // bodies, key % bodies)
    detected = np.isin(key, candidates.key[candidates.detected])
    scored = FrameScore(
        frame + reviewed.first_frame,
        int((touching & detected).sum()), int((~touching & detected).sum()), int((touching & ~detected).sum()),
    )  # fmt: skip
    weight = np.ones(len(key))
    stratum = strata(candidates)
    judged = np.isin(candidates.key, key)
    for h in np.unique(stratum):
        inside = stratum == h
        if (judged & inside).any():
            weight[np.isin(key, candidates.key[inside])] = inside.sum() / (judged & inside).sum()
    return scored, JudgedPairs(contacts.gap, touching, contacts.j >= n, weight)


def _plain(value: Any) -> Any:
    value = float(value) if isinstance(value, float | np.floating) else value
    return None if isinstance(value, float) and not np.isfinite(value) else value
