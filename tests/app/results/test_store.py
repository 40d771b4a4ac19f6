"""results.h5 read back, from this version and from earlier ones."""

import h5py
import numpy as np
from rodsight.results.schema import LATER_FRAME_SCALARS
from rodsight.results.store import Provenance, load_results, save_results

from tests.app.recording.fake_results import make_results

ORIGIN = Provenance("fingerprint", "experiment.toml", (0, None), {})


def test_results_of_an_earlier_version_can_still_be_read(tmp_path):
    results, file = make_results(), tmp_path / "results.h5"
    save_results(file, results, ORIGIN)
    with h5py.File(file, "a") as store:
        for key in LATER_FRAME_SCALARS:
            assert np.shape(store[f"frames/{key}"]) == (len(results.frames),)
            del store[f"frames/{key}"]
    read = load_results(file)
    assert np.isnan([frame.start_difference for frame in read.frames]).all()
    assert [frame.trust for frame in read.frames] == [frame.trust for frame in results.frames]
