"""Bad input in Python: what is wrong is named as the user gave it, and every mistake is an InputError."""

from __future__ import annotations

import pandas as pd
import pytest
import rodsight


def test_a_wrong_data_frame_is_called_a_data_frame(tmp_path):
    spots = pd.DataFrame({"t": [0, 0], "rod": [1, 2], "X": ["0.1", "wide"], "Y": [0.1, 0.1]})
    roles = {"frame": "t", "id": "rod", "x": "x", "y": "Y"}
    with pytest.raises(rodsight.InputError, match=r"^data frame: column x: there is no such column") as raised:
        rodsight.import_table(spots, tmp_path / "out", roles, radius=0.01)
    assert raised.value.problem.startswith("there is no such column")
    with pytest.raises(rodsight.InputError, match=r"^data frame: row 3, X = 'wide': is not a number$"):
        rodsight.import_table(spots, tmp_path / "out", roles | {"x": "X"}, radius=0.01)
    spots["X"] = [0.1, 0.12]
    rodsight.import_table(spots, tmp_path / "out", roles | {"x": "X"}, radius=0.01)
    assert (tmp_path / "out/experiment.toml").read_text().startswith("# From data frame, by rodsight import table.\n")
