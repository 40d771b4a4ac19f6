"""Parameters of the posterior: standard deviations of its terms, priors, and numbers of sweeps."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class PosteriorSettings:
    """Parameters of the posterior, all dimensionless: lengths over the mean diameter, forces over the force unit.

    Notes
    -----
    The overlap grows linearly with the force, as that of two parallel cylinders nearly does. The terms of the
    posterior that the symbols belong to stand in `sampler.gibbs_sweeps`.
    """

    balance_sd: float = 0.1  # s, standard deviation of a grain's force residual
    gap_law_sd: float = 1.2e-4  # b, standard deviation of a corrected gap about −κ f, or about the true open gap
    start_balance_sd: float = 1.0  # both are larger at first and annealed geometrically
    start_gap_law_sd: float = 3e-3
    tangential_sd: float = 0.2  # τ, standard deviation of a tangential force
    mean_open_gap: float = 0.02  # ℓ, mean gap of pairs within reach that do not touch
    compliance: float = 0.0  # κ_0, prior mean of κ, the overlap per force unit
    compliance_sd: float = 6e-3  # σ_κ
    # λ, rate at which the logarithm of a force's prior falls with every force unit. Stresses that no load fixes would
    # diverge without it: each unknown that balance leaves undetermined multiplies the volume of large forces.
    force_rate: float = 0.3
    offset_sd: float = 1e-5  # σ_o, of an error that all gaps share
    gauge: float = 100.0  # K and K_N, which hold the mean force and the number of bearing contacts
    # 300, 100 and 250 sweeps change r by .0001 on average, at most .003 (twelve test cases of 300 rods, seeds 4 and 5).
    annealing: int = 100  # sweeps of annealing
    burn_in: int = 50  # sweeps after it that are discarded
    kept: int = 200  # sweeps that are averaged
    chains: int = 2  # with different random numbers; their difference is part of the standard deviation

    def for_isolated_frame(self) -> PosteriorSettings:
        """Return settings for a frame without other evidence: half of `balance_sd`, twice the burn-in and kept sweeps.

        Twice the annealing and 2.5 times the draws change r of first frames by .0001 (ten test cases, seeds 4 and 5).
        """
        return replace(self, balance_sd=0.5 * self.balance_sd, burn_in=2 * self.burn_in, kept=2 * self.kept)

    def for_comparison(self) -> PosteriorSettings:
        """Return settings for forces that are compared with those of the motion, and hardly count by themselves.

        Half the sweeps change r by .0003 on average in packings that slide, where forces of the motion count more than
        half, and by .0024 in those at rest, where they do not (22 packings, seeds 82 and 83).
        """
        return replace(self, annealing=6 * self.annealing // 10, burn_in=6 * self.burn_in // 10, kept=self.kept // 2)

    def for_positions_alone(self) -> PosteriorSettings:
        """Return settings for forces that only positions show: half of `balance_sd`, twice the `tangential_sd`.

        Of nine simulated packings of soft discs and four sets of photoelastic ones, twice the `tangential_sd` raises r
        in nine, by .002 on average, and changes it by .0005 to −.004 in the others. Twice the burn-in and kept sweeps
        change the r of 14 packings of soft grains by .0001 on average and .0005 at most (seeds 82 and 83), because the
        forces of a frame are averaged with those of its neighbours.
        """
        return replace(self, balance_sd=0.5 * self.balance_sd, tangential_sd=2.0 * self.tangential_sd)

    def __post_init__(self) -> None:
        for name in (
            "balance_sd", "gap_law_sd", "start_balance_sd", "start_gap_law_sd", "tangential_sd", "mean_open_gap",
            "compliance_sd",
        ):  # fmt: skip
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} of the posterior must be positive, not {getattr(self, name)}")
        if not self.force_rate >= 0.0:
            raise ValueError(f"force_rate of the posterior must not be negative, not {self.force_rate}")
        if min(self.kept, self.chains) < 1 or min(self.annealing, self.burn_in) < 0:
            raise ValueError("the posterior needs at least one chain and one kept sweep")
