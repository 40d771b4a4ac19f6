"""Marks the solver tests that are small enough to run without compilation."""

from __future__ import annotations

from pathlib import Path

import pytest

# Tests with hundreds of sweeps or time steps take minutes without compilation; tests without compiled code would be
# repeated. The kernels are compared with plain twins in tests/reference, those of the posterior with integrals.
COMPILED_ALONE = (
    "calibration", "convex", "dem", "sequence", "test_acceleration.py", "test_refinement.py", "test_frame_posterior.py",
    "test_radii.py", "test_simulated_forces.py", "test_changes.py", "test_kinematics.py",
    "test_equilibrium_projection.py", "test_touching_gaps.py", "test_candidate_gaps.py", "test_sweep_record.py",
    "test_start_residuals.py",
)  # fmt: skip
SMALL = (
    "test_equations.py",
    "test_normal_equations.py",
    "test_gap_error_draws.py",
    "test_contact_jacobian.py",
    "test_elliptic_section.py",
    "test_gaps.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    here = Path(__file__).parent
    for item in items:
        alone = set(item.path.parts) & set(COMPILED_ALONE) and item.path.name not in SMALL
        if item.path.is_relative_to(here) and not alone:
            item.add_marker(pytest.mark.unit)
