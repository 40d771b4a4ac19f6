"""Names and units of results.h5: which fields become which datasets."""

from __future__ import annotations

SCHEMA_VERSION = 1
SCHEMA = "schema_version"

# Scalars of a frame: dataset under frames/ and attribute of FrameForces.
FRAME_SCALARS = (
    "sweeps",
    "natural_map",
    "unbalance",
    "kappa",
    "correction",
    "old_unbalance",
    "trust",
    "frames_since_reset",
)
# Likewise, but unknown to results that earlier versions wrote.
LATER_FRAME_SCALARS = ("start_difference", "unseen_grains", "hidden_share")
TRACK_OPTIONS = ("second_zncc", "reference_frame")  # attributes of Tracks that may be unknown: under tracks/
GEOMETRY = ("i", "j", "gap", "normal", "point")  # attributes of Contacts
CONTACT_COLUMNS = ("un", "ut", "state", "age", "source", "probability")
FORCE_COLUMNS = ("fn", "ft", "nlgs_fn", "nlgs_ft", "fn_sd", "ft_sd")
HISTORY_COLUMNS = ("force_change", "natural_map", "unbalance")
UNITS = {
    "calibration/offset": "m",
    "calibration/offset_sd": "m",
    "calibration/lens": "m",
    "calibration/lens_sd": "m",
    "calibration/radius": "m",
    "calibration/radius_sd": "m",
    "calibration/wall": "m",
    "calibration/wall_sd": "m",
    "calibration/wall_tilt": "rad",
    "calibration/wall_tilt_sd": "rad",
    "contacts/gap": "m",
    "contacts/point": "m",
    "contacts/un": "m/s",
    "contacts/ut": "m/s",
    "forces/fn": "N",
    "forces/fn_sd": "N",
    "forces/ft": "N",
    "forces/ft_sd": "N",
    "forces/nlgs_fn": "N",
    "forces/nlgs_ft": "N",
    "frames/time": "s",
    "grains/mass": "kg",
    "grains/radius": "m",
    "statistics/anisotropy_direction": "rad",
    "statistics/area": "m2",
    "statistics/friction_angle": "rad",
    "statistics/friction_angle_of_anisotropies": "rad",
    "statistics/max_fn": "N",
    "statistics/mean_fn": "N",
    "statistics/pressure": "Pa",
    "statistics/principal_direction": "rad",
    "statistics/sigma_1": "Pa",
    "statistics/sigma_2": "Pa",
    "statistics/stress": "Pa",
    "statistics/wall_force": "N",
    "statistics/wall_ratio_angle": "rad",
    "members/force": "N",
    "sweeps/fn": "N",
    "sweeps/ft": "N",
    "tracks/position": "m",
    "tracks/rotation": "rad",
    "tracks/sigma": "m",
    "walls/endpoints": "m",
    "walls/force": "N",
    "walls/pressure": "Pa",
    "walls/sigma": "m",
}
