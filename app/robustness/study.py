"""Robustness study: runs with varied inputs, compared with the nominal run and with the truth if it is known.

The effect of every finished run is stored at once; a repeated study computes only the missing ones.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..inference.inputs import Inputs
from ..process.counts import mean_of_known
from ..process.errors import UndeterminedError
from ..process.progress import Progress, no_progress
from ..results.results import Results, TruthContacts
from ..solver.bodies.grains import Array
from ..solver.statistics.agreement import Agreement, compare_forces
from .design import Case, vary
from .execution import run_all
from .factors import FIRST_COMPARED
from .networks import Networks, VariedInputs, gather, infer

Forces = tuple[NDArray[np.int64], Array]  # keys (c,) and forces (c, 2) [N]


@dataclass(frozen=True, slots=True)
class Nominal:
    """The run that all others are compared with."""

    inputs: VariedInputs
    networks: Networks
    truth: tuple[Forces, ...] | None  # of every photograph; None: unknown

    @classmethod
    def of(cls, inputs: Inputs, results: Results, truth: TruthContacts | None) -> Nominal:
        """Collect the nominal run of these inputs, with its truth if it is known."""
        frames = np.arange(inputs.tracks.frame_count)
        bodies = results.grains.count + results.walls.count
        return cls(
            VariedInputs.of(inputs, results.tracks.sigma, results.diagnosis),
            gather(frames, results.frames, results.statistics),
            None if truth is None else truth.by_frame(bodies, len(frames)),
        )


@dataclass(frozen=True, slots=True)
class Effect:
    """Effect of a varied input on the forces: means over the photographs compared. NaN where there is no value."""

    frames: int  # photographs compared
    r_fn: float  # correlation with the nominal normal forces
    r_ft: float
    relative_l2: float  # ‖f − f_nominal‖ / ‖f_nominal‖
    scale: float  # Σ f_n / Σ f_n,nominal
    friction_angle_change: float  # [°]
    principal_direction_change: float  # [°]
    pressure: float  # [Pa]
    contacts: float  # number that carries force
    trust: float
    true_r_fn: float  # against the truth
    true_r_ft: float
    true_relative_l2: float
    true_scale: float
    failure: str = ""  # why the run failed; empty: it did not


EFFECT_LOG = "sensitivity_runs.jsonl"  # in the run folder
AGREEMENTS = ("r_fn", "r_ft", "relative_l2", "scale")


def measure_case(nominal: Nominal, case: Case) -> Effect:
    """Run one case and measure its effect."""
    try:
        return compare(infer(vary(nominal.inputs, case)), nominal)
    except UndeterminedError as error:
        unknown: dict[str, Any] = {each.name: math.nan for each in fields(Effect)}
        return Effect(**(unknown | {"frames": 0, "failure": str(error)}))


def compare(run: Networks, nominal: Nominal) -> Effect:
    """Compare the photographs of a run that are settled in it and in the nominal run, or the last alone."""
    base = nominal.networks
    _, rows, base_rows = np.intersect1d(run.frame, base.frame, assume_unique=True, return_indices=True)
    late = (rows >= FIRST_COMPARED) & (base_rows >= FIRST_COMPARED)
    if not late.any():
        late[-1:] = True
    rows, base_rows = rows[late], base_rows[late]
    own = [compare_forces(*run.at(k), *base.at(n)) for k, n in zip(rows, base_rows, strict=True)]
    true: list[Agreement] = []
    if nominal.truth is not None:
        true = [compare_forces(*run.at(k), *nominal.truth[n]) for k, n in zip(rows, base_rows, strict=True)]
    direction = run.principal_direction[rows] - base.principal_direction[base_rows]
    angle = run.friction_angle[rows] - base.friction_angle[base_rows]
    return Effect(
        frames=int(late.sum()),
        **_means(own, ""),
        friction_angle_change=mean_of_known(np.degrees(angle)),
        # Of an axis: modulo 180°.
        principal_direction_change=mean_of_known(np.degrees(0.5 * np.angle(np.exp(2j * direction)))),
        pressure=mean_of_known(run.pressure[rows]),
        contacts=mean_of_known(run.contact_count[rows].astype(np.float64)),
        trust=mean_of_known(run.trust[rows]),
        **_means(true, "true_"),
    )


def run_study(
    nominal: Nominal,
    cases: Sequence[Case],
    effect_log: EffectLog,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress = no_progress,
) -> list[Effect]:
    """Measure the effect of every case, in their order; cases in the log are not run again."""
    effects = effect_log.read()
    missing = [case for case in cases if case.key not in effects]
    done, total = len(cases) - len(missing), len(cases)
    progress("varying", done, total)
    with closing(run_all(measure_case, nominal, missing, workers=workers, scheduler=scheduler)) as results:
        for number, effect in results:
            effect_log.write(missing[number], effect)
            effects[missing[number].key] = effect
            done += 1
            progress("varying", done, total)
    return [effects[case.key] for case in cases]


class EffectLog:
    """Log file of effects, one line per run: fingerprint of the nominal run, case, effect.

    Lines are only appended. Lines of another nominal run and a truncated line are skipped.
    """

    def __init__(self, file: Path, fingerprint: str) -> None:
        self.file, self.fingerprint = file, fingerprint

    def read(self) -> dict[str, Effect]:
        """Read the effects by the key of their case."""
        if not self.file.exists():
            return {}
        effects: dict[str, Effect] = {}
        for line in self.file.read_text(encoding="utf-8").splitlines():
            try:
                entry = json.loads(line)
                if entry["of"] == self.fingerprint:
                    effects[entry["case"]] = Effect(**entry["effect"])
            except (ValueError, KeyError, TypeError):
                continue  # truncated, or of another version
        return effects

    def write(self, case: Case, effect: Effect) -> None:
        """Append a line; it is on the disk when this returns."""
        line = json.dumps({"of": self.fingerprint, "case": case.key, "effect": asdict(effect)})
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a+b") as stream:
            # A truncated last line must be ended first.
            stream.seek(max(stream.seek(0, 2) - 1, 0))
            if stream.read(1) not in (b"", b"\n"):
                stream.write(b"\n")
            stream.write(line.encode() + b"\n")


def _means(agreement: Sequence[Agreement], prefix: str) -> dict[str, Any]:
    return {prefix + name: mean_of_known(np.array([getattr(each, name) for each in agreement])) for name in AGREEMENTS}
