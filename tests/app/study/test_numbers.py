"""Which statistics are held against the truth's."""

import numpy as np
from rodsight.study.worlds.numbers import SHAPES, compared_names, is_compared

from tests.app.recording.fake_results import make_results


def test_what_is_compared_is_a_number_or_a_shape():
    (statistics, *_) = make_results(1, 12, 12, sweeps=2).statistics
    names = compared_names()
    assert {"sliding_fraction", "contact_count", "tail_exponent", *SHAPES} <= set(names)
    for name in names:
        assert np.ndim(getattr(statistics, name)) == (name in SHAPES), name


def test_sizes_of_forces_are_compared_only_where_something_tells_them():
    assert is_compared("shear", "pressure")
    assert not is_compared("isotropic", "pressure")
    assert is_compared("isotropic", "sliding_fraction")
