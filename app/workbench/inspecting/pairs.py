"""Pairs of bodies under inspection: the one that a click means, its numbers over all frames, and which ones a person
should look at first."""

from __future__ import annotations

from typing import Any

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import measure_pairs
from solver.contacts.pairs import recall
from solver.statistics.removal import remove_contact

from ...experiment.units import Scale
from ...results.results import Results
from ...review.judging.candidate_pairs import CandidatePairs, find_candidate_pairs, gap_sigma, walls_at
from ...verdicts.decisions import Bodies
from ...verdicts.log import Body, VerdictLog
from .found import plain

MOST = 5000  # pairs of a list
STANDS = 0.05  # of the mean force: a resultant that is left over below it is borne


def candidates_of(results: Results, frame: int, threshold: float | None) -> CandidatePairs:
    """Every pair of a frame that may touch."""
    return find_candidate_pairs(results, frame, threshold)


def at_stake(results: Results, candidates: CandidatePairs) -> Array:
    """What hangs on every candidate (c,) [N]: its doubt times the force that it carries, or would at the mean."""
    forces, mean = results.frames[candidates.frame], results.statistics[candidates.frame].mean_fn
    carried = recall(candidates.key, forces.contacts.key, forces.fn, fill=np.nan)
    return candidates.doubt * np.where(np.isfinite(carried), np.maximum(carried, 0.0), mean)


def told_candidates(
    results: Results, candidates: CandidatePairs, scale: Scale, said: dict[tuple[int, Body], str]
) -> list[dict[str, Any]]:
    """The candidates with most at stake first; said: verdicts of this frame by the pair's names."""
    bodies, stake = Bodies.of(results.tracks, results.walls), at_stake(results, candidates)
    contacts = candidates.contacts
    place = np.round(scale.to_pixels(contacts.point), 2)
    forces = results.frames[candidates.frame]
    carried = recall(candidates.key, forces.contacts.key, forces.fn, fill=np.nan)
    told = []
    at_risk, probable, borne = plain(stake), plain(candidates.probability), plain(carried)
    for k in np.argsort(-np.nan_to_num(stake), kind="stable")[:MOST].tolist():
        a, b = bodies.name(int(contacts.i[k])), bodies.name(int(contacts.j[k]))
        told.append({
            "i": a, "j": b, "point": place[k].tolist(), "stake": at_risk[k],
            "probability": probable[k], "fn": borne[k],
            "detected": bool(candidates.detected[k]), "verdict": said.get(_ordered(a, b)),
        })  # fmt: skip
    return told


def verdicts_of(log: VerdictLog, frame: int, reviewer: str) -> dict[tuple[int, Body], str]:
    """A reviewer's last word on every pair of a frame, by the pair's names."""
    said = {}
    for (number, a, b), entry in log.verdicts(reviewer):
        if number == frame and entry.verdict is not None:
            said[_ordered(a, b)] = entry.verdict.value
    return said


def pair_history(results: Results, i: Body, j: Body) -> dict[str, Any] | None:
    """Gap, force and probability of a pair in every frame, with their standard deviations; None: no such pair."""
    bodies = Bodies.of(results.tracks, results.walls)
    rows = bodies.rows()
    if i not in rows or j not in rows or i == j:
        return None
    a, b = sorted((rows[i], rows[j]))
    n = results.grains.count
    if a >= n:
        return None
    key = np.array([bodies.key(a, b)], np.int64)
    told: dict[str, list[Any]] = {
        name: [] for name in ("gap", "gap_sd", "fn", "fn_sd", "ft", "ft_sd", "probability", "state", "point")
    }
    for frame in range(len(results.frames)):
        tracks, forces = results.tracks, results.frames[frame]
        here = all(row >= n or bool(tracks.present[frame, row]) for row in (a, b))
        measured = measure_pairs(results.grains, tracks.position[frame], walls_at(results, frame), key)
        deviation = float(tracks.position_sigma[frame])
        told["gap"] += plain(measured.gap if here else [np.nan])
        told["gap_sd"] += plain(gap_sigma(measured, deviation))
        for name in ("fn", "fn_sd", "ft", "ft_sd", "probability"):
            told[name] += plain(recall(key, forces.contacts.key, getattr(forces, name), fill=np.nan))
        told["state"].append(bool((forces.contacts.key == key[0]).any()))
        told["point"].append(measured.point[0].tolist() if here else None)
    return told


def _ordered(a: Body, b: Body) -> tuple[int, Body]:
    """The names of a pair as verdicts have them: a grain first, the lesser of two."""
    if isinstance(a, str):
        a, b = b, a
    assert isinstance(a, int)
    return (a, b) if isinstance(b, str) or a < b else (b, a)


def without_pair(results: Results, frame: int, i: Body, j: Body) -> dict[str, Any] | None:
    """The nearest forces of a frame in which a contact is not there; None where it is not among the contacts."""
    bodies = Bodies.of(results.tracks, results.walls)
    rows, forces = bodies.rows(), results.frames[frame]
    if i not in rows or j not in rows or i == j:
        return None
    place = np.flatnonzero(forces.contacts.key == bodies.key(*sorted((rows[i], rows[j]))))
    if len(place) != 1:
        return None
    friction = results.friction
    removal = remove_contact(
        results.grains, forces.contacts, forces.fn, forces.ft, int(place[0]), friction=friction, wall_friction=friction
    )
    change = removal.fn - forces.fn
    most = np.argsort(-np.abs(np.where(removal.free, change, 0.0)))[:6]
    mean = results.statistics[frame].mean_fn
    return {
        "fn": plain(removal.fn), "ft": plain(removal.ft), "change": plain(change), "unbalance": removal.unbalance,
        "stands": removal.unbalance < STANDS, "share": float(np.abs(change[removal.free]).sum() / max(mean, 1e-300)),
        "most": [
            {"i": bodies.name(int(forces.contacts.i[k])), "j": bodies.name(int(forces.contacts.j[k])),
             "change": plain(change[k : k + 1])[0]} for k in most.tolist() if change[k] != 0.0
        ],
    }  # fmt: skip
