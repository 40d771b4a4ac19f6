"""Packings of any size on tracks, in seconds: a simulated periodic cell laid beside itself, its noise drawn anew."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from rodsight.synthetic.worlds.making import make_world

CELL = 450  # rods
FRAMES = 6
NOISE = 1e-5  # [m] of positions; of rotations over the radius


def tiled_packing(folder: Path, tiles: int) -> Path:
    """The folder of an experiment of CELL · tiles² rods; made where it is not there yet."""
    place = folder / f"{CELL * tiles**2}-rods"
    if (place / "experiment.toml").exists():
        return place
    source = folder / "cell"
    if not source.exists():
        make_world(source, "periodic", 0, grains=CELL)
    place.mkdir(parents=True)
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
    laid = pd.concat(copies).sort_values(["frame", "id"])
    radius = np.tile(grains["radius"].to_numpy(), tiles**2)
    noise = np.random.default_rng(tiles).normal(0.0, NOISE, (len(laid), 3))
    noise[:, 2] /= np.tile(radius, FRAMES)
    laid[["x", "y", "theta"]] += noise
    laid.to_csv(place / "tracks.csv", index=False)
    pd.DataFrame({"id": np.arange(len(radius)), "radius": radius}).to_csv(place / "grains.csv", index=False)
    cell[["ax", "ay", "bx", "by"]] *= tiles
    cell.to_csv(place / "cell.csv", index=False)
    times = pd.read_csv(source / "times.csv")
    times[times["frame"] < FRAMES].to_csv(place / "times.csv", index=False)
    told = (source / "experiment.toml").read_text(encoding="utf-8")
    kept = [line for line in told.splitlines() if not line.startswith("truth")]
    (place / "experiment.toml").write_text("\n".join(kept) + "\n", encoding="utf-8")
    return place
