"""Factors that bring the stress of one field half way to that of another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.mixture.field_mixing import ForceField, mix_fields
from rodsight.solver.mixture.stress_matching import LEAST_FACTOR, stress_factors
from rodsight.solver.posterior.frame_posterior import FramePosterior
from rodsight.solver.statistics.stress import love_weber_stress

C = 200


def pairs(rng: np.random.Generator, angle: np.ndarray) -> tuple[Contacts, np.ndarray]:
    """Make pairs of discs at these angles, each apart from the others."""
    first, normal = rng.normal(size=(len(angle), 2)), np.column_stack([np.cos(angle), np.sin(angle)])
    position = np.concatenate([first, first + 2.0 * normal])
    i = np.arange(len(angle), dtype=np.int32)
    contacts = Contacts(i, i + np.int32(len(angle)), np.zeros(len(angle)), normal, first + normal, 2 * len(angle), 0)
    return contacts, position


def stress_of(contacts: Contacts, fn: np.ndarray, ft: np.ndarray, position: np.ndarray) -> np.ndarray:
    found = love_weber_stress(contacts, fn, ft, position, 1.0, 1.0)
    return 0.5 * (found + found.T)


@pytest.mark.unit
def test_squares_of_the_factors_give_the_stress() -> None:
    rng = np.random.default_rng(3)
    contacts, position = pairs(rng, rng.uniform(-np.pi, np.pi, C))
    fn = rng.exponential(1.0, C)
    ft = rng.uniform(-0.3, 0.3, C) * fn
    stress = stress_of(contacts, fn, ft, position) @ np.diag([1.2, 0.9]) + np.array([[0.0, 20.0], [20.0, 0.0]])
    stress = 0.5 * (stress + stress.T)
    factor = stress_factors(contacts, fn, ft, position, stress)
    np.testing.assert_allclose(
        stress_of(contacts, factor**2 * fn, factor**2 * ft, position), stress, rtol=1e-9, atol=1e-9
    )
    assert factor.min() > 0.0
    assert factor.std() > 0.03


@pytest.mark.unit
def test_too_few_directions_leave_forces_as_they_are() -> None:
    rng = np.random.default_rng(3)
    contacts, position = pairs(rng, np.repeat([0.0, 0.5 * np.pi], C // 2))
    np.testing.assert_array_equal(stress_factors(contacts, np.ones(C), np.zeros(C), position, np.eye(2)), np.ones(C))


@pytest.mark.unit
def test_no_force_changes_its_sign() -> None:
    rng = np.random.default_rng(3)
    contacts, position = pairs(rng, rng.uniform(-np.pi, np.pi, C))
    stress = np.array([[2.0 * C, 0.0], [0.0, -0.5 * C]])
    factor = stress_factors(contacts, np.ones(C), np.zeros(C), position, stress)
    assert factor.min() > 0.0
    assert (factor == factor.min()).sum() > C / 10
    assert factor.max() ** 2 > 1.5 * factor.min() ** 2 / LEAST_FACTOR  # the mean factor lies between


@pytest.mark.unit
def test_factors_change_the_mixture_but_not_the_agreement() -> None:
    rng = np.random.default_rng(4)
    contacts, _ = pairs(rng, rng.uniform(-np.pi, np.pi, C))
    fn, factor = rng.exponential(1.0, C), rng.uniform(0.5, 1.5, C)
    posterior = FramePosterior(
        contacts, fn, 0.1 * fn, np.full(C, 0.3), np.full(C, 0.1), np.ones(C), np.zeros((2 * C, 2)), np.zeros(2 * C),
        2e-6, 0.0, 0.0, 0.9, 0.99, np.ones(2 * C), np.zeros(2 * C),
    )  # fmt: skip
    motion = ForceField(contacts.key, np.column_stack([factor * fn, 0.0 * fn]), 0.9)
    plain = mix_fields(motion, posterior, given=1.0)
    found = mix_fields(motion, replace(posterior, stress_factor=factor), given=1.0)
    np.testing.assert_allclose(found.force[:, 0], factor * fn)
    assert found.agreement == plain.agreement < 1.0
