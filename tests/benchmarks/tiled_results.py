"""Results of any size for the page: copies of a finished run side by side, photographs of twenty megapixels."""

from __future__ import annotations

import shutil
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from rodsight.experiment.experiment import load_experiment
from rodsight.results.hdf5.store import load_results, read_origin, save_results
from rodsight.results.results import Results
from rodsight.run_folder import RESULTS
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.frame_forces import FrameForces
from rodsight.workbench.setup.draft import Draft

ALONG, UP = 7, 3
MEGAPIXELS = 20.0
PHOTOGRAPHS = 6


def tile_run(source: Path, run: Path, target: Path) -> Path:
    """Write ALONG × UP copies of an experiment and its run into target/large and target/runs/large."""
    folder = target / "large"
    if (target / "runs" / "large" / RESULTS).exists():
        return target
    shutil.copytree(source, folder, ignore=shutil.ignore_patterns("photos", ".rodsight", "truth_*"))
    experiment = load_experiment(source)
    section = experiment.config.photographs
    assert section is not None
    files = experiment.photographs().files[:PHOTOGRAPHS]
    (folder / "photos").mkdir()
    shape, shrink = (0, 0), 1.0
    for file in files:
        picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        shape = picture.shape
        shrink = (1e6 * MEGAPIXELS / (shape[0] * UP * shape[1] * ALONG)) ** 0.5
        tiled = cv2.resize(np.tile(picture, (UP, ALONG)), None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        assert cv2.imwrite(str(folder / "photos" / file.name), tiled)
    table = pd.read_csv(folder / "walls.csv")
    table[table["frame"] < PHOTOGRAPHS].to_csv(folder / "walls.csv", index=False)
    size = section.pixel_size
    Draft(folder).set_keys("tiled", {
        "name": "large", "truth": None, "truth_tracks": None, "walls.forces": None,
        "photographs.pixel_size": size / shrink,
    })  # fmt: skip
    steps = [np.array([a * shape[1], b * shape[0]]) * size for a in range(ALONG) for b in range(UP)]
    results = load_results(run / RESULTS)
    (target / "runs" / "large").mkdir(parents=True)
    origin = read_origin(run / RESULTS)
    assert origin is not None
    save_results(target / "runs" / "large" / RESULTS, tile_results(results, steps), origin)
    return target


def tile_results(results: Results, steps: list[np.ndarray]) -> Results:
    """Copy the grains and contacts of the first frames; the walls stay those of the first copy."""
    times, count = len(steps), results.grains.count
    tracks = results.tracks
    kept = slice(0, PHOTOGRAPHS)
    per_grain = {
        each.name: _copies(getattr(tracks, each.name), times, tracks.frame_count, count) for each in fields(tracks)
    }
    per_grain["id"] = np.arange(times * count)
    per_grain["position"] = np.concatenate([tracks.position + step for step in steps], axis=1)
    in_frames = {name: each[kept] for name, each in per_grain.items() if _per_frame(each, tracks.frame_count)}
    walls, grains = results.walls, results.grains
    return replace(
        results, name="large", tracks=replace(tracks, **per_grain | in_frames),
        walls=replace(walls, **{
            each.name: getattr(walls, each.name)[kept] for each in fields(walls)
            if _per_frame(getattr(walls, each.name), tracks.frame_count)
        }),
        grains=replace(grains, radius=np.tile(grains.radius, times), mass=np.tile(grains.mass, times)),
        frames=[_tile_frame(frame, steps, count) for frame in results.frames[kept]],
        statistics=list(results.statistics)[kept], calibration=None, friction_check=None, radius_tuning=None,
        boundary=None, read_kinematics=lambda: None,
    )  # fmt: skip


def _per_frame(values: Any, count: int) -> bool:
    return np.ndim(values) > 0 and len(values) == count


def _copies(values: Any, times: int, frames: int, count: int) -> Any:
    shape = np.shape(values)
    if len(shape) > 1 and shape[:2] == (frames, count):
        return np.concatenate([values] * times, axis=1)
    return np.concatenate([values] * times) if shape[:1] == (count,) else values


def _tile_frame(forces: FrameForces, steps: list[np.ndarray], count: int) -> FrameForces:
    contacts, times = forces.contacts, len(steps)
    i = np.concatenate([contacts.i + k * count for k in range(times)]).astype(np.int32)
    j = np.concatenate([
        np.where(contacts.with_wall, contacts.j + (times - 1) * count, contacts.j + k * count) for k in range(times)
    ]).astype(np.int32)  # fmt: skip
    order = np.lexsort((j, i))
    tiled = Contacts(
        i[order], j[order], np.tile(contacts.gap, times)[order], np.tile(contacts.normal, (times, 1))[order],
        np.concatenate([contacts.point + step for step in steps])[order], times * count, contacts.wall_count,
    )  # fmt: skip
    none = np.empty((0, tiled.count), np.float32)
    history = replace(forces.history, recorded=forces.history.recorded[:0], fn=none, ft=none)
    values: dict[str, Any] = {"contacts": tiled, "history": history}
    for each in fields(forces):
        value = getattr(forces, each.name)
        if isinstance(value, np.ndarray) and each.name != "contacts":
            if value.shape[:1] == (contacts.count,):
                values[each.name] = np.concatenate([value] * times)[order]
            elif value.shape[:1] == (count,):
                values[each.name] = np.concatenate([value] * times)
    return replace(forces, **values)
