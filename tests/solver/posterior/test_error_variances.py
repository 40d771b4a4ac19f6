import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.contacts.contacts import Contacts, detect_contacts
from rodsight.solver.posterior.error_variances import ErrorVariances, estimate_error_variances

from tests.packings import box


def lattice(side: int = 30) -> Contacts:
    rows = np.arange(side)
    position = np.array([(1.0 * column + 0.5 * (row % 2), np.sqrt(0.75) * row) for row in rows for column in rows])
    grains = Grains(np.full(len(position), 0.5), np.ones(len(position)))
    return detect_contacts(grains, position, np.ones(len(position), bool), box(99.0, 99.0), 0.01, wall_threshold=-9.0)


def make_gaps(contacts: Contacts, radius_sd: float, centre_sd: float, rng: np.random.Generator) -> np.ndarray:
    """Make the gaps that are measured with random errors of radii and centres."""
    n, i, j = contacts.grain_count, contacts.i, contacts.j
    radius, centre = rng.normal(0.0, radius_sd, n), rng.normal(0.0, centre_sd, (n, 2))
    return radius[i] + radius[j] + np.einsum("ck,ck->c", contacts.normal, centre[j] - centre[i])


@pytest.mark.parametrize(("radius_sd", "centre_sd"), [(1.0, 0.5), (0.3, 1.0), (0.0, 1.0)])
def test_variances_of_radii_and_centres_are_separated(radius_sd: float, centre_sd: float) -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    frames = [(contacts, make_gaps(contacts, radius_sd, centre_sd, rng), np.ones(contacts.count)) for _ in range(8)]
    found = estimate_error_variances(frames)
    assert np.sqrt(found.radius) == pytest.approx(radius_sd, abs=0.12)
    assert np.sqrt(found.centre) == pytest.approx(centre_sd, abs=0.08)


def test_overlap_common_to_the_gaps_of_a_grain_is_no_radius_error() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    pressure = 1.0 + 0.4 * rng.normal(size=contacts.grain_count)
    gap = -0.5 * (pressure[contacts.i] + pressure[contacts.j])
    found = estimate_error_variances([(contacts, gap - gap.mean(), np.ones(contacts.count))])
    assert found.radius > 0.0
    assert found.radius_sd(overlap=1.0) == 0.0
    assert found.radius_sd(overlap=0.0) == pytest.approx(0.2, abs=0.03)


def test_without_gaps_that_meet_variances_are_zero() -> None:
    contacts = lattice().select(np.array([0]))
    found = estimate_error_variances([(contacts, np.ones(1), np.ones(1))])
    assert found.radius_sd(0.0) == 0.0


def test_overlap_adds_a_quarter_of_its_square_to_the_variance_of_radii() -> None:
    found = ErrorVariances(radius=4.0, centre=0.0)
    assert found.radius_sd(overlap=3.0) == pytest.approx(np.sqrt(4.0 - 2.25))
