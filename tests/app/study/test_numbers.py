"""Which statistics are held against the truth's."""

import numpy as np
from rodsight.study.worlds.numbers import SHAPES, Compared, compared_names, is_compared, world_rows

from tests.app.recording.fake_results import make_results


def test_what_is_compared_is_a_number_or_a_shape():
    (statistics, *_) = make_results(1, 12, 12, sweeps=2).statistics
    names = compared_names()
    assert {"sliding_fraction", "contact_count", "tail_exponent", *SHAPES} <= set(names)
    for name in names:
        assert np.ndim(getattr(statistics, name)) == (name in SHAPES), name


def test_a_world_is_told_with_its_bias_and_how_often_its_interval_covers():
    ten, none = np.full(10, 0.2), np.zeros(10, np.uint8)
    error = np.r_[np.zeros(5), np.full(4, 0.015), 0.03]
    found = [
        Compared(world, 2, name, ten + error, ten, np.full(10, 0.01), 0.1 * ten, none)
        for world in ("gravity", "soft") for name in ("sliding_fraction", "mobilisation")
    ]  # fmt: skip
    expected = ["0.2", "0.209", "+4.5 %", "0.01", "50", "90", ""]
    assert world_rows(found, "sliding_fraction") == [["gravity", *expected], ["soft", *expected]]


def test_sizes_of_forces_are_compared_only_where_something_tells_them():
    assert is_compared("shear", "pressure")
    assert not is_compared("isotropic", "pressure")
    assert is_compared("isotropic", "sliding_fraction")


def test_a_world_that_is_far_off_is_said_to_be_unless_its_interval_covers():
    ten, none = np.full(10, 0.2), np.zeros(10, np.uint8)
    for bias, width, told in ((0.04, 0.025, "covered"), (0.04, 0.01, "far off"), (0.02, 0.001, "")):
        found = Compared("soft", 2, "sliding_fraction", ten + bias, ten, np.full(10, width), 0.1 * ten, none)
        assert world_rows([found], "sliding_fraction")[0][-1] == told
