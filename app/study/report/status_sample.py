"""Frames of simulated truths with their evidence, status and errors, solved with the settings of `rodsight run`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference.frame_store import MemoryStore
from ...inference.infer_sequence import infer_sequence
from ...inference.inputs import Inputs
from ...process.progress import Progress, no_progress
from ...solver.assessment.evidence import Evidence
from ...solver.assessment.intervals import formula_sd
from ...solver.assessment.intervals.force_intervals import FLOOR, formula_sd_of
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys, match_values
from ...solver.dem.dem_truth import DemTruth
from ...solver.frame_forces import FrameForces, FrameStatus
from ...solver.statistics.agreement import compare_forces
from ..truths import NEGLIGIBLE, WINDOW, agreement_of, observe, true_forces, truth_keys, window_starts

FAULTY_WINDOW = 6
FAULT_NOISE = 1e-5  # [m]
FAULTS = (
    "friction 20 % low",
    "friction 40 % low",
    "friction 40 % high",
    "radii 1 % wrong",
    "grains unseen",
    "tracks off",
)


@dataclass(frozen=True, slots=True)
class StatusSample:
    """Inferred and true quantities of all frames with a preceding motion."""

    evidence: list[Evidence]  # f of them
    status: list[FrameStatus]
    r: Array  # (f,) true correlation of the normal forces
    change: Array  # (f,) 1 − correlation of the true normal forces with those of the previous photograph
    fault: list[str]  # of each frame; empty: no fault
    error: Array  # (c, 2) of f_n and f_t on the contacts of sound frames, over the mean f_n
    force: Array  # (c,) f_n over the mean
    ensemble_sd: Array  # (c, 2) of the members' f_n and f_t over the mean f_n
    stated: Array  # (c, 2) stated standard deviations of f_n and f_t over the mean f_n


def observe_status(
    truths: Sequence[DemTruth], noises: Sequence[float], *, progress: Progress = no_progress
) -> StatusSample:
    """Solve loading and unloading windows of all truths with each noise [m], and one window with each fault."""
    parts: list[StatusSample] = []
    jobs = [
        (t, start, noise, "")
        for t in range(len(truths))
        for start in window_starts(truths[t], WINDOW)
        for noise in noises
    ]
    jobs += [
        (t, window_starts(truths[t], WINDOW)[0], FAULT_NOISE, fault) for t in range(len(truths)) for fault in FAULTS
    ]
    for done, (t, start, noise, fault) in enumerate(jobs):
        progress("status", done, len(jobs))
        parts.append(
            _observe_window(truths[t], start, noise, fault, np.random.default_rng([t, start, round(noise * 1e9)]))
        )
    progress("status", len(jobs), len(jobs))
    return StatusSample(
        [e for part in parts for e in part.evidence],
        [s for part in parts for s in part.status],
        np.concatenate([part.r for part in parts]),
        np.concatenate([part.change for part in parts]),
        [f for part in parts for f in part.fault],
        np.concatenate([part.error for part in parts if not any(part.fault)]),
        np.concatenate([part.force for part in parts if not any(part.fault)]),
        np.concatenate([part.ensemble_sd for part in parts if not any(part.fault)]),
        np.concatenate([part.stated for part in parts if not any(part.fault)]),
    )


def _observe_window(truth: DemTruth, start: int, noise: float, fault: str, rng: np.random.Generator) -> StatusSample:
    window = FAULTY_WINDOW if fault else WINDOW
    inputs = observe(truth, range(start, start + window), noise, rng)
    if fault:
        inputs = _apply_fault(inputs, fault, rng)
    rows, errors, forces, ensemble_sds, stated = [], [], [], [], []
    store = MemoryStore()
    infer_sequence(inputs, store=store, complete=False)
    for solved in store.frames:
        frame, state = solved.forces, solved.state
        if frame.frame == 0:
            continue
        k = start + frame.frame
        key, force = true_forces(truth, k)
        previous_key, previous = true_forces(truth, k - 1)
        rows.append(
            (
                state.evidence,
                frame.status,
                agreement_of(frame, truth, k).r_fn,
                _change(key, force, previous_key, previous),
            )
        )
        error, relative, ensemble_sd, stated_sd = _contact_errors(frame, *truth_keys(frame.contacts, truth), key, force)
        errors.append(error)
        forces.append(relative)
        ensemble_sds.append(ensemble_sd)
        stated.append(stated_sd)
    evidence, status, r, change = zip(*rows, strict=True)
    return StatusSample(
        list(evidence), list(status), np.array(r), np.array(change), [fault] * len(rows),
        np.concatenate(errors), np.concatenate(forces), np.concatenate(ensemble_sds), np.concatenate(stated),
    )  # fmt: skip


def _apply_fault(inputs: Inputs, fault: str, rng: np.random.Generator) -> Inputs:
    """Apply a fault of real experiments to the inputs."""
    tracks, material = inputs.tracks, inputs.material
    n = tracks.grain_count
    some = rng.choice(n, max(n // 100, 2), replace=False)
    if fault.startswith("friction"):
        factor = {"friction 20 % low": 0.8, "friction 40 % low": 0.6, "friction 40 % high": 1.4}[fault]
        wrong = replace(material, friction=factor * material.friction, wall_friction=factor * material.at_walls())
        return replace(inputs, material=wrong)
    if fault == "radii 1 % wrong":  # of one grain in a hundred, too small
        radius = tracks.radius.copy()
        radius[some] *= 0.99
        return replace(inputs, tracks=replace(tracks, radius=radius))
    position, rotation = tracks.position.copy(), tracks.rotation.copy()
    if fault == "grains unseen":
        unseen = some[: max(len(some) // 2, 1)]
        position[:, unseen], rotation[:, unseen] = np.nan, np.nan
        return replace(inputs, tracks=replace(tracks, position=position, rotation=rotation))
    if fault == "tracks off":  # in one photograph, by a fifth of a millimetre
        position[tracks.frame_count // 2, some] += 2e-4 * rng.standard_normal((len(some), 2))
        return replace(inputs, tracks=replace(tracks, position=position))
    raise ValueError(f"unknown fault {fault!r}")


def _change(key: Keys, force: Array, previous_key: Keys, previous: Array) -> float:
    return 1.0 - compare_forces(key, force, previous_key, previous).r_fn


def _contact_errors(
    frame: FrameForces, own: Keys, seen: NDArray[np.bool_], key: Keys, force: Array
) -> tuple[Array, Array, Array, Array]:
    """Return errors of contacts that bear force in the frame or the truth, over the mean f_n.

    Parameters
    ----------
    frame : FrameForces
    own : ndarray
        Keys of the contacts `seen`, in the numbering of the truth.
    seen : ndarray of bool
        (c,) contacts of the frame that the truth can contain.
    key, force : ndarray
        (t,) and (t, 2) [N] of the truth.

    Returns
    -------
    tuple of ndarray
        Error (c, 2), f_n (c,), ensemble and stated standard deviations (c, 2).
    """
    true = match_values(own, key, force)
    mean = float(frame.fn[frame.fn > 0].mean())
    found = np.column_stack([frame.fn, frame.ft])[seen]
    bearing = np.maximum(found[:, 0], true[:, 0]) > NEGLIGIBLE * mean
    error, relative = (found - true) / mean, found[:, 0] / mean
    formula = formula_sd_of(frame)[seen]
    ensemble_sd = np.column_stack([
        _ensemble_sd_of(formula[:, c], relative, (np.hypot(constants[0], FLOOR[c]), *constants[1:]))
        for c, constants in enumerate((formula_sd.NORMAL_SD, formula_sd.TANGENTIAL_SD))
    ])  # fmt: skip
    stated = np.column_stack([frame.fn_sd, frame.ft_sd])[seen] / mean
    return error[bearing], relative[bearing], ensemble_sd[bearing], stated[bearing]


def _ensemble_sd_of(formula_sd: Array, force: Array, constants: tuple[float, float, float]) -> Array:
    """Recover the ensemble's standard deviation from that of the formula, which alone is stored."""
    a, b, c = constants
    return np.sqrt(np.maximum(formula_sd**2 - a**2 - b**2 * force, 0.0)) / c
