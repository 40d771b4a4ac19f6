"""An error budget of every frame: what its forces err by, and which part of that comes from where.

Every cause is varied alone by what it is uncertain by, as the robustness study does, and the change of the forces
counts as its error; steps count half of what photographs twice as far apart change, for errors grow with the step. The
method has what is left of the calibrated deviations: the history that no photograph carries, and how members differ.
Shares are of variances, and add up to one.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from solver.bodies.grains import Array
from solver.sequence.frame_forces import ERROR_PARTS, FrameForces
from solver.statistics.agreement import compare_forces

from ..progress import Progress, silent
from .design import Case
from .execution import run_all
from .networks import Networks, VariedInputs
from .spread import solve_member

FRICTION = 0.08  # relative half width of what the motion usually leaves open of the friction
OVERLAP = 1.5  # what roughness may be wrong by, which decides of doubtful contacts
LEAST_SCATTER = 2e-4  # of the radii, where no calibration says what is left
STEP_SHARE = 0.5  # of what a doubled step changes
SEED = 31
UNVARIED = "unvaried"


@dataclass(frozen=True, slots=True)
class ErrorBudget:
    """The errors of f frames."""

    share: Array  # (f, p) of the variance by ERROR_PARTS, NaN where a frame has none
    error: Array  # (f,) relative error of the forces, ‖σ‖ / ‖f‖

    def told(self, frame: FrameForces) -> FrameForces:
        """The frame with its budget."""
        return replace(
            frame, error_budget=self.share[frame.frame], relative_error=float(self.error[frame.frame])
        )  # fmt: skip


def budget_cases(inputs: VariedInputs, friction: float = FRICTION, scatter: float = LEAST_SCATTER) -> dict[str, Case]:
    """What is solved again for each part but the method's, by its name; friction, scatter: relative uncertainties."""
    cases = {
        "positions": Case((("position_noise", 1.0), ("rotation_noise", 1.0)), SEED),
        "radii": Case((("radius_scatter", max(scatter, LEAST_SCATTER)),), SEED),
        "friction": Case((("friction", 1.0 + friction), ("wall_friction", 1.0 + friction)), SEED),
        "contacts": Case((("overlap", OVERLAP),), SEED),
    }
    if len(inputs.frames) > 3:  # of fewer, every second one leaves no motion
        cases["steps"] = Case((("spacing", 2.0),), SEED)
    return cases


def measure_budget(
    inputs: VariedInputs,
    frames: Sequence[FrameForces],
    cases: dict[str, Case],
    *,
    workers: int = 1,
    progress: Progress = silent,
) -> ErrorBudget:
    """Solve every case and divide each frame's error. inputs: calibrated, as `spread.calibrated_inputs` gives them.

    What they are compared with is solved from the same inputs, nothing varied: a run that calibrates first may differ.
    """
    names = [UNVARIED, *cases]
    items = [(name, cases.get(name, Case((), SEED))) for name in names]
    found: dict[str, Networks] = {}
    progress("error budget", 0, len(names))
    with closing(run_all(_solve_part, inputs, items, workers=workers)) as results:
        for number, run in results:
            found[names[number]] = run
            progress("error budget", len(found), len(names))
    variance = np.zeros((len(frames), len(ERROR_PARTS)))
    for name in cases:
        variance[:, ERROR_PARTS.index(name)] = _variance_of(name, found[name], found[UNVARIED], len(frames))
    return divide(variance, np.array([_stated_variance(each) for each in frames]))


def divide(variance: Array, stated: Array) -> ErrorBudget:
    """Shares of variances (f, p), the method having what is left of those stated (f,); a frame may have none."""
    parts = np.nan_to_num(variance)
    parts[:, -1] = np.maximum(np.nan_to_num(stated) - parts[:, :-1].sum(axis=1), 0.0)
    total = parts.sum(axis=1)
    total[~np.isfinite(stated)] = np.nan
    with np.errstate(divide="ignore", invalid="ignore"):
        return ErrorBudget(parts / total[:, None], np.sqrt(total))


def _solve_part(inputs: VariedInputs, item: tuple[str, Case]) -> Networks:
    """Centres that are not known exactly are part of the radii's error alone."""
    name, case = item
    if name != "radii":
        inputs = replace(inputs, tracks=replace(inputs.tracks, centre_sigma=None))
    return solve_member(inputs, case)


def _variance_of(name: str, run: Networks, nominal: Networks, count: int) -> Array:
    """Squared relative change (f,) of the forces; of frames that a run leaves out, the mean of what is around them."""
    at = np.array([int(np.flatnonzero(nominal.frame == frame)[0]) for frame in run.frame])
    change = np.array([
        compare_forces(*run.at(row), *nominal.at(int(k))).relative_l2 for row, k in enumerate(at)
    ])  # fmt: skip
    if name == "steps":
        change = STEP_SHARE * change
    known = np.isfinite(change)
    if not known.any():
        return np.zeros(count)
    return np.interp(np.arange(count), at[known], change[known] ** 2)


def _stated_variance(frame: FrameForces) -> float:
    """Σσ² / Σf² of a frame; NaN without forces."""
    size = float(np.nansum(frame.fn**2) + np.nansum(frame.ft**2))
    return float(np.nansum(frame.fn_sd**2) + np.nansum(frame.ft_sd**2)) / size if size > 0 else float("nan")
