"""A person who makes ten mistakes ends without a text editor, loses nothing, and has right forces."""

import numpy as np
import pytest

from tests.app.workbench.hand import opened
from tests.app.workbench.journey_of_mistakes import MistakenJourney, make_folder, make_mistakes

pytestmark = [pytest.mark.screen, pytest.mark.slow]
WANTED = 0.97
SETTLED = 5  # photographs after which friction is mobilised


def test_ten_mistakes_are_named_and_taken_back(page, tmp_path):
    made = make_folder(tmp_path, grains=60, frames=10)
    with opened(page, made.folder) as tab:
        journey = MistakenJourney(tab, made)
        make_mistakes(journey)
        assert np.nanmean(journey.r[SETTLED:]) >= WANTED, journey.r
