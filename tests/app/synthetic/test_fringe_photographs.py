"""Fringes of photoelastic discs: stresses, photographs, and what is measured of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.synthetic.photoelastic.fringe_photographs import make_fringed
from rodsight.synthetic.photoelastic.stress_optics import fringe_light, stress_difference
from rodsight.tracking.fringes import squared_gradients

from tests.program import rodsight

pytestmark = pytest.mark.unit

OPPOSITE = np.array([[1.0, 0.0], [-1.0, 0.0]])


def test_two_opposite_forces_stress_the_centre_by_the_known_formula():
    force, radius = 30.0, 0.01
    found = stress_difference(np.zeros(1), np.zeros(1), radius, OPPOSITE, -force * OPPOSITE)
    assert found[0] == pytest.approx(8.0 * force / (np.pi * 2.0 * radius))


def test_a_uniform_pressure_shows_no_fringes_at_the_centre():
    angle = np.arange(12) * np.pi / 6.0
    direction = np.column_stack([np.cos(angle), np.sin(angle)])
    found = stress_difference(np.zeros(1), np.zeros(1), 0.01, direction, -20.0 * direction)
    assert abs(found[0]) < 1e-6 * 20.0 / 0.01


def disc_picture(force: float, radius: float, light: float = 200.0) -> np.ndarray:
    """A disc under two opposite forces in the middle of a picture."""
    y, x = np.mgrid[-60:61, -60:61].astype(float)
    inside = x**2 + y**2 < radius**2
    image = np.zeros(x.shape)
    stress = stress_difference(x[inside], -y[inside], radius, OPPOSITE, -force * OPPOSITE)
    image[inside] = light * fringe_light(stress, per_order=1.0)
    return cv2.GaussianBlur(image.astype(np.float32), (0, 0), 0.7)


def gradient(force: float, radius: float, light: float = 200.0) -> float:
    return float(squared_gradients(disc_picture(force, radius, light), np.array([[60.0, 60.0]]), np.array([radius]))[0])


def test_squared_gradient_grows_with_the_force_whatever_light_and_size():
    forces = [4.0, 8.0, 16.0, 24.0]
    found = [gradient(force, 30.0) for force in forces]
    assert np.all(np.diff(found) > 0.0)
    assert gradient(16.0, 30.0, light=90.0) == pytest.approx(found[2], rel=0.05)
    assert gradient(16.0, 40.0) == pytest.approx(found[2], rel=0.35)


def test_discs_that_the_edge_cuts_or_that_are_lost_have_no_gradient():
    image = disc_picture(16.0, 30.0)
    found = squared_gradients(image, np.array([[60.0, 60.0], [10.0, 60.0], [np.nan, np.nan]]), np.full(3, 30.0))
    assert np.isfinite(found).tolist() == [True, False, False]


@pytest.mark.slow
def test_photographs_have_their_truth(tmp_path):
    made = make_fringed(tmp_path / "test", 1, grains=60, frames=2)
    image = cv2.imread(str(made.folder / "photos" / "0001.png"))
    assert image.ndim == 3
    assert image[..., 2].mean() > image[..., 1].mean()  # plain discs in red, few fringes in green
    again = make_fringed(tmp_path / "again", 1, grains=60, frames=2)
    for file in ("photos/0001.png", "truth_contacts.csv"):
        assert (made.folder / file).read_bytes() == (again.folder / file).read_bytes()


@pytest.mark.slow
def test_fringes_improve_the_forces_of_discs_whose_overlaps_noise_hides(tmp_path, capsys):
    assert rodsight("study", "fringes", "--seeds", "1", "--grains", "100", "--out", tmp_path, "--quiet") == 0
    printed = capsys.readouterr().out
    rows = {line.split("  ")[0]: [float(cell) for cell in line.split()[2:]] for line in printed.splitlines()[2:]}
    assert {"fringes, 1", "stiff_fringes, 1", "fringes, mean", "stiff_fringes, mean"} == set(rows)
    _, without, fringed, gain, pressures, margin = rows["stiff_fringes, 1"]
    assert gain == pytest.approx(fringed - without, abs=2e-3)
    assert gain > 0.05
    assert pressures > 0.9
    assert margin > -0.03  # the trust is a lower bound
    assert rows["fringes, 1"][1] > without  # their overlaps show more
