"""The forces of one frame, with everything one must know to judge them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.nlgs.sweep_record import SweepHistory


class FrameStatus(IntEnum):
    RESET = 0  # no usable history: solved from a first guess
    SUSPECT = 1  # the forces contradict the motion or the load
    REARRANGING = 2  # the former forces do not fit the new network
    SETTLING = 3  # too few frames since one of these
    SETTLED = 4
    FAILED = 5  # not solved


@dataclass(frozen=True, slots=True)
class FrameForces:
    """Contacts and forces of one frame. f_n > 0 is compression; forces are those that i exerts on j."""

    frame: int
    contacts: Contacts
    fn: Array  # (c,) [N] the reported field
    ft: Array  # (c,) [N]
    nlgs_fn: Array  # (c,) [N] the Gauss-Seidel chain whose sweeps are recorded
    nlgs_ft: Array  # (c,) [N]
    un: Array  # (c,) [m/s] measured relative velocity, u_n > 0 opens
    ut: Array  # (c,) [m/s]
    state: NDArray[np.uint8]  # (c,) ContactState
    age: NDArray[np.int32]  # (c,) frames since the contact was last absent
    source: NDArray[np.uint8]  # (c,) ContactSource
    probability: Array  # (c,) P(touch), NaN where not computed
    fn_sd: Array  # (c,) [N] calibrated standard deviation
    ft_sd: Array  # (c,) [N]
    status: FrameStatus
    reason: str  # why the frame has this status and how its solve ended: sentences for the user
    sweeps: int
    natural_map: float  # reached, of the Gauss-Seidel chain
    unbalance: float  # worst |ΣF| on a grain / mean f_n, of the reported field
    kappa: float  # kinematic number w m v_rms / (δt σ L d)
    correction: float  # ε: how much the forces must correct the measured motion
    old_unbalance: float  # ū: mean |ΣF| of the former forces on this network / mean f_n; NaN without former forces
    trust: float  # T, an estimate of the correlation with the true forces, given these inputs
    frames_since_reset: int
    history: SweepHistory
    member_force: Array | None = None  # (c, m, 2) [N] (f_n, f_t) of every member of the ensemble, where asked for
    start_difference: float = float("nan")  # H: of two chains started differently, over the rms; NaN: not computed
    unseen_grains: int = 0  # holes inside the walls that a rod would fit into
    hidden_share: float = 0.0  # 1 − correlation of the field with what is left when bridged grains are dropped
