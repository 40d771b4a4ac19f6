"""The mixture of the motion estimate and the position-only estimate."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/mixture"

MUTANTS = [
    *mutants_of(
        "solver/sequence/boundary_load.py",
        "tests/solver/sequence/test_boundary_load.py",
        ("along[second & ~first].sum()", "0.0"),
        ("- along[first & ~second].sum()", ""),
        ("if boundary is None or len(loaded) != 1 or any", "if boundary is None or any"),
        ("or any(packing.material.gravity):", "or False:"),
        (" or radius[at_plate].sum() < GLUED * radius[beside].sum()", ""),
    ),
    *mutants_of(
        "solver/mixture/frame_mixture.py",
        f"{TESTS}/test_frame_mixture.py",
        ("force, factor = force / factor, 1.0", "force, factor = force, factor"),
        ("own + weight * (1.0 - weight) * (one - two) ** 2", "own"),
        ("force * factor ** (weight - 1.0)", "force * factor**weight"),
        ("motion.fn.sum() / placed[0].sum()", "placed[0].sum() / motion.fn.sum()"),
        ("0.0 if np.isnan(motion_trust) else softness.motion_weight", "softness.motion_weight"),
        ("(overlap / (HALF_WEIGHT_OVERLAP * moved)) ** 2", "overlap / (HALF_WEIGHT_OVERLAP * moved)"),
        ("_mixture_sd(u, motion.ft, factor * other.ft,", "_mixture_sd(u, motion.ft, other.ft,"),
        ("(1.0 - weight) * one_sd**2 + weight * two_sd**2", "weight * one_sd**2 + (1.0 - weight) * two_sd**2"),
    ),
    *mutants_of(
        "solver/mixture/field_mixing.py",
        f"{TESTS}/test_field_mixing.py",
        (
            "position_weight * placed + (1.0 - position_weight) * moved",
            "position_weight * moved + (1.0 - position_weight) * placed",
        ),
        ("totals[0] * mixed", "totals[1] * mixed"),
        (
            "min(posterior.trust, posterior.agreement if np.isfinite(posterior.agreement) else 1.0)",
            "posterior.trust",
        ),
        ("reconcile_trusts(weight * expected, claimed", "reconcile_trusts(weight * motion.trust, claimed"),
        ("motion.force / totals[0], posterior", "motion.force, posterior"),
    ),
    *mutants_of(
        "solver/mixture/equilibrium_projection.py",
        f"{TESTS}/test_equilibrium_projection.py",
        ("price = factor * settings.balance", "price = settings.balance / factor"),
        ("fn) <= limit * sd:", "fn) <= 0.0 * sd:"),
        ("    if not soft:\n", "    if True:\n"),
        ("<= MAX_CHANGE_EXACT * sd", "<= np.inf"),
        (" and _residual(balance, found) <= MAX_RESIDUAL", ""),
        ("fn) <= MAX_CHANGE * sd:", "fn) <= 0.0 * sd:"),
        ("        price = EXACT * settings.balance\n", "        price = settings.balance\n"),
        ("MAX_CHANGE_SOFT if soft else", "MAX_CHANGE_RELAXED if soft else"),
        ("share = min((total - reached) / change, 1.0)", "share = 1.0"),
        ("reached + wanted.weight * (wanted.total - reached)", "wanted.total"),
        ("found.ft + share * (other.ft - found.ft)", "found.ft"),
        ("change * (total - reached) > 0.0", "True"),
    ),
    *mutants_of(
        "solver/mixture/stress_matching.py",
        f"{TESTS}/test_stress_matching.py",
        ("np.sqrt(np.maximum(amplitude", "(np.maximum(amplitude"),
        ("2.0 * np.arctan2", "np.arctan2"),
        ("0.5 * (tensor[0, 1] + tensor[1, 0])", "0.0"),
    ),
    *mutants_of(
        "solver/mixture/field_mixing.py",
        f"{TESTS}/test_stress_matching.py",
        ("pearson(moved[:, 0], both[:, 0])", "pearson(moved[:, 0], both[:, 2])"),
    ),
    *mutants_of(
        "solver/mixture/equilibrium_mixture.py",
        "tests/solver/sequence/test_mixed_total.py",
        ("motion_weight = 1.0 - mixture.position_weight", "motion_weight = mixture.position_weight"),
        ("stress_factor=factor**motion_weight", "stress_factor=None"),
        ("if not frame.has_weight:", "if frame.has_weight:"),
    ),
    *mutants_of(
        "solver/sequence/estimate.py",
        "tests/solver/sequence/test_frames.py",
        ("(state.pressure, state.sound_pressure) if load > 0 else ()", "(state.pressure, state.sound_pressure)"),
    ),
    *mutants_of(
        "solver/sequence/estimate.py",
        "tests/solver/sequence/test_mixed_total.py",
        ("weight = evident_position_weight(evidence) if hard else None", "weight = None"),
        ("hard = not (problem.settings.soft or", "hard = not ("),
        ("loaded=packing.is_loaded,", ""),
    ),
    *mutants_of(
        "app/study/scenarios/mixture_fit.py",
        "tests/app/study/test_mixture_fit.py",
        ("best - r + PRICE", "r - best + PRICE"),
        ("found[0] -= found[1:] @ middle[1:]", "found[0] -= 0.0"),
        ("+ PRICE_NEW * float(worse.mean())", "+ 0.0 * float(worse.mean())"),
    ),
    *mutants_of(
        "solver/mixture/soft_grains.py",
        f"{TESTS}/test_soft_grains.py",
        ("-evidence.touching.offset, evidence", "evidence.touching.offset, evidence"),
        ("sd > MIN_SD * 2.0**0.5 * found.sigma and", ""),
        ("and fraction_of_pairs(evidence) >= LEAST_OF_PAIRS", ""),
        ("else (0.0, scattered)", "else (0.0, False)"),
        ("(j < count) & (gap < 0.0)", "j < count"),
        ("if spare < FEWEST_PAIRS:", "if False:"),
    ),
]
