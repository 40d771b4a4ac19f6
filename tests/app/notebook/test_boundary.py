"""Packings without walls in memory, bounded by some of their grains or by a periodic cell."""

import numpy as np
import pandas as pd
import pytest
import rodsight
from rodsight.process.errors import InputError
from rodsight.solver.bodies.cell import Cell

R, SIDE, FRAMES = 0.01, 6, 3
SHEAR = 0.002


@pytest.fixture
def lattice() -> tuple[pd.DataFrame, pd.DataFrame]:
    """Rods on a triangular lattice in a cell that shears, and the cell."""
    row, column = np.divmod(np.arange(SIDE * SIDE), SIDE)
    position = 2.0 * R * np.stack([column + 0.5 * row + 0.3, np.sqrt(0.75) * row + 0.3], axis=1)
    cells = [
        2.0 * R * SIDE * np.array([[1.0, 0.0], [0.5 + SHEAR * k, np.sqrt(0.75)]]) for k in range(FRAMES)
    ]  # fmt: skip
    noise = np.random.default_rng(6)
    poses = [
        (k, i, *at, 0.0, R, 30.0 * k)
        for k, cell in enumerate(cells)
        for i, at in enumerate(
            Cell.at_rest(cell).wrapped(
                position @ np.linalg.inv(cells[0]) @ cell + noise.normal(0, 1e-6, position.shape)
            )
        )
    ]
    tracks = pd.DataFrame(poses, columns=["frame", "id", "x", "y", "theta", "radius", "time"])
    vectors = [(k, *cell.ravel()) for k, cell in enumerate(cells)]
    return tracks, pd.DataFrame(vectors, columns=["frame", "ax", "ay", "bx", "by"])


@pytest.mark.thorough
def test_forces_of_a_periodic_packing_are_in_equilibrium_across_its_edges(lattice):
    tracks, cell = lattice
    run = rodsight.solve(tracks, boundary=cell, settings={"recording.sweeps": "none"})
    contacts = run.contacts(frame=1)
    assert np.any(np.hypot(contacts["shift_x"], contacts["shift_y"]) > 0.0)
    resultant = np.zeros((SIDE * SIDE, 2))
    normal = contacts[["nx", "ny"]].to_numpy()
    force = contacts["fn"].to_numpy()[:, None] * normal
    force += contacts["ft"].to_numpy()[:, None] * np.column_stack([-normal[:, 1], normal[:, 0]])
    np.subtract.at(resultant, contacts["i"].to_numpy(), force)
    np.add.at(resultant, contacts["j"].to_numpy(), force)
    assert np.abs(resultant).max() < 1e-2 * contacts["fn"].mean()


def test_ids_of_boundary_grains_are_validated(lattice):
    tracks, _ = lattice
    with pytest.raises(InputError, match="not the id of a grain"):
        rodsight.solve(tracks, boundary=[1, 99])
    with pytest.raises(InputError, match="no boundary is given"):
        rodsight.solve(tracks)
