"""Self-calibration as a stage: known quantities, corrections and their report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.cli.summary_table import calibration_lines
from rodsight.experiment.config.experiment_file import ExperimentFile
from rodsight.experiment.scaling import make_scale
from rodsight.inference.correction.calibration import calibrate_tracks, own_gap_error, radius_classes
from rodsight.inference.inference_settings import radii_are_metres, settings_of
from rodsight.inference.snapshots import MOST_SPREAD, measure_sequence
from rodsight.results.calibration_summary import calibration_facts
from rodsight.solver.calibration.calibrate import Calibration, calibrate
from rodsight.solver.calibration.gaps import MeasuredSequence
from rodsight.solver.calibration.priors import CalibrationPriors
from rodsight.solver.part_settings import CalibrationSettings
from rodsight.tracks import Tracks, TrackStatus, WallTracks

RADIUS = 8e-3  # [m]


def config(**sections) -> ExperimentFile:
    tracks = {"positions": "", "grains": "", "times": ""}
    return ExperimentFile.model_validate({"name": "test", "tracks": tracks, **sections})


def photographed(**keys) -> ExperimentFile:
    photographs = {"files": "*.png", "pixel_size": 1e-4, "interval": 1.0, **keys}
    return ExperimentFile.model_validate({"name": "test", "photographs": photographs})


def square_lattice(*, scale: float = 0.0, noise: float = 3e-6, side: int = 7, frames: int = 4) -> tuple:
    """Discs of one radius that touch their four neighbours and the walls; positions divided by 1 + scale."""
    rng = np.random.default_rng(4)
    place = 2 * RADIUS * (1.0 + np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2))
    n = side**2
    position = (place + rng.normal(0.0, noise, (frames, n, 2))) / (1.0 + scale)
    low, high = RADIUS, RADIUS * (2 * side + 1)
    ends = np.array([[[low, low], [high, low]], [[high, low], [high, high]], [[high, high], [low, high]]])
    tracks = Tracks(
        np.arange(n), np.full(n, RADIUS), np.arange(float(frames)), position,
        np.cumsum(rng.normal(0.0, 0.3, (frames, n)), axis=0), np.full((frames, n), noise),
        np.full((frames, n), np.nan), np.full((frames, n), TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    walls = WallTracks(("bottom", "right", "top"), np.broadcast_to(ends, (frames, 3, 2, 2)).copy(), np.full(3, np.nan))
    return tracks, walls


def test_radii_determine_the_pixel_size_unless_they_were_measured_in_the_photographs():
    assert radii_are_metres(config())
    assert radii_are_metres(photographed(radii=[7e-3, 8e-3]))
    assert not radii_are_metres(photographed())
    assert not radii_are_metres(photographed(radii=[7e-3], grains="grains.csv"))


def test_all_radii_may_share_a_factor_unless_they_determine_the_pixel_size():
    assert settings_of(config()).calibration.radius_factor == 0.02
    assert settings_of(photographed(radii=[7e-3])).calibration.radius_factor == 0.0


def test_the_summary_states_a_factor_of_all_radii_with_its_interval():
    tracks, walls = square_lattice()
    measured = replace(tracks, radius=0.98 * tracks.radius)
    _, _, found = calibrate_tracks(CalibrationSettings(radius_factor=0.02), measured, walls, 0.0)
    lines = " ".join(calibration_lines(calibration_facts(found, walls.name)))
    assert "Radii: all +2.0" in lines
    assert "pixel size wrong by -2.0" in lines


def test_classes_are_the_different_radii():
    radius = np.array([8e-3, 7e-3, 8e-3 * (1 + 1e-9), 11e-3])
    np.testing.assert_array_equal(radius_classes(radius), [1, 0, 1, 2])
    assert radius_classes(np.linspace(7e-3, 8e-3, 50)) is None


@pytest.mark.parametrize("error", [-5e-3, 5e-3])
def test_wrong_scale_of_tracks_is_corrected_and_walls_in_metres_stay(error):
    tracks, walls = square_lattice(scale=error)
    better, moved, found = calibrate_tracks(CalibrationSettings(), tracks, walls, 0.0)
    assert found is not None
    assert found.applied
    assert abs(found.pixel_size - error) < 1e-3  # the error that known radii may share
    exact, _ = square_lattice()
    tolerance = 3e-4 * 2 * RADIUS * 8  # [m], over the width of the packing
    np.testing.assert_allclose(better.position, exact.position, atol=tolerance)
    np.testing.assert_allclose(moved.endpoints, walls.endpoints, atol=tolerance)


def test_exact_tracks_pass_unchanged():
    tracks, walls = square_lattice()
    better, moved, found = calibrate_tracks(CalibrationSettings(), tracks, walls, 0.0)
    assert found is not None
    assert not found.applied
    np.testing.assert_array_equal(better.position, tracks.position)
    np.testing.assert_array_equal(better.sigma, tracks.sigma)
    np.testing.assert_array_equal(moved.endpoints, walls.endpoints)
    assert found.pixel_size == 0.0
    assert "as given" in " ".join(calibration_lines(calibration_facts(found, walls.name)))


def test_a_pixel_size_specified_as_exact_is_kept():
    tracks, walls = square_lattice(scale=5e-3)
    _, _, found = calibrate_tracks(CalibrationSettings(pixel_size=0.0), tracks, walls, 0.0)
    assert found is not None
    assert found.pixel_size == 0.0
    assert found.pixel_size_sd == 0.0


def test_understated_noise_is_raised_even_where_nothing_is_corrected():
    tracks, walls = square_lattice(noise=30e-6, frames=12)
    understated = replace(tracks, sigma=tracks.sigma / 4)
    better, _, found = calibrate_tracks(CalibrationSettings(), understated, walls, 0.0)
    assert found is not None
    assert 2.0 < float(better.sigma[0, 0] / understated.sigma[0, 0]) < 5.0


def test_too_few_photographs_are_not_calibrated():
    tracks, walls = square_lattice(frames=2)
    better, _, found = calibrate_tracks(CalibrationSettings(), tracks, walls, 0.0)
    assert found is None
    assert better is tracks


@pytest.fixture
def corrected() -> Calibration:
    tracks, walls = square_lattice(scale=5e-3)
    _, _, found = calibrate_tracks(CalibrationSettings(), tracks, walls, 0.0)
    assert found is not None
    return found


def test_corrections_are_reported_with_their_uncertainty(corrected):
    text = "\n".join(calibration_lines(calibration_facts(corrected, ("bottom", "right", "top"))))
    assert "Pixel size: +0.5" in text
    assert "the walls stay" in text
    assert "before → after" in text
    facts = calibration_facts(corrected, ("bottom", "right", "top"))
    assert facts["gap_rms_after"] < 0.2 * facts["gap_rms_before"]
    assert set(facts["wall"]) == {"bottom", "right", "top"}


def test_the_rotation_of_a_wall_is_reported_in_milliradians(corrected):
    rotated = replace(corrected, wall_tilt=np.array([0.0, 1e-3, 0.0]), wall_tilt_sd=np.full(3, 1e-4))
    text = "\n".join(calibration_lines(calibration_facts(rotated, ("bottom", "right", "top"))))
    assert "wall right rotated by +1.00 ± 0.10 mrad" in text or "and rotated by +1.00 ± 0.10 mrad" in text


def test_photographs_are_shown_at_the_corrected_scale(corrected):
    section = photographed().photographs
    assert section is not None
    given, better = make_scale(section, 100), make_scale(section, 100, corrected)
    assert better.pixel_size == pytest.approx(given.pixel_size * (1.0 + corrected.pixel_size), rel=1e-12)


def test_lens_is_found_and_corrected():
    tracks, walls = square_lattice(side=15, noise=2e-6, frames=6)
    least, greatest = tracks.position.min(axis=(0, 1)), tracks.position.max(axis=(0, 1))
    place = (tracks.position - 0.5 * (least + greatest)) / (0.5 * np.linalg.norm(greatest - least))
    bend = 250e-6  # [m] at the farthest corner: one pixel of a photograph
    bent = tracks.position - bend * np.sum(place**2, axis=2, keepdims=True) * place
    measured = MeasuredSequence(
        tracks.radius, bent, tracks.rotation, tracks.present, walls.endpoints, tracks.sigma
    )  # fmt: skip
    priors = CalibrationPriors(50e-6, 10e-6, wall=50e-6, lens=160e-6)
    found = calibrate(measured, priors, rng=np.random.default_rng(1))
    assert found.applied
    assert "lens" in found.verdict
    assert abs(found.lens - bend) < 4 * found.lens_sd
    straight = calibrate(replace(measured, position=tracks.position), priors, rng=np.random.default_rng(1))
    assert straight.lens == 0.0
    assert straight.lens_sd > 0.0


def test_errors_of_single_rods_make_the_corrected_part_of_a_gap() -> None:
    tracks, walls = square_lattice()
    _, _, found = calibrate_tracks(CalibrationSettings(), tracks, walls, 0.0)
    assert found is not None
    n, rng = tracks.grain_count, np.random.default_rng(1)
    alike = replace(found, offset=np.zeros((n, 2)), radius=np.full(n, 3e-5))
    assert own_gap_error(alike) == 0.0  # an error that all radii share is no error of a single rod
    offset, radius = rng.normal(0.0, 4e-5, (n, 2)), rng.normal(0.0, 3e-5, n)
    own = own_gap_error(replace(alike, offset=offset, radius=alike.radius + radius))
    assert own == pytest.approx(2.0**0.5 * 5e-5, rel=0.2)
    sizes = np.where(np.arange(n) % 3 == 1, 1, 0)
    of_one = replace(alike, radius=np.where(sizes == 1, -1.6e-4, 0.0))
    sizes[:2] = 2  # too few rods of one size
    assert own_gap_error(of_one) > 1e-4
    assert own_gap_error(of_one, sizes) == pytest.approx(np.sqrt(2.0 / n) * 1.6e-4)  # of the one that is alone


def test_rods_whose_rims_were_hardly_seen_may_err_by_more() -> None:
    tracks, walls = square_lattice()
    sd = np.full(tracks.grain_count, 4e-6)
    assert measure_sequence(tracks, walls).centre_spread is None
    assert measure_sequence(replace(tracks, centre_sigma=sd), walls).centre_spread is None
    sd[:4] = 8e-6, 2e-6, np.nan, 1.0
    spread = measure_sequence(replace(tracks, centre_sigma=sd), walls).centre_spread
    assert spread is not None
    np.testing.assert_allclose(spread[:5], [2.0, 1.0, 1.0, MOST_SPREAD, 1.0])
