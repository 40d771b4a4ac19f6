"""How far forces that need no motion agree with the truth, beside the run's own, on the same pairs."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from solver.baselines.still_forces import StillForces, estimate_still
from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.contacts.contacts import ContactSource
from solver.contacts.pairs import Keys, join_keys, recall
from solver.detection.precision import measure_precision
from solver.sequence.frame_forces import FrameForces
from solver.statistics.agreement import pearson

from ..inference.snapshots import make_snapshots
from ..results.results import Results, TruthContacts


@dataclass(frozen=True, slots=True)
class BaselineAgreement:
    """Correlations of f_n with the truth in one frame, on all near pairs and all that either side names."""

    r_ours: float
    r_static: float  # in balance, near the same force on every contact
    r_overlap: float  # in balance, near forces in proportion to the overlaps
    r_uniform: float  # the same force on every contact


def score_baselines(results: Results, truth: TruthContacts) -> list[BaselineAgreement]:
    """Compare every frame; the baselines see what the run's own forces were made from, as it was corrected."""
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
        # What is told of the noise leaves errors out that stay the same; what is measured, errors of another kind.
        noise = max(snapshots[k].sigma, measured.sigma if measured is not None else 0.0)
        still = estimate_still(packing, snapshots, k, noise)
        found.append(_compare(still, frame.contacts.key[listed], frame.fn[listed], *true[k]))
    return found


def baseline_lists(agreement: Sequence[BaselineAgreement]) -> dict[str, list[float | None]]:
    """Lists per frame, None where a correlation does not exist: the public `baselines` object."""
    return {
        each.name: [round(r, 6) if np.isfinite(r := getattr(row, each.name)) else None for row in agreement]
        for each in fields(BaselineAgreement)
    }


def tell_baselines(agreement: Sequence[BaselineAgreement]) -> str:
    """One line: the mean correlations over all frames."""
    mean = {name: _mean([r for r in values if r is not None]) for name, values in baseline_lists(agreement).items()}
    return (
        f"On all near pairs, mean r(f_n) of these forces {mean['r_ours']}; of forces that need no motion: in balance "
        f"{mean['r_static']}, pulled towards the overlaps {mean['r_overlap']}, the same everywhere {mean['r_uniform']}."
    )


def _mean(values: Sequence[float]) -> str:
    return f"{np.mean(values):.3f}" if values else "–"


def _compare(still: StillForces, key: Keys, fn: Array, true_key: Keys, true_force: Array) -> BaselineAgreement:
    pairs = join_keys(still.near, key, true_key)
    true = recall(pairs, true_key, true_force[:, 0])
    fields_of = (
        (key, fn),
        *((still.contacts.key, f[:, 0]) for f in (still.balanced, still.overlapping, still.uniform)),
    )
    return BaselineAgreement(*(pearson(recall(pairs, *each), true) for each in fields_of))


def packing_of(results: Results) -> Packing:
    """The packing as it was solved: its material is in the configuration, its friction as it was used."""
    section = tomllib.loads(results.configuration).get("material", {})
    told = {each.name: section[each.name] for each in fields(RodMaterial) if each.name in section}
    told["friction"] = results.friction
    if not isinstance(told.get("wall_friction"), int | float):
        told["wall_friction"] = None
    told["gravity"] = tuple(told.get("gravity", (0.0, 0.0)))
    material = RodMaterial(**told)
    pressure = results.walls.usual_pressure(material.length)
    return material.pack(results.tracks.radius, pressure, boundary=results.tracks.boundary)
