"""One pair of bodies in all frames of a run, and the forces of a frame without a contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...results.results import Results
from ...reviewing.judging.candidate_pairs import gap_standard_deviation
from ...reviewing.rounding import rounded, rounded_one
from ...solver.contacts.contacts import measure_pairs
from ...solver.contacts.pairs import match_values
from ...solver.redistribution.contact_removal import remove_contact
from ...verdicts.decisions import BodyNames
from ...verdicts.log import Body

BALANCED = 0.05  # [mean f_n] force residual below which the rods count as balanced


def pair_history(results: Results, i: Body, j: Body) -> dict[str, Any] | None:
    """List gap, force and probability of a pair in every frame; None: no such pair."""
    bodies = BodyNames.of(results.tracks, results.walls)
    rows = bodies.rows()
    if i not in rows or j not in rows or i == j:
        return None
    a, b = sorted((rows[i], rows[j]))
    n = results.grains.count
    if a >= n:
        return None
    key = np.array([bodies.key(a, b)], np.int64)
    values: dict[str, list[Any]] = {
        name: [] for name in ("gap", "gap_sd", "fn", "fn_sd", "ft", "ft_sd", "probability", "state", "point")
    }
    for frame in range(len(results.frames)):
        tracks, forces = results.tracks, results.frames[frame]
        here = all(row >= n or bool(tracks.frame(frame).present[0, row]) for row in (a, b))
        measured = measure_pairs(results.grains, tracks.position[frame], results.walls.at_rest(frame), key)
        values["gap"] += rounded(measured.gap if here else [np.nan])
        values["gap_sd"] += rounded(gap_standard_deviation(measured, float(tracks.frame(frame).position_sigma[0])))
        for name in ("fn", "fn_sd", "ft", "ft_sd", "probability"):
            values[name] += rounded(match_values(key, forces.contacts.key, getattr(forces, name), fill=np.nan))
        values["state"].append(bool((forces.contacts.key == key[0]).any()))
        values["point"].append(measured.point[0].tolist() if here else None)
    return values


def forces_without(results: Results, frame: int, i: Body, j: Body) -> dict[str, Any] | None:
    """Compute the nearest forces of a frame without a contact; None where the pair is no contact."""
    bodies = BodyNames.of(results.tracks, results.walls)
    rows, forces = bodies.rows(), results.frames[frame]
    if i not in rows or j not in rows or i == j:
        return None
    place = np.flatnonzero(forces.contacts.key == bodies.key(*sorted((rows[i], rows[j]))))
    if len(place) != 1:
        return None
    removal = remove_contact(
        results.grains, forces.contacts, forces.fn, forces.ft, int(place[0]), friction=results.contact_friction(frame)
    )
    change = removal.fn - forces.fn
    largest = np.argsort(-np.abs(np.where(removal.free, change, 0.0)))[:6]
    mean = results.statistics[frame].mean_fn
    return {
        "fn": rounded(removal.fn), "ft": rounded(removal.ft), "change": rounded(change), "residual": removal.unbalance,
        "balanced": removal.unbalance < BALANCED,
        "total_change": float(np.abs(change[removal.free]).sum() / max(mean, 1e-300)),
        "largest": [
            {"i": bodies.name(int(forces.contacts.i[k])), "j": bodies.name(int(forces.contacts.j[k])),
             "change": rounded_one(float(change[k]))} for k in largest.tolist() if change[k] != 0.0
        ],
    }  # fmt: skip
