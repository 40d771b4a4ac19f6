"""Elliptic sections show in the gaps of a rod at right angles; wrong radii, centres and a stretched picture do not."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from rodsight.inference.diagnosis.sections import DOMINANT, SIGNIFICANT, examine_sections
from rodsight.solver.boundary.section_shape import ROUND, SectionShape, measure_section_shape
from rodsight.solver.dem.dem_truth import DemSettings
from rodsight.synthetic.dense_packing import prepare_packing
from rodsight.tracks import Tracks, TrackStatus

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
NOISE, RODS = 1e-5, 200  # [m], –
OVALITY = 0.02


def photographs(ovality: float) -> tuple[np.ndarray, np.ndarray]:
    """Centres (2, n, 2) [m] of a packing at rest, with noise, and mean radii."""
    cell = prepare_packing(RODS, np.random.default_rng(7), DemSettings(ovality=ovality))
    noise = NOISE * np.random.default_rng(1).standard_normal((2, RODS, 2))
    return cell.position + noise, cell.grains.radius


@pytest.fixture(scope="module")
def round_rods() -> tuple[np.ndarray, np.ndarray]:
    return photographs(0.0)


@pytest.fixture(scope="module")
def elliptic_rods() -> tuple[np.ndarray, np.ndarray]:
    return photographs(OVALITY)


def named(shape: SectionShape) -> bool:
    return shape.significance > SIGNIFICANT and shape.fraction > DOMINANT


def tracks_of(position: np.ndarray, radius: np.ndarray) -> Tracks:
    flat = np.full(position.shape[:2], NOISE)
    status = np.full(flat.shape, TrackStatus.GIVEN, np.uint8)
    return Tracks(
        np.arange(len(radius)), radius, 30.0 * np.arange(len(position)), position, np.zeros_like(flat), flat,
        np.full_like(flat, np.nan), status,
    )  # fmt: skip


def test_elliptic_sections_are_measured_and_named(elliptic_rods) -> None:
    shape = measure_section_shape(*elliptic_rods)
    assert named(shape)
    assert shape.ovality == pytest.approx(OVALITY, rel=0.25)
    (found,) = examine_sections(tracks_of(*elliptic_rods))
    assert found.cause == "sections_not_round"
    assert f"±{100.0 * shape.ovality:.1f} %" in found.evidence
    stretched = measure_section_shape(elliptic_rods[0] * [1.01, 1.0], elliptic_rods[1])
    assert named(stretched)


@pytest.mark.parametrize("error", ["none", "radii", "centres", "stretched", "all radii"])
def test_other_errors_are_not_taken_for_elliptic_sections(round_rods, error: str) -> None:
    position, radius = round_rods
    rng = np.random.default_rng(3)
    if error == "radii":
        radius = radius * (1.0 + 0.01 * rng.standard_normal(RODS))
    elif error == "centres":
        position = position + 1e-4 * rng.standard_normal((RODS, 2))
    elif error == "stretched":
        position = position * [1.01, 1.0]
    elif error == "all radii":
        radius = 1.02 * radius
    assert examine_sections(tracks_of(position, radius)) == []
    assert not named(measure_section_shape(position, radius))


def test_rods_without_neighbours_and_missing_rods_are_no_evidence(elliptic_rods) -> None:
    position, radius = elliptic_rods
    assert measure_section_shape(2.0 * position, radius) == ROUND
    lost = position.copy()
    lost[0, :5] = np.nan
    assert named(measure_section_shape(lost, radius))


def test_a_wrong_scale_beside_large_rods_is_no_ovality() -> None:
    """Rings of small rods that touch each other and a large one between them, in a picture that is 1 % too small."""
    rng, step = np.random.default_rng(4), 2.0 * np.arcsin(0.2)
    position, radius = [], []
    for number in range(40):
        angle = rng.uniform(0.0, 2.0 * np.pi) + step * np.arange(15)
        ring = 0.025 * np.column_stack([np.cos(angle), np.sin(angle)])
        position.append(0.1 * np.array([number % 7, number // 7]) + np.concatenate([np.zeros((1, 2)), ring]))
        radius.append(np.append(0.02, np.full(15, 0.005)))
    place = np.concatenate(position) + NOISE * rng.standard_normal((40 * 16, 2))
    assert measure_section_shape(0.99 * place[None], np.concatenate(radius)).fraction < 0.5 * DOMINANT
