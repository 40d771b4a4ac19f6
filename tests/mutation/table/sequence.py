"""Frames in order and the mean of the ensemble members."""

from tests.mutation.mutant import mutants_of

FRAMES = ("tests/golden/test_forces.py", "tests/solver/sequence")

MUTANTS = [
    *mutants_of(
        "solver/sequence",
        ("tests/solver/sequence/test_missing_contacts.py",),
        ("known, ensemble = join_keys(contacts.key, problem.verdicts.forbidden),", "known, ensemble = contacts.key,"),
        ("source[missing] = ContactSource.FROM_BALANCE", "pass"),
    ),
    *mutants_of(
        "solver/convex/dual_prices.py",
        ("tests/solver/convex/test_dual_prices.py", "tests/solver/sequence/test_missing_contacts.py"),
        ("velocity[pairs.i] - velocity[pairs.j]", "velocity[pairs.j] - velocity[pairs.i]"),
        ("velocity[n + plates] = ", "velocity[n + plates] = 0.0 * "),
        ("if not price[row] > least:", "if True:"),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("NEGLIGIBLE_KAPPA = 1e-5", "NEGLIGIBLE_KAPPA = 1e5"),
        ("state.age, fill=-1) + np.int32(1)", "state.age, fill=0) + np.int32(1)"),
        ("np.where(reviewed, 1.0, estimate.probability)", "estimate.probability"),
        ("step.solution.mean_unbalance / step.kappa", "step.solution.unbalance / step.kappa"),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("stiffer: float = 2.0", "stiffer: float = 4.0"),
        ("motion.ends_here and not state.start_forgotten", "motion.ends_here"),
        ("sweeps=round(reached * chain.sweeps)", "sweeps=chain.sweeps"),
        ("state.moved or problem.motion.ends_here,", "True,"),
        ("np.average(members.force, axis=0, weights=members.weight)", "np.average(members.force, axis=0)"),
        (
            "np.where(are_among(contacts.key, verdicts.forced), 1.0, probability_detected)",
            "probability_detected",
        ),
        (
            "return np.sqrt(np.average((member - mean) ** 2, axis=0, weights=weight))",
            "return np.average(np.abs(member - mean), axis=0, weights=weight)",
        ),
        (
            "former = (state.last, state.ahead, state.around, state.wide, state.steady)",
            "former = (state.last, state.last, state.last, state.last, state.last)",
        ),
    ),
    *mutants_of(
        "solver/sequence",
        FRAMES,
        ("keep = are_present(contacts.key, ~bridged, contacts.body_count)", "keep = ~bridged[contacts.i]"),
        ("known.mean() > GROSS_UNBALANCE", "known.mean() > 100.0"),
        ("if seen < FEWEST_SEEN * known or seen == 0:", "if seen < 0:"),
        ("following = forget_forces(history.last)", "following = history.last"),
    ),
    *mutants_of(
        "solver/sequence/frame.py",
        "tests/solver/sequence/test_open_scale.py",
        ("if problem.scale_is_open and mean > 0.0:", "if False:"),
        ("if problem.scale_is_open and mean > 0.0:", "if mean > 0.0:"),
    ),
    *mutants_of(
        "solver/frame_forces.py",
        "tests/solver/sequence/test_open_scale.py",
        ("fn=np.float32(factor) * self.history.fn", "fn=self.history.fn"),
        ("nlgs_fn=factor * self.nlgs_fn", "nlgs_fn=self.nlgs_fn"),
    ),
]
