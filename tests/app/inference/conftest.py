"""Scenarios that several tests of the inference read."""

from __future__ import annotations

import pytest

from tests.app.inference.scenarios import Solved, solve


@pytest.fixture(scope="session")
def wrong_centres(tmp_path_factory: pytest.TempPathFactory) -> Solved:
    return solve(tmp_path_factory.mktemp("scenario"), "centres", 5, grains=70)
