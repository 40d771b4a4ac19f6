"""Forces of one frame with their assessment: status, trust, standard deviations and diagnostics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from .bodies.grains import Array
from .contacts.contacts import Contacts, ContactSource, ContactState
from .nlgs.sweep_record import SweepHistory
from .quantity import Quantity

NAN = float("nan")
ERROR_PARTS = ("positions", "radii", "friction", "contacts", "steps", "method")  # of an error budget
MEMBERS = ("soft", "stiff", "last", "ahead", "around", "wide", "steady")  # of the ensemble: 2 chains, 5 convex programs


class FrameStatus(IntEnum):
    RESET = 0  # no usable history: solved from a first guess
    SUSPECT = 1  # the forces contradict the motion or the load
    REARRANGING = 2  # the previous forces do not fit the new network
    SETTLING = 3  # too few frames since one of these
    SETTLED = 4
    FAILED = 5  # not solved


@dataclass(frozen=True, slots=True)
class FrameForces:
    """Contacts and forces of one frame. f_n > 0 is compression; forces are those that i exerts on j.

    c contacts, m members of the ensemble: (c,), (c, m, 2) and single values.
    """

    frame: int
    contacts: Contacts
    fn: Annotated[Array, Quantity("normal force, compression positive", "N", "contact", essential=True)]
    ft: Annotated[Array, Quantity("tangential force of i on j", "N", "contact", essential=True)]
    nlgs_fn: Annotated[Array, Quantity("f_n of the chain whose sweeps are recorded", "N", "contact")]
    nlgs_ft: Annotated[Array, Quantity("f_t of the chain whose sweeps are recorded", "N", "contact")]
    un: Annotated[Array, Quantity("measured relative velocity along the normal, opening", "m/s", "contact")]
    ut: Annotated[Array, Quantity("measured relative velocity along the tangent", "m/s", "contact")]
    state: Annotated[
        NDArray[np.uint8],
        Quantity("how the contact carries its force", dims="contact", essential=True, names=ContactState),
    ]
    age: Annotated[NDArray[np.int32], Quantity("frames since the contact was last absent", dims="contact", absent=0)]
    source: Annotated[
        NDArray[np.uint8], Quantity("how the contact was found", dims="contact", absent=0, names=ContactSource)
    ]
    probability: Annotated[Array, Quantity("P(touch), NaN where not computed", dims="contact")]
    fn_sd: Annotated[Array, Quantity("standard deviation of f_n, calibrated", "N", "contact")]
    ft_sd: Annotated[Array, Quantity("standard deviation of f_t, calibrated", "N", "contact")]
    status: Annotated[FrameStatus, Quantity("how far the forces may be trusted", essential=True, names=FrameStatus)]
    reason: Annotated[str, Quantity("why it has this status and how its solve ended", absent="")]
    sweeps: Annotated[int, Quantity("sweeps done", absent=0)]
    natural_map: Annotated[float, Quantity("relative natural-map residual reached, of the Gauss-Seidel chain")]
    unbalance: Annotated[float, Quantity("worst |ΣF| on a grain / mean f_n, of the reported field")]
    kappa: Annotated[float, Quantity("kinematic number w m v_rms / (δt σ L d)")]
    correction: Annotated[float, Quantity("ε: how much the forces must correct the measured motion")]
    old_unbalance: Annotated[float, Quantity("ū: mean |ΣF| of the previous forces on this network / mean f_n")]
    trust: Annotated[
        float, Quantity("T: lower bound of the correlation with the true forces, which few frames are below")
    ]
    frames_since_reset: Annotated[int, Quantity("frames since the last reset", absent=0)]
    history: SweepHistory
    member_force: Annotated[
        Array | None,
        Quantity(
            "forces of the ensemble members, NaN: no interval to read",
            "N",
            "contact member component",
            path="members/force",
        ),
    ] = None
    start_difference: Annotated[
        float, Quantity("H: rms difference of two chains started differently, over the rms; NaN once forgotten")
    ] = float("nan")
    unseen_grains: Annotated[int, Quantity("holes inside the walls that a rod would fit into")] = 0
    hidden_fraction: Annotated[
        float, Quantity("1 − correlation with the field without bridged grains", formerly="frames/hidden_share")
    ] = 0.0
    similarity: Annotated[
        float, Quantity("correlation of f_n with that of the frame before, on common contacts", since=2)
    ] = NAN
    new_contact_count: Annotated[
        float, Quantity("contacts that the frame before did not have", since=2, formerly="frames/gained_count")
    ] = NAN
    lost_contact_count: Annotated[
        float,
        Quantity(
            "contacts of the frame before that are gone, lost grains aside", since=2, formerly="frames/parted_count"
        ),
    ] = NAN
    force_change: Annotated[
        float, Quantity("1 − correlation of f_n with that of the frame before, on the contacts of either", since=2)
    ] = NAN
    strain: Annotated[
        Array | None,
        Quantity("logarithmic strain of the packing since frame 0, extension positive", dims="xy axis", since=2),
    ] = None
    shear: Annotated[float, Quantity("difference of the principal strains since frame 0", "rad", since=2)] = NAN
    shear_step: Annotated[float, Quantity("the same since the frame before", "rad", since=2)] = NAN
    warm_residual: Annotated[float, Quantity("natural map after one sweep from the previous forces", since=2)] = NAN
    cold_residual: Annotated[
        Array | None,
        Quantity(
            "natural map after 1, 2, 4, … sweeps from zero forces, NaN where no sweeps are kept",
            dims="cold_sweep",
            since=2,
        ),
    ] = None
    sweeps_saved: Annotated[
        float,
        Quantity("sweeps from zero forces that reduce the residual as much as one from the previous forces", since=2),
    ] = NAN
    grain_unbalance: Annotated[
        Array | None,
        Quantity(
            "|ΣF| / mean f_n of the reported field, NaN: not there", dims="grain", path="grains/unbalance", since=2
        ),
    ] = None
    bearing_probability: Annotated[
        Array | None, Quantity("P(bears force), as distinct from probability, P(touch)", dims="contact", since=2)
    ] = None
    sliding_probability: Annotated[Array | None, Quantity("P(slides), if it bears force", dims="contact", since=2)] = (
        None
    )
    overlap: Annotated[
        float,
        Quantity("overlap of soft grains per mean force, where the position-only estimate was computed", "m", since=2),
    ] = NAN
    position_weight: Annotated[
        float,
        Quantity(
            "weight of the position-only estimate in the reported field", since=2, formerly="frames/positions_share"
        ),
    ] = 0.0
    soft: Annotated[int, Quantity("1: grains are soft, forces follow from overlaps; 0: hard", since=2)] = 0
    unseen_penalty: Annotated[
        float,
        Quantity(
            "fraction of the trust lost to rods that no photograph shows", since=2, formerly="frames/unseen_doubt"
        ),
    ] = 0.0
    expected_correlation: Annotated[float, Quantity("best estimate of the correlation with the true f_n", since=2)] = (
        NAN
    )
    agreement: Annotated[
        float,
        Quantity(
            "correlation of the motion estimate with the position-only estimate, NaN where only one was computed",
            since=2,
        ),
    ] = NAN
    scale_sd: Annotated[
        float,
        Quantity(
            "relative standard deviation of the scale of all forces, NaN where they are known up to a factor only",
            since=2,
        ),
    ] = NAN
    trust_penalties: Annotated[
        str,
        Quantity(
            "reasons that lower the trust with their cures, the worst first, separated by ' · '",
            since=2,
            formerly="frames/doubt",
        ),
    ] = ""
    friction: Annotated[Array | None, Quantity("coefficient used at the contact", dims="contact", since=2)] = None
    error_budget: Annotated[
        Array | None,
        Quantity("fraction of each cause in the variance of the forces' error", dims="error_part", since=2),
    ] = None  # not requested
    relative_error: Annotated[float, Quantity("error of the forces that the budget divides, ‖σ‖ / ‖f‖", since=2)] = NAN
    failed_reason: Annotated[str, Quantity("why it could not be solved; empty where it was", since=2)] = ""

    @property
    def bearing(self) -> Array:
        """P(bears force) of every contact (c,); where it was not computed, whether it carries a normal force."""
        if self.bearing_probability is None:
            return (self.fn > 0.0).astype(np.float64)
        return np.nan_to_num(self.bearing_probability)

    def scaled(self, factor: float) -> FrameForces:
        """The same with all forces and their standard deviations multiplied, those of sweeps and members included."""
        history = replace(
            self.history, fn=np.float32(factor) * self.history.fn, ft=np.float32(factor) * self.history.ft
        )  # fmt: skip
        return replace(
            self, fn=factor * self.fn, ft=factor * self.ft, fn_sd=factor * self.fn_sd, ft_sd=factor * self.ft_sd,
            nlgs_fn=factor * self.nlgs_fn, nlgs_ft=factor * self.nlgs_ft, history=history,
            member_force=None if self.member_force is None else factor * self.member_force,
        )  # fmt: skip
