"""Whether what is stated holds on simulated truth: intervals, trust and statistics, and what no longer does."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameStatus
from solver.statistics.agreement import compare_forces

from ... import __version__
from ...progress import Progress, silent
from ...synthetic.worlds.names import WorldName
from ..worlds.contact_errors import ContactErrors, measure_errors
from ..worlds.intervals import FIRST, GROUPS, covered, tell_misses
from ..worlds.numbers import Compared, compare_numbers, number_rows, relative_bias, world_rows
from ..worlds.solved_world import SolvedWorld, solve_worlds
from ..worlds.world_score import WorldPlan

# Between which shares a group's intervals hold, of one and of two deviations; and the same of few contacts.
HOLDS = ((0.60, 0.82), (0.91, 0.985))
FEW = 400  # contacts of a group, below which nothing is said of it
MOST_TOO_TRUSTING = 0.05  # of the frames: r may be below T in
MOST_SLIDING_BIAS = 0.15  # of the true share of sliding contacts


@dataclass(frozen=True, slots=True)
class TrustedFrames:
    """Frames with a trust."""

    world: NDArray[np.str_]  # (f,)
    trust: Array  # (f,)
    r: Array  # (f,) correlation of f_n with the truth
    suspect: NDArray[np.bool_]  # (f,)


@dataclass(frozen=True, slots=True)
class CalibrationStudy:
    """What was solved, and what came of it."""

    worlds: tuple[WorldName, ...]
    seeds: tuple[int, ...]
    grains: int
    errors: ContactErrors
    numbers: list[Compared]
    frames: TrustedFrames

    @property
    def data_hash(self) -> str:
        """SHA-256 of all errors, trusts and statistics: the same for the same program on the same machine."""
        digest = hashlib.sha256()
        for array in (self.errors.error, self.errors.deviation, self.frames.trust, self.frames.r):
            digest.update(np.ascontiguousarray(array).tobytes())
        for each in self.numbers:
            digest.update(each.name.encode() + each.stated.tobytes() + each.true.tobytes())
        return digest.hexdigest()

    @property
    def too_trusting(self) -> float:
        """Share of the frames whose correlation is below their trust."""
        return float(np.mean(self.frames.r < self.frames.trust)) if len(self.frames.r) else float("nan")

    @property
    def coverage(self) -> dict[str, tuple[float, ...]]:
        """By group: the shares of f_n, then of f_t, within one and within two deviations."""
        parts = {name: self.errors.select(choose(self.errors)) for name, choose in GROUPS.items()}
        return {name: covered(part) for name, part in parts.items() if len(part.group) >= FEW}

    @property
    def coverage_by_world(self) -> dict[str, tuple[float, ...]]:
        """The same of all contacts of each world, its first frames left out."""
        late = self.errors.select(GROUPS["all"](self.errors))
        return {str(world): covered(late.select(late.world == world)) for world in np.unique(late.world)}

    def facts(self) -> dict[str, Any]:
        """All as plain values."""
        return {
            "version": __version__, "worlds": list(self.worlds), "seeds": list(self.seeds), "grains": self.grains,
            "data": self.data_hash, "contacts": len(self.errors.group), "coverage": self.coverage,
            "coverage_by_world": self.coverage_by_world,
            "frames": len(self.frames.r), "too_trusting": self.too_trusting,
            "bias": {
                name: relative_bias([each for each in self.numbers if each.name == name])
                for name in dict.fromkeys(each.name for each in self.numbers)
            },
            "broken": broken(self),
        }  # fmt: skip


def study_calibration(
    plan: WorldPlan, worlds: Sequence[WorldName], seeds: Sequence[int], progress: Progress = silent
) -> CalibrationStudy:
    """Solve worlds and compare everything that is stated with their truth."""
    errors, numbers, frames = [], [], []
    for solved in solve_worlds(plan, worlds, seeds, progress):
        errors.append(measure_errors(solved))
        numbers += compare_numbers(solved)
        frames.append(_frames_of(solved))
    joined = TrustedFrames(*(np.concatenate(column) for column in zip(*frames, strict=True)))
    return CalibrationStudy(tuple(worlds), tuple(seeds), plan.grains, ContactErrors.joined(errors), numbers, joined)


def broken(study: CalibrationStudy) -> list[str]:
    """What does not hold any more, a sentence each."""
    found = []
    for name, shares in study.coverage.items():
        if name == FIRST:  # of a few worlds, each with a force network of its own: told, but not held to
            continue
        for share, (low, high), label in zip(
            shares, HOLDS * 2, ("one deviation of f_n", "two of f_n", "one deviation of f_t", "two of f_t"), strict=True
        ):
            if not low <= share <= high:
                found.append(f"{label} of {name} contacts: covers {100 * share:.0f} %, not {low:.0%} to {high:.0%}")
    if study.too_trusting > MOST_TOO_TRUSTING:
        found.append(f"the correlation is below the trust in {100 * study.too_trusting:.0f} % of the frames, not 5 %")
    sliding = relative_bias([each for each in study.numbers if each.name == "sliding_fraction"])
    if abs(sliding) > MOST_SLIDING_BIAS:
        found.append(f"the share of sliding contacts is off by {100 * sliding:+.0f} %")
    return found


def rows_of_coverage(study: CalibrationStudy) -> list[list[str]]:
    """A row of cells for every kind of contact and every world: what is covered, and what of it is off."""
    both = {**study.coverage, **study.coverage_by_world}
    return [[name, *(f"{100.0 * share:.0f}" for share in shares), tell_misses(shares)] for name, shares in both.items()]


def rows_of_sliding(study: CalibrationStudy) -> list[list[str]]:
    """A row of cells for every world: the share of contacts that slide, under WORLD_HEADINGS."""
    return world_rows(study.numbers, "sliding_fraction")


def rows_of_numbers(study: CalibrationStudy) -> list[list[str]]:
    """A row of cells for every statistic, under the headings of `numbers`."""
    return number_rows(study.numbers)


def _frames_of(solved: SolvedWorld) -> tuple[NDArray[Any], Array, Array, NDArray[Any]]:
    told = [
        (frame.trust, compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *solved.true[k]).r_fn,
         frame.status is FrameStatus.SUSPECT)
        for k, frame in enumerate(solved.checked)
        if np.isfinite(frame.trust)
    ]  # fmt: skip
    trust, r, suspect = (np.array(column) for column in zip(*told, strict=True))
    return np.full(len(told), solved.world), trust, r, suspect
