import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.posterior.error_variances import ErrorVariances, estimate_error_variances

from tests.packings import box


def lattice(side: int = 30, angle: float = 0.0) -> Contacts:
    """Contacts of a triangular lattice, turned by an angle [rad]."""
    rows = np.arange(side)
    position = np.array([(1.0 * column + 0.5 * (row % 2), np.sqrt(0.75) * row) for row in rows for column in rows])
    cos, sin = np.cos(angle), np.sin(angle)
    position = position @ np.array([[cos, sin], [-sin, cos]]) + [side * sin, 0.0]
    grains = Grains(np.full(len(position), 0.5), np.ones(len(position)))
    return detect_contacts(grains, position, np.ones(len(position), bool), box(99.0, 99.0), 0.01, wall_threshold=-9.0)


def make_gaps(contacts: Contacts, radius: np.ndarray, centre_sd: float, rng: np.random.Generator) -> np.ndarray:
    """Make the gaps that are measured with errors of radii and random errors of centres."""
    i, j = contacts.i, contacts.j
    centre = rng.normal(0.0, centre_sd, (contacts.grain_count, 2))
    return radius[i] + radius[j] + np.einsum("ck,ck->c", contacts.normal, centre[j] - centre[i])


@pytest.mark.parametrize("lasting", [False, True])
@pytest.mark.parametrize(("radius_sd", "centre_sd"), [(1.0, 0.5), (0.3, 1.0), (0.0, 1.0)])
def test_variances_of_radii_and_centres_are_separated(radius_sd: float, centre_sd: float, lasting: bool) -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    radius = rng.normal(0.0, radius_sd, contacts.grain_count)
    frames = [(contacts, make_gaps(contacts, radius, centre_sd, rng), np.ones(contacts.count)) for _ in range(8)]
    found = estimate_error_variances(frames, lasting=lasting)
    assert np.sqrt(found.radius) == pytest.approx(radius_sd, abs=0.12)
    assert np.sqrt(found.centre) == pytest.approx(centre_sd, abs=0.08)


def test_errors_of_centres_are_found_from_gaps_in_two_oblique_directions() -> None:
    contacts, rng = lattice(angle=np.deg2rad(15.0)), np.random.default_rng(4)
    contacts = contacts.select(np.flatnonzero(contacts.normal.prod(axis=1) > 0.0))  # at 15 and 75, not at 135 degrees
    gap = make_gaps(contacts, np.zeros(contacts.grain_count), 1.0, rng)
    found = estimate_error_variances([(contacts, gap, np.ones(contacts.count))])
    assert np.sqrt(found.centre) == pytest.approx(1.0, abs=0.08)


def test_overlap_common_to_the_gaps_of_a_grain_is_no_radius_error() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    pressure = 1.0 + 0.4 * rng.normal(size=contacts.grain_count)
    gap = -0.5 * (pressure[contacts.i] + pressure[contacts.j])
    found = estimate_error_variances([(contacts, gap - gap.mean(), np.ones(contacts.count))])
    assert found.radius > 0.0
    assert found.radius_sd(overlap=1.0) == 0.0
    assert found.radius_sd(overlap=0.0) == pytest.approx(0.2, abs=0.03)


def test_pressure_that_passes_is_no_radius_error() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    radius = rng.normal(0.0, 0.3, contacts.grain_count)
    frames = []
    for _ in range(4):
        pressure = rng.normal(0.0, 0.7, contacts.grain_count)
        gap = make_gaps(contacts, radius + pressure, 0.5, rng)
        frames.append((contacts, gap, np.ones(contacts.count)))
    assert np.sqrt(estimate_error_variances(frames[:1], lasting=True).radius) == pytest.approx(
        np.hypot(0.3, 0.7), abs=0.12
    )
    assert np.sqrt(estimate_error_variances(frames, lasting=True).radius) == pytest.approx(0.3, abs=0.1)


def test_grains_of_a_wrong_size_are_not_taken_for_the_scatter_of_radii() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    radius = rng.normal(0.0, 0.3, contacts.grain_count)
    radius[::20] += 10.0
    frames = [(contacts, make_gaps(contacts, radius, 0.5, rng), np.ones(contacts.count)) for _ in range(8)]
    assert np.sqrt(estimate_error_variances(frames, lasting=True).radius) == pytest.approx(0.3, abs=0.1)


def test_error_that_a_single_pair_keeps_is_none_of_its_grains() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    own = rng.normal(0.0, 1.0, contacts.count)
    frames = [
        (contacts, own + make_gaps(contacts, np.zeros(contacts.grain_count), 0.3, rng), np.ones(contacts.count))
        for _ in range(8)
    ]
    assert np.sqrt(estimate_error_variances(frames, lasting=True).radius) < 0.15


def test_without_gaps_that_meet_variances_are_zero() -> None:
    contacts = lattice().select(np.array([0]))
    found = estimate_error_variances([(contacts, np.ones(1), np.ones(1))])
    assert found.radius_sd(0.0) == 0.0


def test_overlap_adds_a_quarter_of_its_square_to_the_variance_of_radii() -> None:
    found = ErrorVariances(radius=4.0, centre=0.0)
    assert found.radius_sd(overlap=3.0) == pytest.approx(np.sqrt(4.0 - 2.25))
    lasting = ErrorVariances(radius=4.0, centre=0.0, lasting=True)  # most pressures do not last
    assert lasting.radius_sd(overlap=3.0) == pytest.approx(np.sqrt(4.0 - 0.5625))
