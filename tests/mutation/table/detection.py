"""Who does touch, inferred from many photographs."""

from tests.mutation.mutant import mutants_of

KERNELS = ("tests/reference/test_detection.py", "tests/solver/detection/test_touch_probability.py")
PROBABILITY = ("tests/reference/test_detection.py", "tests/solver/detection/test_touch_probability.py")
DETECTION = "tests/solver/detection"

MUTANTS = [
    *mutants_of(
        "solver/detection/touch_probability_kernels.py",
        KERNELS,
        ("0.5 * z * z, farthest", "z * z, farthest"),
        ("min(max(measured, lowest * s), state_gap[states - 1])", "min(measured, state_gap[states - 1])"),
        ("alpha[f, r] *= emission[f, r]", "alpha[f, r] *= 1.0"),
        ("b = beta[0, r] * emission[f + 1, r]", "b = beta[0, r] * emission[f, r]"),
        ("step, before = transition[f - 1], alpha[f - 1]", "step, before = transition[0], alpha[f - 1]"),
        ("s2 = (s1 + value[k - 1]) * d2", "s2 = s1 * d2 + value[k - 1]"),
        ("above * d3 + s3", "s3"),
        ("(below + value[states - k]) * decay[states - k]", "below * decay[states - k] + value[states - k]"),
        ("touch[f, c] = alpha[f, 0] * beta[1, 0] / evidence", "touch[f, c] = alpha[f, 0]"),
        ("alpha[0, q] = start[q] * emission[0, q]", "alpha[0, q] = emission[0, q]"),
        ("state_variance[q] / (state_variance[q] + error)", "error / (state_variance[q] + error)"),
        (
            "second += weight * (middle * middle + state_variance[q] * (1.0 - gain))",
            "second += weight * middle * middle",
        ),
    ),
    *mutants_of(
        "solver/detection/touch_probability.py",
        PROBABILITY,
        ("STAY = 0.95", "STAY = 0.5"),
        ("rows[CLOSES, 1:] = 0.5 * np.exp(-state_gap[1:] / scale)", "rows[CLOSES, 1:] = 0.0"),
        ("gap + 0.5 * settings.overlap, sigma, LOWEST_GAP", "gap, sigma, LOWEST_GAP"),
        ("variance[i] + np.where(wall, 0.0, variance[partner])", "variance[i] + variance[partner]"),
        (
            "range(max(frame - BACK, 0), min(frame + AHEAD + 1, frame_count))",
            "range(max(frame - BACK, 0), min(frame + AHEAD, frame_count))",
        ),
        ("rows[OPENS, 1:] = (1.0 - STAY) * opened / opened.sum()", "rows[OPENS, 1:] = (1.0 - STAY) / len(opened)"),
        ("settings.margin + 3.0 * settings.radius_sd", "3.0 * settings.radius_sd"),
        ("keep = (touch > settings.least) & there", "keep = there"),
    ),
    *mutants_of(
        "solver/detection/refinement.py",
        "tests/solver/detection/test_refinement.py",
        ("DAMPING = 0.7", "DAMPING = -0.7"),
        ("total += moved + grains * each**2", "total += moved"),
        ("touch[keep]\n", "touch[keep] ** 2\n"),
    ),
    *mutants_of(
        "solver/detection/position_network.py",
        "tests/solver/detection/test_position_network.py",
        ("right[XY * i + a] -= force[c]", "right[XY * i + a] += force[c]"),
        ("inverse[partner + XY * a + b] - 2.0 * inverse[cross", "inverse[partner + XY * a + b] + 2.0 * inverse[cross"),
        ("blocks[4 * springs.entry[c] + XY * a + b] -= value", "blocks[4 * springs.entry[c] + XY * a + b] += value"),
        ("precision[pattern.place] = sigma**-2.0", "precision[:] = sigma**-2.0"),
        ("known = np.isfinite(gap)", "known = np.isfinite(weight)"),
    ),
    *mutants_of(
        "solver/detection/displacement.py",
        "tests/solver/detection/test_displacement.py",
        ("noise = 2.0 * (variance.mean()", "noise = 0.0 * (variance.mean()"),
        ("motion[f] @ motion[last] < 0.0", "motion[f] @ motion[last] > 0.0"),
        ("wall_displacement(*endpoints, walls.side", "-wall_displacement(*endpoints, walls.side"),
        ("lowest = int(before[-1]) if len(before) else 0", "lowest = 0"),
    ),
    *mutants_of(
        "solver/detection/contact_networks.py",
        DETECTION,
        ("np.maximum(0.0, np.log10(SURE / touch[keep]))", "np.maximum(0.0, np.log(SURE / touch[keep]))"),
        ("touch = (1.0 - fraction) * start + fraction * end", "touch = end + 0.0 * start"),
        (
            "keep = (touch > LEAST) & are_present(key, state.present, grains.count + walls.count)",
            "keep = touch > LEAST",
        ),
        ("SURE = 0.3", "SURE = 0.9"),
        ("key = join_keys(self.start.key, self.end.key)", "key = self.end.key"),
    ),
    *mutants_of(
        "solver/detection/precision.py",
        "tests/solver/detection/test_precision.py",
        ("/ np.sqrt(12.0)", "/ np.sqrt(6.0)"),
        ("np.mean(mean**2) - 2.0 / 3.0 * sigma**2", "np.mean(mean**2)"),
        ("1.0 / CONTRADICTION <= factor <= CONTRADICTION", "factor <= CONTRADICTION"),
    ),
]
