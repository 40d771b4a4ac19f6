"""Frames in order, the mean of the members, trust and status."""

from tests.mutation.mutant import mutants_of

JUDGEMENT = ("tests/solver/sequence/test_judgement.py", "tests/golden/test_forces.py")
FRAMES = ("tests/golden/test_forces.py", "tests/solver/sequence")

MUTANTS = [
    *mutants_of(
        "solver/sequence",
        JUDGEMENT,
        ("TRUST_DISAGREEMENT = (0.83, 2.65)", "TRUST_DISAGREEMENT = (0.53, 2.65)"),
        ("TRUST_CORRECTION = (0.42, 0.73)", "TRUST_CORRECTION = (0.42, 1.73)"),
        ("CHAIN_CORRECTION = (0.95, 0.8)", "CHAIN_CORRECTION = (0.5, 0.8)"),
        ("CHAIN_REACH = 4.45", "CHAIN_REACH = 0.0"),
        ("HOLE_DOUBT = 6.0", "HOLE_DOUBT = 1.0"),
        ("NORMAL_DEVIATION = (0.003, 0.088, 0.985)", "NORMAL_DEVIATION = (0.003, 0.088, 0.5)"),
        ("TANGENT_DEVIATION = (0.001, 0.008, 1.206)", "TANGENT_DEVIATION = (0.001, 0.008, 0.6)"),
        ("CHAIN_DEVIATION = (0.071, 0.239)", "CHAIN_DEVIATION = (0.071, 0.039)"),
        ("SUSPECT_CORRECTION = 0.25", "SUSPECT_CORRECTION = 2.5"),
        ("LOAD_SHARES = (0.62, 2.5)", "LOAD_SHARES = (0.062, 25.0)"),
        ("** 1.5, 0.4, 4.0))", "** 1.0, 0.4, 4.0))"),
        ("REARRANGING_UNBALANCE = 0.037", "REARRANGING_UNBALANCE = 0.37"),
        ("SETTLING_FRAMES = 2", "SETTLING_FRAMES = 5"),
        ("if evidence.force_change > NEW_FORCES:", "if False:"),
        ("a**2 + b**2 * np.maximum(fn, 0.0) / mean", "a**2 + b**2 * (np.maximum(fn, 0.0) / mean) ** 2"),
    ),
    *mutants_of(
        "solver/sequence",
        ("tests/solver/sequence/test_doubts.py",),
        ("return min(bound, SUSPECT_TRUST)", "return min(bound, 1.0)"),
        ("if not each.counted:", "if each.counted:"),
        ("* _motion_share(evidence) ** 2", "* 1.0"),
    ),
    *mutants_of(
        "solver/sequence",
        ("tests/solver/sequence/test_demand.py",),
        ("known = join_keys(contacts.key, problem.verdicts.forbidden)", "known = contacts.key"),
        ("if not asked[row] > least:", "if True:"),
        ("source[demanded] = ContactSource.DEMANDED", "pass"),
    ),
    *mutants_of(
        "solver/convex/prices.py",
        ("tests/solver/convex/test_prices.py",),
        ("velocity[pairs.i] - velocity[pairs.j]", "velocity[pairs.j] - velocity[pairs.i]"),
        ("velocity[n + plates] = ", "velocity[n + plates] = 0.0 * "),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("NEGLIGIBLE_KAPPA = 1e-5", "NEGLIGIBLE_KAPPA = 1e5"),
        ("state.age, fill=-1) + np.int32(1)", "state.age, fill=0) + np.int32(1)"),
        ("np.where(people_saw, 1.0, estimate.probability)", "estimate.probability"),
        ("step.solution.mean_unbalance / step.kappa", "step.solution.unbalance / step.kappa"),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("stiffer: float = 2.0", "stiffer: float = 4.0"),
        ("motion.spans and not state.start_forgotten", "motion.spans"),
        ("np.average(members.force, axis=0, weights=members.worth)", "np.average(members.force, axis=0)"),
        (
            "are_among(contacts.key, verdicts.forced), 1.0, told)",
            "are_among(contacts.key, verdicts.forced), told, told)",
        ),
        (
            "return np.sqrt(np.average((member - mean) ** 2, axis=0, weights=worth))",
            "return np.average(np.abs(member - mean), axis=0, weights=worth)",
        ),
        (
            "former = (state.last, state.ahead, state.around, state.wide, state.steady)",
            "former = (state.last, state.last, state.last, state.last, state.last)",
        ),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("keep = are_there(contacts.key, ~bridged, contacts.body_count)", "keep = ~bridged[contacts.i]"),
        ("* (1.0 - evidence.hidden_share)", "* 1.0"),
        ("known.mean() > GROSS_UNBALANCE", "known.mean() > 100.0"),
        ("if seen < FEWEST_SEEN * known or seen == 0:", "if seen < 0:"),
        ("following = forget_forces(state)", "following = state"),
        ("if math.isnan(evidence.correction):\n", "if False:\n"),
    ),
]
