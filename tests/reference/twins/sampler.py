"""The posterior of the sampler as one function, and a sweep whose conditional distributions follow from it alone.

Every conditional is a Gaussian: its precision and mean are read from three values of the posterior. All sums over
grains are formed anew for each value. Draws are the inverse of the exact tail at the given uniform numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rodsight.solver.bodies.grains import Array
from rodsight.solver.posterior.sampler.records import ModelParameters, SamplerGrains, SamplerPairs
from scipy.special import log_ndtr, ndtri_exp

CERTAIN = 30.0  # logarithm of the odds against bearing that is more than the least uniform number
SCALE_STEPS = 4


@dataclass(frozen=True)
class PlainState:
    """One draw of all unknowns."""

    bearing: Array  # (c,) z
    fn: Array  # (c,)
    ft: Array  # (c,)
    open_gap: Array  # (c,)
    centre: Array  # (m, 2) ε
    radius: Array  # (n,) δ
    compliance: float  # κ
    offset: float  # o

    def with_pair(self, c: int, *, bearing: bool, fn: float, ft: float, open_gap: float) -> PlainState:
        bearings, normal, tangential, gaps = (each.copy() for each in (self.bearing, self.fn, self.ft, self.open_gap))
        bearings[c], normal[c], tangential[c], gaps[c] = bearing, fn, ft, open_gap
        return replace(self, bearing=bearings, fn=normal, ft=tangential, open_gap=gaps)

    def scaled(self, x: float) -> PlainState:
        return replace(self, fn=x * self.fn, ft=x * self.ft, compliance=self.compliance / x)


@dataclass(frozen=True)
class Gaussian:
    """exp(level + slope x − ½ precision x²)."""

    precision: float
    slope: float
    level: float

    @classmethod
    def through(cls, minus_log: Callable[[float], float], step: float = 1.0) -> Gaussian:
        low, middle, high = -minus_log(-step), -minus_log(0.0), -minus_log(step)
        return cls((2.0 * middle - low - high) / step**2, 0.5 * (high - low) / step, middle)

    @property
    def mean(self) -> float:
        return self.slope / self.precision

    @property
    def sd(self) -> float:
        return self.precision**-0.5

    def log_mass(self, *, positive: bool) -> float:
        """Logarithm of the integral over all x, or over x ≥ 0."""
        everywhere = self.level + 0.5 * self.slope * self.mean + 0.5 * math.log(2.0 * math.pi) + math.log(self.sd)
        return everywhere + (float(log_ndtr(self.mean / self.sd)) if positive else 0.0)

    def draw_above(self, uniform: float, low: float) -> float:
        bound = (low - self.mean) / self.sd
        return self.mean + self.sd * float(-ndtri_exp(log_ndtr(-bound) + math.log(uniform)))

    def draw(self, uniform: float) -> float:
        return self.mean + self.sd * standard_normal(uniform)

    def log_ratio(self, x: float, other: float) -> float:
        """Logarithm of the density at one place over that at another."""
        return 0.5 * (((other - self.mean) / self.sd) ** 2 - ((x - self.mean) / self.sd) ** 2)


def standard_normal(uniform: float) -> float:
    return float(-ndtri_exp(math.log(uniform)))


def resultants(pairs: SamplerPairs, grains: SamplerGrains, fn: Array, ft: Array) -> Array:
    """ΣF and ΣM over the mean radius of every grain (m, 3): weight, and the forces at both contact points of a pair."""
    total = np.column_stack([grains.load, np.zeros(len(grains.load))])
    for c in range(len(fn)):
        n = pairs.normal[c]
        force_on_second = fn[c] * n + ft[c] * np.array([-n[1], n[0]])
        for body, arm, force in ((pairs.i[c], n, -force_on_second), (pairs.j[c], -n, force_on_second)):
            if body >= 0:
                lever = grains.lever[body] * arm  # from the centre to the contact point
                total[body] += [*force, lever[0] * force[1] - lever[1] * force[0]]
    return total


@dataclass(frozen=True)
class PlainSampler:
    """Draws of one sweep from the posterior of given pairs, grains and parameters."""

    pairs: SamplerPairs
    grains: SamplerGrains
    model: ModelParameters

    def gap_sd(self, c: int) -> float:
        return math.hypot(self.model.gap_law_sd, self.pairs.gap_sd[c])

    def minus_log_posterior(self, state: PlainState) -> float:
        """The sum that stands in the notes of `gibbs_sweeps`."""
        pairs, grains, model = self.pairs, self.grains, self.model
        count, n = len(pairs.gap), len(grains.radius_sd)
        balance = 0.0
        for weight, (x, y, torque) in zip(
            grains.balance_weight, resultants(pairs, grains, state.fn, state.ft), strict=True
        ):
            balance += 0.5 * weight / model.balance_sd**2 * (x**2 + y**2 + torque**2)
        for g, load in enumerate(grains.group_load):
            balance += 0.5 / model.balance_sd**2 * ((pairs.factor * state.fn)[pairs.group == g].sum() - load) ** 2
        pressures = 0.0
        for k in range(len(grains.pressure)):
            on_grain = (pairs.i == k) | (pairs.j == k)
            pressures += 0.5 * grains.pressure_weight[k] * (state.fn[on_grain].sum() - grains.pressure[k]) ** 2
        laws = 0.0
        for c in range(count):
            i, j, b, f, t = pairs.i[c], pairs.j[c], self.gap_sd(c), state.fn[c], state.ft[c]
            error_j = state.centre[j] if j >= 0 else np.zeros(2)
            h = pairs.gap[c] - state.offset - pairs.normal[c] @ (error_j - state.centre[i]) - state.radius[i % n]
            if j >= 0:
                h -= state.radius[j % n]
            probability = 1.0 / (1.0 + math.exp(-pairs.odds[c]))
            if state.bearing[c]:
                laws += 0.5 * ((h + state.compliance * f) / b) ** 2 + model.force_rate * f - math.log(probability)
                if pairs.friction[c] > 0.0:
                    laws += 0.5 * (t / model.tangential_sd) ** 2
                    laws += math.log(math.sqrt(2.0 * math.pi) * model.tangential_sd)
            else:
                gamma = state.open_gap[c]
                laws += 0.5 * ((h - gamma) / b) ** 2 + gamma / model.mean_open_gap
                laws += math.log(model.mean_open_gap) - math.log1p(-probability)
        errors = 0.5 * float(np.sum((state.centre / grains.centre_sd[:, None]) ** 2))
        errors += 0.5 * float(np.sum((state.radius / grains.radius_sd) ** 2))
        errors += 0.5 * (state.offset / model.offset_sd) ** 2
        errors += 0.5 * ((state.compliance - model.compliance_mean) / model.compliance_sd) ** 2
        z = np.asarray(state.bearing, bool)
        gauge = 0.5 * model.mean_gauge / count * (state.fn[z] - 1.0).sum() ** 2
        gauge += 0.5 * model.count_gauge / count * (z.sum() - model.expected_count) ** 2
        return float(balance + pressures + laws + errors + gauge)

    def draw_contact(self, uniform: Sequence[float], state: PlainState, c: int) -> tuple[PlainState, str]:
        """Draw (z, f, t, γ) of a pair with six uniform numbers; return which branch was followed, too."""
        friction = float(self.pairs.friction[c])

        def law(x: float, kind: str) -> float:
            fn, ft, gap = (x if kind == each else 0.0 for each in ("fn", "ft", "gap"))
            return self.minus_log_posterior(state.with_pair(c, bearing=kind != "gap", fn=fn, ft=ft, open_gap=gap))

        normal = Gaussian.through(lambda x: law(x, "fn"))
        tangential = Gaussian.through(lambda x: law(x, "ft"))
        opened = Gaussian.through(lambda x: law(x, "gap"), step=0.1)
        against = opened.log_mass(positive=True) - normal.log_mass(positive=True)
        if friction > 0.0:
            against -= tangential.log_mass(positive=False) - tangential.level
        was = bool(state.bearing[c]), float(state.fn[c]), float(state.ft[c])
        bearing, fn, ft, branch = False, 0.0, 0.0, "hopeless" if against > CERTAIN else "open"
        if uniform[0] < 1.0 / (1.0 + math.exp(min(against, 200.0))):
            bearing, branch = True, "frictional" if friction > 0.0 else "smooth"
            fn = normal.draw_above(uniform[1], 0.0)
            ft = tangential.draw(uniform[2]) if friction > 0.0 else 0.0
            if abs(ft) > friction * fn:
                (bearing, fn, ft), branch = was, "kept bearing" if was[0] else "kept open"
        if not bearing:
            gap = opened.draw_above(uniform[5], 0.0)
            return state.with_pair(c, bearing=False, fn=0.0, ft=0.0, open_gap=gap), branch
        low = 0.0
        if friction > 0.0:
            other = friction * fn * (2.0 * uniform[3] - 1.0)
            if uniform[4] < math.exp(min(tangential.log_ratio(other, ft), 0.0)):
                ft, branch = other, f"{branch}, moved"
            low = abs(ft) / friction
        fn = normal.draw_above(uniform[5], low)
        return state.with_pair(c, bearing=True, fn=fn, ft=ft, open_gap=0.0), branch

    def draw_block(self, uniform: Array, state: PlainState, rows: Sequence[int]) -> tuple[PlainState, list[str]]:
        """Draw the pairs of a block (−1: absent), all of which see the state before it, with uniform (6, lanes)."""
        before, branches = state, []
        for lane, c in enumerate(rows):
            if c >= 0:
                drawn, branch = self.draw_contact(uniform[:, lane], before, c)
                pair = (each[c] for each in (drawn.bearing, drawn.fn, drawn.ft, drawn.open_gap))
                bearing, fn, ft, gap = pair
                state = state.with_pair(c, bearing=bearing, fn=fn, ft=ft, open_gap=gap)
                branches.append(branch)
        return state, branches

    def draw_errors(self, uniform: Sequence[float], state: PlainState, grain: int) -> PlainState:
        """Draw a radius with the centres of its grain in all frames, from their joint Gaussian."""
        grains = self.grains
        n, frames = len(grains.radius_sd), len(grains.centre_sd) // len(grains.radius_sd)
        rows = [grain + n * k for k in range(frames)]

        def moved(x: Array) -> float:
            radius, centre = state.radius.copy(), state.centre.copy()
            radius[grain], centre[rows] = x[0], x[1:].reshape(-1, 2)
            return self.minus_log_posterior(replace(state, radius=radius, centre=centre))

        normal = [standard_normal(each) for each in uniform]
        precision, slope = quadratic_of(moved, 1 + 2 * frames, step=0.1)
        covariance = np.linalg.inv(precision)
        mean = covariance @ slope
        delta = mean[0] + math.sqrt(covariance[0, 0]) * normal[0]
        radius, centre = state.radius.copy(), state.centre.copy()
        radius[grain] = delta
        for k, row in enumerate(rows):
            part = slice(1 + 2 * k, 3 + 2 * k)
            own = precision[part, part]
            expected = mean[part] - np.linalg.solve(own, precision[part, 0]) * (delta - mean[0])
            factor = np.linalg.cholesky(own)
            centre[row] = expected + np.linalg.solve(factor.T, normal[part])
        return replace(state, radius=radius, centre=centre)

    def draw_common(self, uniform: Sequence[float], state: PlainState) -> PlainState:
        law = Gaussian.through(lambda x: self.minus_log_posterior(replace(state, compliance=x)), step=0.1)
        state = replace(state, compliance=law.draw_above(uniform[0], 0.0))
        law = Gaussian.through(lambda x: self.minus_log_posterior(replace(state, offset=x)), step=0.1)
        return replace(state, offset=law.draw(uniform[1]))

    def draw_scale(self, uniform: Iterator[float], state: PlainState) -> PlainState:
        """Metropolis steps of the logarithm of a factor on all forces; κ f stays."""
        z = np.asarray(state.bearing, bool)
        drawn = z.sum() + (z & (self.pairs.friction > 0.0)).sum() - 1

        def level(log_x: float) -> float:
            return drawn * log_x - self.minus_log_posterior(state.scaled(math.exp(log_x)))

        now, current = 0.0, level(0.0)
        for _ in range(SCALE_STEPS):
            trial = now + standard_normal(next(uniform)) / math.sqrt(abs(drawn) + 1.0)
            tried = level(trial)
            if next(uniform) < math.exp(min(tried - current, 0.0)):
                now, current = trial, tried
        return state.scaled(math.exp(now))


def quadratic_of(minus_log: Callable[[Array], float], count: int, step: float) -> tuple[Array, Array]:
    """Precision P (k, k) and slope s (k,) of a quadratic ½ xᵀ P x − sᵀ x + constant."""
    unit = step * np.eye(count)
    middle = minus_log(np.zeros(count))
    high, low = ([minus_log(sign * each) for each in unit] for sign in (1.0, -1.0))
    precision = np.diag([(high[a] + low[a] - 2.0 * middle) / step**2 for a in range(count)])
    for a in range(count):
        for b in range(a):
            both = minus_log(unit[a] + unit[b]) - high[a] - high[b] + middle
            precision[a, b] = precision[b, a] = both / step**2
    return precision, np.array([(low[a] - high[a]) / (2.0 * step) for a in range(count)])


def plain_touching(
    gap: Array, mean: Array, reach: Array, s: float, fraction: Array
) -> tuple[float, Array, Array, Array]:
    """Log likelihood of gaps (f, c), P(touch) (f, c), and the sums over frames (3, c) and over pairs (f,)."""
    from scipy.stats import norm

    touch, by_pair, likelihood = np.zeros(gap.shape), np.zeros((3, len(mean))), 0.0
    for f, c in np.argwhere(np.isfinite(gap)):
        rest = gap[f, c] - mean[c]
        touching = fraction[f] * norm.pdf(rest, scale=s)
        opened = norm.cdf(rest, scale=s) - norm.cdf(rest - reach[c], scale=s)
        density = touching + (1.0 - fraction[f]) * opened / max(reach[c], s)
        likelihood += math.log(density)
        touch[f, c] = touching / density
        by_pair[:, c] += touch[f, c] * np.array([1.0, rest, rest**2])
    return likelihood, touch, by_pair, touch.sum(axis=1)
