"""The camera's distortion from touching pairs: found where it explains the gaps, left alone where it does not."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.boundary import camera_distortion
from rodsight.solver.boundary.camera_distortion import find_camera_distortion

pytestmark = pytest.mark.unit

R, COUNT, FRAMES, NOISE = 5e-3, 24, 4, 2e-5
SIDE = 2.0 * R * COUNT


def lattice(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Discs of two sizes in rows that touch, with some pairs apart, in a few photographs (f, n, 2); and radii."""
    rng = np.random.default_rng(seed)
    small = np.arange(COUNT * COUNT) % 2 == 0
    x, y = np.meshgrid(np.arange(COUNT), np.arange(COUNT))
    place = 2.0 * R * np.column_stack([(x + 0.5 * (y % 2)).ravel(), np.sqrt(0.75) * y.ravel()])
    loose = rng.random(len(place)) < 0.15
    frames = []
    for _ in range(FRAMES):
        moved = np.where(loose[:, None], rng.uniform(-6e-4, 6e-4, place.shape), 0.0)
        frames.append(place + moved + rng.normal(0.0, NOISE, place.shape))
    return np.stack(frames), np.where(small, 0, 1)


def distort(position: np.ndarray, radial: float, stretch: float) -> np.ndarray:
    """Move points as a lens and non-square pixels do."""
    middle = 0.5 * (position.min(axis=(0, 1)) + position.max(axis=(0, 1)))
    offset = (position - middle) / (0.5 * SIDE)
    square = np.sum(offset**2, axis=-1, keepdims=True)
    return position + 0.5 * SIDE * (radial * square * offset + stretch * offset * [1.0, -1.0])


def gap_range(position: np.ndarray) -> float:
    """Greatest less least distance of neighbours in the rows of the first photograph."""
    grid = position[0].reshape(COUNT, COUNT, 2)
    length = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    return float(np.percentile(length, 90) - np.percentile(length, 10))


@pytest.mark.parametrize(("radial", "stretch"), [(0.05, 0.0), (-0.03, 0.0), (0.0, 0.02), (0.03, 0.01)])
def test_a_distortion_is_found_and_removed(radial: float, stretch: float) -> None:
    position, size_class = lattice()
    radius = np.full(position.shape[1], R)
    seen = distort(position, radial, stretch)
    found = find_camera_distortion(seen, radius, size_class)
    assert found is not None
    assert found.applied
    assert found.explained < 0.6 * found.scatter  # loose pairs stay apart
    assert found.unexplained == 0.0
    # Pairs in three directions have the same distance again, up to a common scale.
    before, after, true = gap_range(seen), gap_range(found.correct(seen)), gap_range(position)
    assert after - true < 0.15 * (before - true) + 2e-5
    assert len(found.describe()) == 1
    assert ("radial" in found.describe()[0]) == (radial != 0.0)
    assert ("stretching" in found.describe()[0]) == (stretch != 0.0)


def test_nothing_is_corrected_where_gaps_do_not_depend_on_place() -> None:
    position, size_class = lattice(1)
    for radius in (R, 0.98 * R):  # radii that are all too small are no distortion
        found = find_camera_distortion(position, np.full(position.shape[1], radius), size_class)
        assert found is not None
        assert not found.applied
        assert found.describe() == []
        assert found.correct(position) is position


def test_a_dependence_on_place_that_no_camera_has_is_reported() -> None:
    position, size_class = lattice(2)
    left = position.copy()
    left += 0.02 * np.where(position[..., :1] < 0.5 * SIDE, position - 0.5 * SIDE, 0.0)  # larger in the left half
    found = find_camera_distortion(left, np.full(position.shape[1], R), size_class)
    assert found is not None
    assert found.unexplained > 5e-5
    assert "calibrate the camera" in found.describe()[-1]


def test_readings_of_one_size_that_are_too_large_are_corrected() -> None:
    position, size_class = lattice(3)
    for error, corrected in ((0.0, False), (6e-5, True)):
        radius = np.where(size_class == 1, R + error, R)  # overlaps of 120 µm at a noise of 28 µm
        found = find_camera_distortion(position, radius, size_class)
        assert found is not None
        correction = found.class_correction(NOISE)
        assert (correction is not None) == corrected
        if correction is not None:
            assert correction[1] - correction[0] == pytest.approx(-error, abs=1e-5)


def test_few_discs_show_nothing() -> None:
    position, size_class = lattice()
    few = position[:, :9]
    assert find_camera_distortion(few, np.full(9, R), size_class[:9]) is None
    assert find_camera_distortion(np.full((2, 3, 2), np.nan), np.full(3, R), np.zeros(3, int)) is None


def test_a_lens_of_high_order_and_its_own_middle_is_found_without_changing_the_scale() -> None:
    position, size_class = lattice(4)
    offset = (position - 0.5 * SIDE) / (0.5 * SIDE) - [0.1, -0.05]  # the lens' axis is not the picture's middle
    square = np.sum(offset**2, axis=-1, keepdims=True)
    seen = position + 0.5 * SIDE * (0.02 * square - 0.0015 * square**3) * offset
    found = find_camera_distortion(seen, np.full(position.shape[1], R), size_class)
    assert found is not None
    assert found.applied
    assert found.value[8:].any()  # the lens' middle
    corrected = found.correct(seen)
    before, after, true = gap_range(seen), gap_range(corrected), gap_range(position)
    assert after - true < 0.15 * (before - true)
    rows = corrected[0].reshape(COUNT, COUNT, 2)
    length = np.linalg.norm(np.diff(rows, axis=1), axis=-1).mean()
    given = np.linalg.norm(np.diff(seen[0].reshape(COUNT, COUNT, 2), axis=1), axis=-1).mean()
    assert length == pytest.approx(given, rel=5e-3)


def test_radii_that_leave_touching_surfaces_apart_are_corrected_to_the_usual_overlap() -> None:
    position, size_class = lattice(5)
    radius = np.full(position.shape[1], 0.99 * R)  # gaps of 100 µm
    found = find_camera_distortion(position, radius, size_class)
    assert found is not None
    correction = found.class_correction(NOISE)
    assert correction is not None
    overlap = found.touching_scatter - 1.6 * NOISE
    assert correction == pytest.approx(0.01 * R + 0.5 * max(overlap, 0.0), abs=4e-6)
    exact = find_camera_distortion(position, np.full(position.shape[1], R + NOISE), size_class)
    assert exact is not None
    assert exact.class_correction(NOISE) is None  # overlaps as forces make them


def test_a_tilt_of_the_camera_matters_where_overlaps_are_forces() -> None:
    position, size_class = lattice(6)
    offset = (position - 0.5 * SIDE) / (0.5 * SIDE)
    seen = position + 0.5 * SIDE * 0.001 * offset[..., :1] * offset
    radius = np.full(position.shape[1], R)
    hard, soft = (find_camera_distortion(seen, radius, size_class, soft=soft) for soft in (False, True))
    assert hard is not None
    assert not hard.applied
    assert soft is not None
    assert soft.value[6:8] == pytest.approx([-0.001, 0.0], abs=3e-4)


def test_a_lens_whose_axis_is_beside_the_middle_is_no_perspective() -> None:
    position, size_class = lattice(7)
    offset = (position - 0.5 * SIDE) / (0.5 * SIDE) - [0.25, -0.15]
    seen = position + 0.5 * SIDE * 0.01 * np.sum(offset**2, axis=-1, keepdims=True) * offset
    found = find_camera_distortion(seen, np.full(position.shape[1], R), size_class)
    assert found is not None
    assert found.applied
    assert found.value[8:].all()
    assert not found.value[[0, 1, 6, 7]].any()  # unknowns that the picture does not have would only add their errors


def test_in_a_crystal_a_stretching_must_explain_more(monkeypatch) -> None:
    """Contacts that open across a compression change the gaps in one of three directions, as a stretching does."""
    position, size_class = lattice()
    seen, radius = distort(position, 0.0, 2e-3), np.full(position.shape[1], R)
    found = find_camera_distortion(seen, radius, size_class)
    assert found is not None
    assert not found.applied
    monkeypatch.setattr(camera_distortion, "CRYSTAL", 1.0)  # as without the order of its directions
    found = find_camera_distortion(seen, radius, size_class)
    assert found is not None
    assert found.applied
    assert found.explained > 0.8 * found.scatter
