"""Tracks of packings of any size: periodic copies of a simulated cell, each with noise of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from rodsight.synthetic.scenarios.scenario_folder import make_scenario

CELL = 450  # rods
FRAMES = 6
NOISE = 1e-5  # [m] of positions; of rotations over the radius


def tiled_packing(folder: Path, tiles: int) -> Path:
    """Folder of an experiment of CELL · tiles² rods; made if missing."""
    target = folder / f"{CELL * tiles**2}-rods"
    if (target / "experiment.toml").exists():
        return target
    source = folder / "cell"
    if not source.exists():
        make_scenario(source, "periodic", 0, grains=CELL)
    target.mkdir(parents=True)
    grains, tracks, cell = (pd.read_csv(source / f"{name}.csv") for name in ("grains", "truth_tracks", "cell"))
    tracks, cell = tracks[tracks["frame"] < FRAMES], cell[cell["frame"] < FRAMES]
    corner = cell.set_index("frame").loc[tracks["frame"]]
    copies = []
    for number, (along, up) in enumerate(np.ndindex(tiles, tiles)):
        copy = tracks.copy()
        copy["id"] += number * len(grains)
        copy["x"] += along * corner["ax"].to_numpy() + up * corner["bx"].to_numpy()
        copy["y"] += along * corner["ay"].to_numpy() + up * corner["by"].to_numpy()
        copies.append(copy)
    tiled = pd.concat(copies).sort_values(["frame", "id"])
    radius = np.tile(grains["radius"].to_numpy(), tiles**2)
    noise = np.random.default_rng(tiles).normal(0.0, NOISE, (len(tiled), 3))
    noise[:, 2] /= np.tile(radius, FRAMES)
    tiled[["x", "y", "theta"]] += noise
    tiled.to_csv(target / "tracks.csv", index=False)
    pd.DataFrame({"id": np.arange(len(radius)), "radius": radius}).to_csv(target / "grains.csv", index=False)
    cell[["ax", "ay", "bx", "by"]] *= tiles
    cell.to_csv(target / "cell.csv", index=False)
    times = pd.read_csv(source / "times.csv")
    times[times["frame"] < FRAMES].to_csv(target / "times.csv", index=False)
    text = (source / "experiment.toml").read_text(encoding="utf-8")
    kept = [line for line in text.splitlines() if not line.startswith("truth")]
    (target / "experiment.toml").write_text("\n".join(kept) + "\n", encoding="utf-8")
    return target
