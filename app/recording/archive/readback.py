"""Reads the reported forces back from a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ..look import entities
from ..parts import read_chunks


@dataclass(frozen=True, slots=True)
class RecordedForces:
    """The reported forces of one frame, contacts in the order of the recording (ascending in i, then j)."""

    i: NDArray[np.int32]  # (c,) row of a grain
    j: NDArray[np.int32]  # (c,) row of a grain, or number of grains + row of a wall
    grain_a: NDArray[np.int64]  # (c,) id of grain i
    body_b: tuple[str, ...]  # (c,) id of grain j, or name of the wall
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]


def read_forces(path: Path | str, *, truth: bool = False) -> dict[int, RecordedForces]:
    """Read the reported forces of every frame at full precision.

    Parameters
    ----------
    path : Path or str
        The recording.
    truth : bool
        Read the true forces instead.

    Returns
    -------
    dict of int to RecordedForces
        The forces by frame.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it holds no contact forces.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no recording {path}")
    entity = entities.TRUTH_FORCES if truth else entities.FORCES
    found: dict[int, RecordedForces] = {}
    for chunk in read_chunks(Path(path), content=entity):
        batch = chunk.to_record_batch()
        if not {entities.FRAME, "fn"} <= set(batch.schema.names):
            continue  # rows of widths and colours only
        column = {name: batch.column(name) for name in ("i", "j", "grain_a", "body_b", "fn", "ft")}
        for row, frame in enumerate(batch.column(entities.FRAME).to_pylist()):
            cells = {name: values[row] for name, values in column.items()}
            if not cells["fn"].is_valid:
                continue
            numbers = {name: cells[name].values.to_numpy(zero_copy_only=False) for name in cells if name != "body_b"}
            found[int(frame)] = RecordedForces(
                numbers["i"].astype(np.int32),
                numbers["j"].astype(np.int32),
                numbers["grain_a"].astype(np.int64),
                tuple(cells["body_b"].as_py()),
                numbers["fn"].astype(np.float64),
                numbers["ft"].astype(np.float64),
            )
    if not found:
        raise ValueError(f"{path} holds no contact forces at {entity}")
    return dict(sorted(found.items()))
