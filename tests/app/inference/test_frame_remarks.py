"""What a frame's reason states of its poses."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.inference.solve_frames import with_remarks
from rodsight.solver.sequence.failure import failed_frame
from rodsight.tracks import TrackStatus

from .diagnosis.test_direct_tests import N, rolling_tracks


@pytest.mark.parametrize(("unreliable", "stated"), [(N // 10, False), (N // 10 + 1, True)])
def test_a_photograph_with_many_unreliable_poses_is_reported(unreliable, stated):
    tracks = rolling_tracks()
    status = np.full(tracks.status.shape, TrackStatus.OK, np.uint8)
    status[1, :unreliable] = TrackStatus.SUSPECT
    sequence = SimpleNamespace(tracks=replace(tracks, status=status), remark="")
    reasons = [with_remarks(sequence, failed_frame(k, "solved", N, 2)).reason for k in (0, 1)]  # type: ignore[arg-type]
    words = f"{unreliable} of {N} poses are unreliable: the photograph may be blurred, dark or covered; "
    assert reasons == ["solved", (words if stated else "") + "solved"]
