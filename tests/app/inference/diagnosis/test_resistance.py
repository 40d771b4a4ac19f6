"""What resists the sliding is reported with the values of the model that was found beside those of the input."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.inference.diagnosis import resistance as module
from rodsight.solver.convex.friction_check import BIAS
from rodsight.solver.convex.resistance import Resistance
from rodsight.solver.convex.sliding_model import SlidingModel
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.solver.nlgs.chain import ChainSettings, force_scale

from tests.solver.sequence.test_frames import sheared_frames

GIVEN = SlidingModel(0.25, 0.31)
FOUND = SlidingModel(0.4 * BIAS, 0.07, 0.12, 0.3, 0.08)
TEXTS = {
    "friction": "rods slide as with a friction of 0.40, not 0.25",
    "wall_friction": "rods slide on walls as with a friction of 0.07, not 0.31, and on one another as with 0.40",
    "base_friction": "the base drags each rod by 12 % of the mean force",
    "adhesion": "rods attract one another by 30 % of the mean force",
    "rolling_resistance": "contacts resist rolling by 0.08 of f_n",
    "photographs_reversed": "against it in reverse order",
}


@pytest.fixture(scope="module")
def sequence():
    packing, snapshots = sheared_frames(8)
    ensemble = SimpleNamespace(probability=ContactProbabilitySettings(1e-6))
    settings = SimpleNamespace(for_radii=lambda _: SimpleNamespace(ensemble=ensemble), workers=1)
    return SimpleNamespace(
        packing=packing, snapshots=snapshots, settings=settings, friction_measured=False, base_gravity=2.0,
        tracks=None, walls=None,
    )  # fmt: skip


def examine(sequence, monkeypatch, cause: str, sliding: float | None = 0.2) -> list[str]:
    """Return the evidence of the findings where a model resists; also note the first frame that is compared."""
    calls = []
    found = Resistance(cause, GIVEN, 0.4, FOUND, 0.1)
    quality = None if sliding is None else SimpleNamespace(sliding=sliding)
    monkeypatch.setattr(module, "measure_data_quality", lambda *_: quality)
    monkeypatch.setattr(module, "find_in_sequence", lambda *given: calls.append(given) or found)
    findings = module.examine_resistance(sequence)
    ((_, _, first, *_),) = calls
    assert first == 2  # the middle four of eight
    assert [each.cause for each in findings] == ([cause] if findings else [])
    return [each.evidence for each in findings]


@pytest.mark.parametrize("cause", TEXTS)
def test_a_finding_states_what_was_found_and_how_much_it_explains(sequence, monkeypatch, cause) -> None:
    (evidence,) = examine(sequence, monkeypatch, cause)
    assert TEXTS[cause] in evidence
    assert evidence.endswith("with that, what contradicts the sliding falls from 40 to 10 %")


def test_nothing_is_reported_without_a_winner_or_where_the_friction_was_measured(sequence, monkeypatch) -> None:
    assert examine(sequence, monkeypatch, "") == []
    measured = SimpleNamespace(**vars(sequence) | {"friction_measured": True})
    assert examine(measured, monkeypatch, "friction") == []
    assert len(examine(measured, monkeypatch, "wall_friction")) == 1


@pytest.mark.parametrize("cause", ["friction", "wall_friction", "adhesion"])
def test_what_acts_where_contacts_slide_is_named_only_where_enough_do(sequence, monkeypatch, cause) -> None:
    assert examine(sequence, monkeypatch, cause, 0.05) == []
    assert examine(sequence, monkeypatch, cause, None) == []
    assert len(examine(sequence, monkeypatch, cause, 0.15)) == 1


def test_a_reversed_order_is_named_where_fewer_contacts_slide(sequence, monkeypatch) -> None:
    assert examine(sequence, monkeypatch, "photographs_reversed", 0.015) == []
    assert len(examine(sequence, monkeypatch, "photographs_reversed", 0.03)) == 1


def test_a_base_is_named_however_few_contacts_slide(sequence, monkeypatch) -> None:
    assert len(examine(sequence, monkeypatch, "base_friction", 0.05)) == 1


def test_the_coefficient_of_a_base_needs_the_scale_of_the_forces(sequence, monkeypatch) -> None:
    (evidence,) = examine(sequence, monkeypatch, "base_friction")
    unit = force_scale(sequence.packing, ChainSettings())
    coefficient = 0.12 * unit / (2.0 * sequence.packing.grains.mass.mean())  # under a gravity of 2 m/s²
    assert f"of the mean force, a coefficient of {coefficient:.3g}" in evidence
    bare = replace(sequence.packing, pressure=np.full(len(sequence.packing.pressure), np.nan))
    unknown = SimpleNamespace(**vars(sequence) | {"packing": bare})
    assert not bare.scale_is_known
    (evidence,) = examine(unknown, monkeypatch, "base_friction")
    assert "coefficient" not in evidence


@pytest.mark.parametrize(("cause", "value"), [("base_friction", "base_drag"), ("adhesion", "attraction")])
def test_a_resistance_of_nothing_is_not_named(sequence, monkeypatch, cause, value) -> None:
    monkeypatch.setattr(sys.modules[__name__], "FOUND", replace(FOUND, **{value: 0.002}))
    assert examine(sequence, monkeypatch, cause) == []
