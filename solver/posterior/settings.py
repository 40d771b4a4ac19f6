"""What the posterior is told: how well balance, positions and the elastic law hold, and how long it is sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class PosteriorSettings:
    """Constants of the posterior, all without dimension: lengths over the mean diameter, forces over the force unit.

    The overlap grows linearly with the force, as that of two parallel cylinders nearly does.
    """

    balance: float = 0.1  # s, standard deviation of a grain's unbalance
    width: float = 1.2e-4  # b, of the overlap about its law
    start_balance: float = 1.0  # both loosened at first, tightened geometrically
    start_width: float = 3e-3
    shear: float = 0.2  # τ, of a tangential force
    open_gap: float = 0.02  # ℓ, mean gap of pairs within reach that do not touch
    stiffness: float = 0.0  # mean of κ, the overlap per force unit, before anything is known
    stiffness_sd: float = 6e-3
    # λ, by which the logarithm of a force's probability falls with every force unit. Stresses that no load fixes would
    # grow without it, for large forces leave more room: as many unknowns per contact as balance leaves make up for it.
    rarity: float = 0.3
    offset_sd: float = 1e-5  # of an error that all gaps share
    gauge: float = 100.0  # K, which holds mean force and number of bearing contacts
    # 300, 100 and 250 sweeps change r by .0001 on average, at most .003 (twelve worlds of 300 rods, seeds 4 and 5).
    annealing: int = 100  # sweeps of tightening
    settling: int = 50  # sweeps after it that do not count
    kept: int = 200  # sweeps that count
    chains: int = 2  # of other random numbers; their difference is part of the doubt

    def alone(self) -> PosteriorSettings:
        """The same for a frame of which nothing else tells: a tighter balance, and draws enough for it.

        Twice the annealing and 2.5 times the draws change r of first frames by .0001 (ten worlds, seeds 4 and 5).
        """
        return replace(self, balance=0.5 * self.balance, settling=2 * self.settling, kept=2 * self.kept)

    def __post_init__(self) -> None:
        for name in ("balance", "width", "start_balance", "start_width", "shear", "open_gap", "stiffness_sd"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} of the posterior must be positive, not {getattr(self, name)}")
        if not self.rarity >= 0.0:
            raise ValueError(f"rarity of the posterior must not be negative, not {self.rarity}")
        if min(self.kept, self.chains) < 1 or min(self.annealing, self.settling) < 0:
            raise ValueError("the posterior needs at least one chain and one sweep that counts")
