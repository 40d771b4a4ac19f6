"""Predict the accuracy of the forces from the first photographs, for `check` and for the workbench."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .experiment.config.experiment_file import ExperimentFile
from .experiment.experiment import Experiment, GrainGuess, read_grain_guess
from .inference.assumption_trials import inputs_as_used
from .inference.diagnosis.data_quality import DataQuality, measure_data_quality
from .inference.diagnosis.diagnose import diagnose
from .inference.diagnosis.smoothed_tracks import EXPECTED_OF_SMOOTHED, LOW_OF_SMOOTHED
from .inference.diagnosis.trial import PREDICTED_PHOTOGRAPHS, Trial, solve_trial
from .inference.inference_settings import material_of, settings_of
from .inference.inputs import Inputs
from .inference.solve_frames import InferenceObserver
from .process.errors import UndeterminedError
from .process.machine.linear_algebra import one_thread_each
from .process.progress import Progress, no_progress
from .results.finding import Finding
from .solver.assessment.penalties import TRUST_OF_FEW, describe_few_grains, describe_few_photographs
from .solver.assessment.trust import interior_limit
from .tracks import Tracks, WallTracks

if TYPE_CHECKING:
    from .tracking.picture_quality import PictureQuality

GOOD, POOR = 0.9, 0.75  # expected r(f_n) from which on nothing is wrong, and below which something is
MOST_STATED = 0.99  # expected r(f_n)
# Expected r(f_n) from which on the forces fit the given friction, so that another one is not named: the sliding of few
# contacts, which one wrong radius can contradict, is weaker evidence.
FITTING = 0.985
COMPARED = 0.97  # expected r(f_n) below which rival inputs are compared
NO_EXPECTATION = (math.nan, math.nan, math.nan)
NOT_PREDICTED = (
    "The accuracy of the forces is not predicted: a prediction needs grains and walls seen in two consecutive "
    "photographs."
)
NOT_PREDICTED_OF_ONE = (
    "The accuracy of the forces is not predicted: one photograph shows no motion, and their trust is at most "
    f"{TRUST_OF_FEW:g}. Take more photographs."
)
NO_FORCES = (
    "Something is wrong: no forces of the first photographs are in equilibrium. Check radii, walls and loads, and "
    "whether rods are missing."
)


@dataclass(frozen=True, slots=True)
class Prediction:
    """Accuracy of the forces by the first photographs, solved as a run solves them."""

    quality: DataQuality | None  # None: cannot be measured
    trial: Trial | None  # None: there are no forces
    remark: str = ""  # why there are none
    diagnosis: tuple[Finding, ...] = ()  # causes of what contradicts the forces

    @property
    def expected(self) -> tuple[float, float, float]:
        """Expected r(f_n), and an interval with a coverage of two thirds; NaN where there is no trial.

        With too few photographs, or smoothed tracks, it is limited as the trust of the run is.
        """
        if self.trial is None:
            return NO_EXPECTATION
        r, low, high = self.trial.expect(contradicted=any(not each.corrected for each in self.diagnosis))
        if any(each.cause == "smoothed_tracks" for each in self.diagnosis):  # estimates share its errors
            r, low = min(r, EXPECTED_OF_SMOOTHED), min(low, LOW_OF_SMOOTHED)
        most = TRUST_OF_FEW if describe_few_photographs(self.trial.photographs) else 1.0
        return min(r, most), min(low, most), min(high, most)

    @property
    def good(self) -> bool:
        """Whether nothing speaks against the forces."""
        return self.expected[0] >= GOOD and not self.diagnosis

    def verdict(self) -> str:
        """State the prediction in a sentence."""
        r, low, high = self.expected
        if self.trial is None or math.isnan(r):
            return self.remark or NOT_PREDICTED
        # A prediction of 1.00 would claim more than any evidence gives.
        r, low, high = (min(each, MOST_STATED) for each in (r, low, high))
        number, interval = f"expected r(f_n) {r:.2f}", f"{low:.2f} to {high:.2f}"
        number += "" if interval == f"{r:.2f} to {r:.2f}" else f" ({interval})"
        if self.trial.stride > 1:
            number += f" from every {_ordinal(self.trial.stride)} photograph, --frames ::{self.trial.stride}"
        causes = " ".join(each.sentence() for each in self.diagnosis)
        if self._too_few:
            return f"The forces cannot be judged: {self._too_few}; {number}. {causes}".rstrip()
        worst = self.trial.worst
        obstacle = "" if self.quality is None else self.quality.obstacle
        obstacle = obstacle or (worst.words if worst.little_known else "")
        if causes:
            return f"Something is wrong: {number}. {causes}"
        if r >= GOOD:
            return f"The forces can be found: {number}."
        if r < POOR and obstacle:
            return f"These data cannot carry forces: {obstacle}; {number}."
        reason = obstacle or worst.words
        if r < POOR:
            return f"Something is wrong: {number}; {reason}."
        return f"The forces are uncertain: {number}; {reason}."

    @property
    def _too_few(self) -> str:
        """Why forces cannot be judged, be they right or wrong: too few photographs or interior grains; empty: they can.

        Both limit the trust of the run, too.
        """
        assert self.trial is not None
        few = describe_few_photographs(self.trial.photographs)
        if not few and all(interior_limit(each) < POOR for each in self.trial.evidence):
            few = describe_few_grains(self.trial.evidence[0])
        return few

    def describe(self) -> list[str]:
        """State the prediction, then what the data are like."""
        return [self.verdict(), *([] if self.quality is None else self.quality.describe())]


@one_thread_each
def predict_accuracy(
    config: ExperimentFile, tracks: Tracks, walls: WallTracks | None, progress: Progress = no_progress
) -> Prediction:
    """Predict the accuracy of the forces by a trial solution of the first photographs.

    Parameters
    ----------
    config : ExperimentFile
        Material and settings.
    tracks, walls : Tracks, WallTracks or None
        Of the whole test or of its first photographs.
    progress : callable
        Called after every frame.
    """
    quality = measure_data_quality(tracks, walls)
    if walls is None:
        return Prediction(quality, None)
    if tracks.frame_count == 1:
        return Prediction(quality, None, NOT_PREDICTED_OF_ONE)
    inputs = Inputs(tracks, walls, material_of(config), settings_of(config))
    try:
        inputs, corrected = inputs_as_used(inputs)
        observer = InferenceObserver(progress)
        trial = solve_trial(inputs, PREDICTED_PHOTOGRAPHS, observer, by_forces=True, corrected=corrected)
        compared = trial is not None and trial.expected[0] < COMPARED
        given = solve_trial(inputs, observer=InferenceObserver(progress)) if compared else None
        found = diagnose(inputs, given, progress)
        if trial is not None and trial.expected[0] >= FITTING:
            found = [each for each in found if each.cause != "friction"]
        unsolved = trial is None or math.isnan(trial.expected[0])
        return Prediction(quality, trial, NO_FORCES if unsolved and quality is not None else "", tuple(found))
    except UndeterminedError as error:
        return Prediction(quality, None, f"The first photographs alone do not determine everything: {error}.")


def track_first_photographs(
    experiment: Experiment, notify: Callable[[str], None] = lambda _: None
) -> tuple[Tracks, WallTracks | None]:
    """Track the first photographs without storing the result. Raises InputError where no grain is found."""
    from .tracking.stage import track_first  # imported late: given tracks do not need it

    return track_first(experiment, PREDICTED_PHOTOGRAPHS, no_progress, notify)


def measure_photographs(experiment: Experiment, rods: GrainGuess | None) -> PictureQuality:
    """Measure light, noise and pattern of the photographs; rods: some of the first photograph [px], None: unknown."""
    from .tracking.picture_quality import measure_pictures

    centre = None if rods is None else np.stack([rods.x, rods.y], axis=1)
    section = experiment.config.photographs
    return measure_pictures(
        experiment.photographs(), centre, None if rods is None else rods.radius,
        patterned=section is None or section.follow != "outline",
    )  # fmt: skip


def describe_photographs(experiment: Experiment) -> list[str]:
    """Describe light, noise and pattern of the photographs in a few sentences. Raises InputError."""
    from .tracking.missed_rods import describe_missed_rods

    rods = read_grain_guess(experiment)
    measured = measure_photographs(experiment, rods)
    missed = [] if rods is None else describe_missed_rods(experiment, rods)
    return [*measured.facts(), *measured.faults(), *missed]


def _ordinal(number: int) -> str:
    return {2: "second", 3: "third"}.get(number, f"{number}th")
