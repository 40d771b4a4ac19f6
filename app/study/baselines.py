"""Agreement of motion-free baselines with the truth, beside that of the run's forces, on the same pairs."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from ..inference.snapshots import make_snapshots
from ..results.results import Results, TruthContacts
from ..solver.baselines.motion_free import MotionFreeForces, estimate_motion_free
from ..solver.bodies.grains import Array
from ..solver.bodies.motion import Snapshot
from ..solver.bodies.packing import Packing
from ..solver.bodies.rods import RodMaterial
from ..solver.contacts.contacts import ContactSource
from ..solver.contacts.pairs import Keys, join_keys, match_values
from ..solver.detection.precision import measure_precision
from ..solver.frame_forces import FrameForces
from ..solver.statistics.agreement import pearson


@dataclass(frozen=True, slots=True)
class BaselineAgreement:
    """Correlations of f_n with the truth in one frame, on all candidate pairs and all contacts of either side."""

    r_ours: float
    r_static: float  # in equilibrium, nearest to the same force on every contact
    r_overlap: float  # in equilibrium, nearest to forces proportional to the overlaps
    r_uniform: float  # the same force on every contact


def score_baselines(results: Results, truth: TruthContacts) -> list[BaselineAgreement]:
    """Compare every frame; the baselines use the corrected data from which the run's forces were computed."""
    true = truth.by_frame(results.grains.count + results.walls.count, len(results.frames))
    return compare_baselines(
        packing_of(results), make_snapshots(results.tracks, results.walls), results.frames, true
    )  # fmt: skip


def compare_baselines(
    packing: Packing, snapshots: Sequence[Snapshot], frames: Sequence[FrameForces], true: Sequence[tuple[Keys, Array]]
) -> list[BaselineAgreement]:
    """Compare frames with baselines from their snapshots; true: keys (t,) and forces (t, 2) [N] of every frame."""
    measured = measure_precision(packing.grains, snapshots)
    found = []
    for k, frame in enumerate(frames):
        listed = frame.source != ContactSource.FORBIDDEN_BY_REVIEWER
        # The stated noise omits constant errors, the measured noise omits others: the larger is used.
        noise = max(snapshots[k].sigma, measured.sigma if measured is not None else 0.0)
        baseline = estimate_motion_free(packing, snapshots, k, noise)
        found.append(_compare(baseline, frame.contacts.key[listed], frame.fn[listed], *true[k]))
    return found


def baseline_lists(agreement: Sequence[BaselineAgreement]) -> dict[str, list[float | None]]:
    """Return lists per frame, None where a correlation does not exist: the public `baselines` object."""
    return {
        each.name: [round(r, 6) if np.isfinite(r := getattr(row, each.name)) else None for row in agreement]
        for each in fields(BaselineAgreement)
    }


def describe_baselines(agreement: Sequence[BaselineAgreement]) -> str:
    """Return one line with the mean correlations over all frames."""
    mean = {name: _mean([r for r in values if r is not None]) for name, values in baseline_lists(agreement).items()}
    return (
        f"On all candidate pairs, mean r(f_n) of these forces {mean['r_ours']}; of motion-free baselines: in "
        f"equilibrium {mean['r_static']}, nearest to the overlaps {mean['r_overlap']}, uniform {mean['r_uniform']}."
    )


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f}" if values else "–"


def _compare(baseline: MotionFreeForces, key: Keys, fn: Array, true_key: Keys, true_force: Array) -> BaselineAgreement:
    pairs = join_keys(baseline.candidates, key, true_key)
    true = match_values(pairs, true_key, true_force[:, 0])
    forces = (
        (key, fn),
        *((baseline.contacts.key, f[:, 0]) for f in (baseline.balanced, baseline.overlapping, baseline.uniform)),
    )
    return BaselineAgreement(*(pearson(match_values(pairs, *each), true) for each in forces))


def packing_of(results: Results) -> Packing:
    """Return the packing that was solved: material from the stored configuration, friction as used."""
    section = tomllib.loads(results.configuration).get("material", {})
    given = {each.name: section[each.name] for each in fields(RodMaterial) if each.name in section}
    given["friction"] = results.friction
    if not isinstance(given.get("wall_friction"), int | float):
        given["wall_friction"] = None
    given["gravity"] = tuple(given.get("gravity", (0.0, 0.0)))
    material = RodMaterial(**given)
    pressure = results.walls.usual_pressure(material.length)
    return material.pack(results.tracks.radius, pressure, boundary=results.tracks.boundary)
