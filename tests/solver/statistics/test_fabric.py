import numpy as np
import pytest
from rodsight.solver.statistics.fabric import (
    anisotropies,
    contact_fabric,
    contact_harmonic,
    fabric_anisotropy,
    tangential_harmonic,
    value_harmonic,
)
from rodsight.solver.statistics.stress import principal_stresses

EXACT = 1e-9  # rounding in sums over some thousand contacts
THREE = 3e-3  # products of three anisotropies, which the formula for the friction angle neglects


def normals(angle):
    return np.column_stack([np.cos(angle), np.sin(angle)])


def directions(amplitude, direction, count=4000):
    """Quantiles of the density (1 + a cos 2(θ − θ₀)) / 2π, by inverting its distribution function."""
    fine = np.linspace(0.0, 2.0 * np.pi, 200_001)
    cumulative = (fine + 0.5 * amplitude * np.sin(2.0 * fine)) / (2.0 * np.pi)
    return np.interp((np.arange(count) + 0.5) / count, cumulative, fine) + direction


def same_axis(a, b):
    return np.abs(np.exp(2j * a) - np.exp(2j * b)) < 1e-6


@pytest.mark.parametrize(("amplitude", "direction"), [(0.1, 0.3), (0.4, -1.2), (0.9, 1.5)])
def test_contact_anisotropy_of_a_known_distribution_is_found(amplitude, direction):
    found = contact_harmonic(normals(directions(amplitude, direction)))
    assert found.amplitude == pytest.approx(amplitude, abs=1e-5)
    assert same_axis(found.direction, direction)
    tensor = contact_fabric(normals(directions(amplitude, direction)))
    assert fabric_anisotropy(tensor) == pytest.approx(found.amplitude, rel=EXACT)


def test_force_anisotropy_does_not_depend_on_the_distribution_of_contacts():
    # A contact anisotropy along another axis, and no contact at all in a quarter of the directions.
    angle = directions(0.5, -0.9)
    angle = angle[np.abs(np.sin(angle - 0.4)) > np.sin(np.pi / 8)]
    found = value_harmonic(normals(angle), 7.0 * (1.0 + 0.35 * np.cos(2.0 * (angle - 0.2))))
    assert found.mean == pytest.approx(7.0, rel=EXACT)
    assert found.amplitude == pytest.approx(0.35, rel=EXACT)
    assert same_axis(found.direction, 0.2)


def test_weights_count_like_repetitions():
    rng = np.random.default_rng(5)
    angle, times = rng.uniform(0.0, np.pi, 300), rng.integers(1, 4, 300)
    branch, fn, ft = normals(angle) * rng.uniform(1.0, 2.0, (300, 1)), rng.exponential(size=300), rng.normal(size=300)
    weighted = anisotropies(normals(angle), branch, fn, ft, times.astype(float))
    repeated = anisotropies(*(np.repeat(each, times, axis=0) for each in (normals(angle), branch, fn, ft)))
    for kind in ("contact", "branch", "normal", "tangential"):
        one, other = getattr(weighted, kind), getattr(repeated, kind)
        assert (one.mean, one.amplitude) == (pytest.approx(other.mean), pytest.approx(other.amplitude)), kind
    tensor = contact_fabric(normals(angle), times.astype(float))
    assert tensor == pytest.approx(contact_fabric(np.repeat(normals(angle), times, axis=0)))


def test_tangential_anisotropy_is_found_with_its_sign():
    angle = directions(0.3, 0.8)
    found = tangential_harmonic(normals(angle), -5.0 * 0.12 * np.sin(2.0 * (angle - 0.7)), 5.0)
    assert found.amplitude == pytest.approx(0.12, rel=EXACT)
    assert same_axis(found.direction, 0.7)
    against = tangential_harmonic(normals(angle), 5.0 * 0.12 * np.sin(2.0 * (angle - 0.7)), 5.0)
    assert against.along(0.7) == pytest.approx(-0.12, rel=EXACT)


def test_reversed_normal_is_the_same_contact():
    angle, flip = directions(0.3, 0.8, 500), np.tile([1.0, -1.0], 250)
    fn, ft = 2.0 + np.cos(2.0 * angle), 0.2 * np.sin(2.0 * angle + 1.0)
    one = anisotropies(normals(angle), normals(angle), fn, ft)
    other = anisotropies(flip[:, None] * normals(angle), flip[:, None] * normals(angle), fn, ft)
    for kind in ("contact", "branch", "normal", "tangential"):
        assert getattr(other, kind).amplitude == pytest.approx(getattr(one, kind).amplitude, abs=EXACT)


@pytest.mark.parametrize("turn", [0.0, 0.35])
def test_anisotropies_add_up_to_the_friction_angle_of_their_stress(turn):
    # `turn` sets the axes of the anisotropies apart from one another.
    angle = directions(0.25, 1.0 + turn)
    branch = 0.016 * (1.0 + 0.02 * np.cos(2.0 * (angle - 1.0 + turn)))[:, None] * normals(angle)
    fn = 50.0 * (1.0 + 0.35 * np.cos(2.0 * (angle - 1.0)))
    ft = -50.0 * 0.06 * np.sin(2.0 * (angle - 1.0 - turn))
    force = fn[:, None] * normals(angle) + ft[:, None] * normals(angle + np.pi / 2)
    major, minor, direction = principal_stresses(np.einsum("ca,cb->ab", force, branch))
    found = anisotropies(normals(angle), branch, fn, ft)
    sine = (major - minor) / (major + minor)
    assert found.sine_of_friction_angle(direction) == pytest.approx(sine, abs=THREE)
    # Not by the contacts or by the forces alone.
    assert abs(0.5 * found.contact.along(direction) - sine) > 10 * THREE
    assert abs(0.5 * found.normal.along(direction) - sine) > 10 * THREE


def test_few_contacts_give_finite_values():
    none = anisotropies(np.empty((0, 2)), np.empty((0, 2)), np.empty(0), np.empty(0))
    assert none.sine_of_friction_angle(0.3) == 0.0
    # Contacts along one axis, up to rounding, do not determine the dependence on direction.
    column = value_harmonic(normals(np.full(6, 0.5) + 1e-12 * np.arange(6)), np.array([1.0, 2, 3, 4, 5, 6]))
    assert (column.mean, column.amplitude) == (pytest.approx(3.5), pytest.approx(0.0, abs=EXACT))
    # Along two axes, as on a square lattice, they can: f₀ (1 ± a).
    square = value_harmonic(normals(np.array([0.0, np.pi / 2, 0.0, np.pi / 2])), np.array([3.0, 1.0, 3.0, 1.0]))
    assert (square.mean, square.amplitude) == (pytest.approx(2.0), pytest.approx(0.5))
