from dataclasses import replace

import numpy as np
import pytest

from solver.posterior import near_gaps
from solver.posterior.near_gaps import find_near_gaps
from tests.solver.posterior.test_sequence_evidence import lattice_sequence, with_radii

REACH = 2e-4  # [m]


def test_who_asks_again_for_the_same_is_told_what_was_found() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    first = find_near_gaps(packing, snapshots, REACH)
    again = find_near_gaps(replace(packing, pressure=packing.pressure + 1.0), list(snapshots), REACH)
    assert again is first


@pytest.mark.parametrize("changed", ["radius", "position", "sigma", "reach", "present", "walls"])
def test_whatever_the_gaps_follow_from_is_looked_at_anew_when_it_changes(changed: str) -> None:
    packing, snapshots = lattice_sequence(1e-5)
    first, last, reach = find_near_gaps(packing, snapshots, REACH), snapshots[-1], REACH
    if changed == "radius":
        packing = with_radii(packing, packing.grains.radius + 1e-7)
    elif changed == "reach":
        reach = 1.5 * REACH
    elif changed == "present":
        last = replace(last, present=np.arange(packing.grains.count) > 0)
    else:
        value = {"position": last.position + 1e-7, "sigma": 2.0 * last.sigma, "walls": last.endpoints + 1e-7}
        last = replace(last, **{{"walls": "endpoints"}.get(changed, changed): value[changed]})
    other = find_near_gaps(packing, [*snapshots[:-1], last], reach)
    assert other is not first


def test_what_is_found_of_a_long_sequence_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(near_gaps, "MOST_KEPT", 10)
    packing, snapshots = lattice_sequence(1.1e-5)
    assert find_near_gaps(packing, snapshots, REACH) is not find_near_gaps(packing, snapshots, REACH)
