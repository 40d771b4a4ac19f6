import numpy as np
import pytest

from solver.bodies.grains import Grains
from solver.contacts.contacts import Contacts, detect_contacts
from solver.posterior.error_scatter import scatter_of
from tests.packings import box


def lattice(side: int = 30) -> Contacts:
    rows = np.arange(side)
    position = np.array([(1.0 * column + 0.5 * (row % 2), np.sqrt(0.75) * row) for row in rows for column in rows])
    grains = Grains(np.full(len(position), 0.5), np.ones(len(position)))
    return detect_contacts(grains, position, np.ones(len(position), bool), box(99.0, 99.0), 0.01, wall_threshold=-9.0)


def gaps_with(contacts: Contacts, radius_sd: float, centre_sd: float, rng: np.random.Generator) -> np.ndarray:
    """Gaps as they are measured with radii too small by a random amount and centres displaced."""
    n, i, j = contacts.grain_count, contacts.i, contacts.j
    radius, centre = rng.normal(0.0, radius_sd, n), rng.normal(0.0, centre_sd, (n, 2))
    return radius[i] + radius[j] + np.einsum("ck,ck->c", contacts.normal, centre[j] - centre[i])


@pytest.mark.parametrize(("radius_sd", "centre_sd"), [(1.0, 0.5), (0.3, 1.0), (0.0, 1.0)])
def test_errors_of_radii_and_of_centres_are_told_apart(radius_sd: float, centre_sd: float) -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    frames = [(contacts, gaps_with(contacts, radius_sd, centre_sd, rng), np.ones(contacts.count)) for _ in range(8)]
    found = scatter_of(frames)
    assert np.sqrt(found.radius) == pytest.approx(radius_sd, abs=0.12)
    assert np.sqrt(found.centre) == pytest.approx(centre_sd, abs=0.08)


def test_overlap_that_a_squeezed_grain_shares_among_its_gaps_is_no_error_of_its_radius() -> None:
    contacts, rng = lattice(), np.random.default_rng(4)
    pressure = 1.0 + 0.4 * rng.normal(size=contacts.grain_count)
    gap = -0.5 * (pressure[contacts.i] + pressure[contacts.j])
    found = scatter_of([(contacts, gap - gap.mean(), np.ones(contacts.count))])
    assert found.radius > 0.0
    assert found.radius_deviation(overlap=1.0) == 0.0
    assert found.radius_deviation(overlap=0.0) == pytest.approx(0.2, abs=0.03)


def test_without_gaps_that_meet_nothing_is_claimed() -> None:
    contacts = lattice().select(np.array([0]))
    found = scatter_of([(contacts, np.ones(1), np.ones(1))])
    assert found.radius_deviation(0.0) == 0.0
