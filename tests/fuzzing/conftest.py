"""Valid input of every kind, made once; tests corrupt copies of it."""

from __future__ import annotations

import pytest

from .cases import Originals, make_originals


@pytest.fixture(scope="session")
def originals(tmp_path_factory: pytest.TempPathFactory) -> Originals:
    return make_originals(tmp_path_factory.mktemp("originals"))
