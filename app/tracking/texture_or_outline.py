"""What of the rods is followed better from the first photograph to the second: their texture or their outlines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..experiment.pictures.image import Image
from ..tracks import TrackStatus
from .detection.detect import Detection
from .outline.outline_tracker import OutlineTracker
from .registration.neighbours import local_motion
from .settings import TrackingSettings
from .tracker import Tracker

SURE = (TrackStatus.OK, TrackStatus.RESCUED, TrackStatus.ROBUST)
BETTER_FOLLOWED = 1.2  # ratio of rods that are followed by their outlines to those by their texture
AS_MANY = 0.9  # the same ratio from which on the better agreement with the neighbours decides
# Ratio of the median deviations from the neighbours' motion. With paint all over the rods it is .7 to 1.1 (sixteen
# kinds of paint and light of one packing), with one dot or half a disc of it, or a fixed glint on plain rods, 2 to 6.
BETTER_AGREEMENT = 1.5


class _Followed(NamedTuple):
    """Rods that are found in the second photograph, and how far their motions differ from those beside them."""

    rods: int
    deviation: float  # [px] median; inf with too few rods


def prefer_outlines(first: Image, second: Image, detection: Detection) -> str:
    """Return why the rods should be followed by their outlines, as a sentence; empty: by their texture.

    A small mark leaves the place of a rod open to a rotation about it, although its picture is found again exactly: the
    rods then seem to move more against their neighbours than by their outlines.
    """
    texture = _follow(Tracker(first, detection, TrackingSettings("texture")), second)
    outline = _follow(OutlineTracker(first, detection, TrackingSettings("outline")), second)
    if outline.rods > max(BETTER_FOLLOWED * texture.rods, texture.rods + 2):
        return (
            f"By their outlines {outline.rods} of {detection.count} rods are followed to the second photograph, by "
            f'their texture {texture.rods}: follow = "outline".'
        )
    if outline.rods >= AS_MANY * texture.rods and texture.deviation > BETTER_AGREEMENT * outline.deviation:
        return (
            "By their texture rods move against their neighbours by "
            f"{texture.deviation:.2g} px to the second photograph, by their outlines by {outline.deviation:.2g} px: "
            'the paint shows too little of a rod, follow = "outline".'
        )
    return ""


def _follow(tracker: Tracker | OutlineTracker, image: Image) -> _Followed:
    before = tracker.first()
    after = tracker.follow(image, [before])
    sure = np.isin(after.status, SURE)
    place = before.pose[sure, :2]
    moved = after.pose[sure, :2] - place
    expected, _ = local_motion(place, moved, place, exclude_self=True)
    deviation = np.linalg.norm(moved - expected, axis=1)
    known = np.isfinite(deviation)
    return _Followed(int(sure.sum()), float(np.median(deviation[known])) if known.any() else np.inf)
