"""Error budget of every frame: the error of its forces, and the fraction of the variance that each cause makes.

Each cause is varied alone by its uncertainty, as in the robustness study, and the change of the forces is its error.
The error of the step between photographs is half the change from photographs twice as far apart, because errors grow
with the step. The rest of the calibrated variance is assigned to the method: the history that no photograph carries,
and the disagreement of the ensemble members. Fractions of the variance add up to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from ..process.progress import Progress, no_progress
from ..solver.bodies.grains import Array
from ..solver.frame_forces import ERROR_PARTS, FrameForces
from ..solver.statistics.agreement import compare_forces
from .design import Case
from .ensemble_sd import solve_member
from .execution import run_all
from .networks import Networks, VariedInputs

FRICTION_SD = 0.08  # relative half width of the interval that the motion usually leaves for the friction
OVERLAP_FACTOR = 1.5  # factor by which roughness may be wrong; it decides on ambiguous contacts
MIN_RADIUS_SD = 2e-4  # relative, of the radii, without a calibration that estimates it
STEP_FRACTION = 0.5  # of the change by a doubled step
SEED = 31
UNVARIED = "unvaried"


@dataclass(frozen=True, slots=True)
class ErrorBudget:
    """Errors of f frames."""

    fraction: Array  # (f, p) of the variance, by ERROR_PARTS; NaN for a frame without forces
    error: Array  # (f,) relative error of the forces, ‖σ‖ / ‖f‖

    def apply_to(self, frame: FrameForces) -> FrameForces:
        """Add the budget to its frame."""
        return replace(
            frame, error_budget=self.fraction[frame.frame], relative_error=float(self.error[frame.frame])
        )  # fmt: skip


def budget_cases(inputs: VariedInputs, radius_sd: float = MIN_RADIUS_SD) -> dict[str, Case]:
    """Cases to solve, by cause, the method excluded; radius_sd: relative uncertainty."""
    cases = {
        "positions": Case((("position_noise", 1.0), ("rotation_noise", 1.0)), SEED),
        "radii": Case((("radius_scatter", max(radius_sd, MIN_RADIUS_SD)),), SEED),
        "friction": Case((("friction", 1.0 + FRICTION_SD), ("wall_friction", 1.0 + FRICTION_SD)), SEED),
        "contacts": Case((("overlap", OVERLAP_FACTOR),), SEED),
    }
    if len(inputs.frames) > 3:  # with fewer, every second one leaves no motion
        cases["steps"] = Case((("spacing", 2.0),), SEED)
    return cases


def measure_budget(
    inputs: VariedInputs,
    frames: Sequence[FrameForces],
    cases: dict[str, Case],
    *,
    workers: int = 1,
    progress: Progress = no_progress,
) -> ErrorBudget:
    """Solve every case and divide each frame's error among the causes.

    The reference is solved from the same inputs unvaried, because a run that calibrates first may differ.

    Parameters
    ----------
    inputs : VariedInputs
        Calibrated, as `ensemble_sd.calibrated_inputs` returns them.
    frames : sequence of FrameForces
        With calibrated standard deviations.
    cases : dict of str to Case
        By cause.
    workers : int
        Processes.
    progress : Progress
    """
    names = [UNVARIED, *cases]
    items = [(name, cases.get(name, Case((), SEED))) for name in names]
    solved: dict[str, Networks] = {}
    progress("error budget", 0, len(names))
    with closing(run_all(_solve_part, inputs, items, workers=workers)) as results:
        for number, run in results:
            solved[names[number]] = run
            progress("error budget", len(solved), len(names))
    variance = np.zeros((len(frames), len(ERROR_PARTS)))
    for name in cases:
        variance[:, ERROR_PARTS.index(name)] = _variance_of(name, solved[name], solved[UNVARIED], len(frames))
    return divide(variance, np.array([_stated_variance(each) for each in frames]))


def divide(variance: Array, stated: Array) -> ErrorBudget:
    """Divide the stated variance of every frame among the causes.

    Parameters
    ----------
    variance : ndarray, shape (f, p)
        Squared relative error by cause, in the order of ERROR_PARTS; the last column (method) is ignored.
    stated : ndarray, shape (f,)
        Squared relative error by the calibrated standard deviations; NaN for a frame without forces.

    Notes
    -----
    v_method = max(v_stated − Σ v_cause, 0); fractions are v / Σ v, the error is √Σ v.
    """
    parts = np.nan_to_num(variance)
    parts[:, -1] = np.maximum(np.nan_to_num(stated) - parts[:, :-1].sum(axis=1), 0.0)
    total = parts.sum(axis=1)
    total[~np.isfinite(stated)] = np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        return ErrorBudget(parts / total[:, None], np.sqrt(total))


def _solve_part(inputs: VariedInputs, item: tuple[str, Case]) -> Networks:
    """Solve one case; uncertain centres are part of the radii's error alone."""
    name, case = item
    if name != "radii":
        inputs = replace(inputs, tracks=replace(inputs.tracks, centre_sigma=None))
    return solve_member(inputs, case)


def _variance_of(name: str, run: Networks, nominal: Networks, count: int) -> Array:
    """Squared relative change (f,) of the forces, interpolated for the frames that a run leaves out."""
    at = np.array([int(np.flatnonzero(nominal.frame == frame)[0]) for frame in run.frame])
    change = np.array([
        compare_forces(*run.at(row), *nominal.at(int(k))).relative_l2 for row, k in enumerate(at)
    ])  # fmt: skip
    if name == "steps":
        change = STEP_FRACTION * change
    known = np.isfinite(change)
    if not known.any():
        return np.zeros(count)
    return np.interp(np.arange(count), at[known], change[known] ** 2)


def _stated_variance(frame: FrameForces) -> float:
    """Squared relative error Σσ² / Σf² of a frame; NaN without forces."""
    size = float(np.nansum(frame.fn**2) + np.nansum(frame.ft**2))
    return float(np.nansum(frame.fn_sd**2) + np.nansum(frame.ft_sd**2)) / size if size > 0 else float("nan")
