from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.posterior import candidate_gaps
from rodsight.solver.posterior.candidate_gaps import find_candidate_gaps

from tests.solver.posterior.test_sequence_evidence import lattice_sequence, with_radii

REACH = 2e-4  # [m]


def test_same_input_returns_the_cached_result() -> None:
    packing, snapshots = lattice_sequence(1e-5)
    first = find_candidate_gaps(packing, snapshots, REACH)
    again = find_candidate_gaps(replace(packing, pressure=packing.pressure + 1.0), list(snapshots), REACH)
    assert again is first


@pytest.mark.parametrize("changed", ["radius", "position", "sigma", "reach", "present", "walls"])
def test_changed_input_is_evaluated_again(changed: str) -> None:
    packing, snapshots = lattice_sequence(1e-5)
    first, last, reach = find_candidate_gaps(packing, snapshots, REACH), snapshots[-1], REACH
    if changed == "radius":
        packing = with_radii(packing, packing.grains.radius + 1e-7)
    elif changed == "reach":
        reach = 1.5 * REACH
    elif changed == "present":
        last = replace(last, present=np.arange(packing.grains.count) > 0)
    else:
        value = {"position": last.position + 1e-7, "sigma": 2.0 * last.sigma, "walls": last.endpoints + 1e-7}
        last = replace(last, **{{"walls": "endpoints"}.get(changed, changed): value[changed]})
    other = find_candidate_gaps(packing, [*snapshots[:-1], last], reach)
    assert other is not first


def test_long_sequences_are_not_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidate_gaps, "MAX_CACHED_GAPS", 10)
    packing, snapshots = lattice_sequence(1.1e-5)
    assert find_candidate_gaps(packing, snapshots, REACH) is not find_candidate_gaps(packing, snapshots, REACH)
