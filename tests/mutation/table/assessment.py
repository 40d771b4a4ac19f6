"""Status, trust and intervals."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/assessment"
STATUS = f"{TESTS}/test_status.py"
PENALTIES = f"{TESTS}/test_penalties.py"
MIXING = "tests/solver/mixture/test_field_mixing.py"
MIXTURE_TRUST = (f"{TESTS}/test_mixture_trust.py", MIXING)
FORCE_INTERVALS = f"{TESTS}/test_force_intervals.py"
EXPECTED = f"{TESTS}/test_expected_correlation.py"
OUTLIERS = "tests/app/inference/test_outliers.py"

MUTANTS = [
    *mutants_of(
        "solver/assessment/fitted.toml",
        STATUS,
        ("single_chain_correction = [0.95, 0.8]", "single_chain_correction = [0.5, 0.8]"),
        ("single_chain_reach = 4.45", "single_chain_reach = 0.0"),
        ("inferred_penalty = 1.0", "inferred_penalty = 2.0"),
        ("\nnormal = [0.003, 0.088, 0.985]", "\nnormal = [0.003, 0.088, 0.5]"),
        ("\ntangential = [0.001, 0.008, 1.206]", "\ntangential = [0.001, 0.008, 0.6]"),
        ("\nsingle_chain = [0.071, 0.239]", "\nsingle_chain = [0.071, 0.039]"),
        ("rearranging_residual = 0.037", "rearranging_residual = 0.37"),
    ),
    *mutants_of(
        "solver/assessment/status.py",
        STATUS,
        ("SUSPECT_CORRECTION = 0.25", "SUSPECT_CORRECTION = 2.5"),
        ("LOAD_FRACTIONS = (0.62, 2.5)", "LOAD_FRACTIONS = (0.062, 25.0)"),
        ("** 1.5, 0.4, 4.0))", "** 1.0, 0.4, 4.0))"),
        ("SETTLING_FRAMES = 2", "SETTLING_FRAMES = 5"),
        ("if evidence.force_change > NEW_FORCES:", "if False:"),
        ("if math.isnan(evidence.correction):\n", "if False:\n"),
    ),
    *mutants_of(
        "solver/assessment/intervals/formula_sd.py",
        STATUS,
        ("a**2 + b**2 * np.maximum(fn, 0.0) / mean", "a**2 + b**2 * (np.maximum(fn, 0.0) / mean) ** 2"),
        ("return friction * normal_sd(fn)", "return normal_sd(fn)"),
    ),
    *mutants_of(
        "solver/assessment/trust.py",
        STATUS,
        ("* (1.0 - evidence.hidden_fraction)", "* 1.0"),
        ("trust *= 1.0 - evidence.unseen_fraction", "pass"),
        ("return INFERRED_PENALTY * evidence.inferred", "return 0.0 * evidence.inferred"),
        ("if not evidence.assessed:", "if False:"),
        ("bound = 1.0 - loss - CHAIN_REACH", "bound = 1.0 + loss - CHAIN_REACH"),
    ),
    *mutants_of(
        "solver/assessment/expected_correlation.py",
        (EXPECTED, PENALTIES),
        ("lambda e: 1.0 - e.agreement", "lambda e: e.agreement"),
        ("1.0 - float(np.fmax(e.agreement, e.overlap_agreement))", "1.0 - e.agreement"),
        ("margin + slope * max(start - score, 0.0)", "margin"),
        ("math.tanh(score - _margin(score, table))", "math.tanh(score + _margin(score, table))"),
        ('np.log(table["at"])', 'np.asarray(table["at"])'),
        ('"motion" if math.isnan(evidence.agreement) else "both"', '"both"'),
        ("    if math.isnan(measure):\n        return 0.0\n", ""),
        ('float(each["value"][0]) - _term', 'float(each["value"][-1]) - _term'),
    ),
    *mutants_of(
        "solver/assessment/mixture_trust.py",
        MIXTURE_TRUST,
        ("sure * (1.0 - MEAN_ERROR_FRACTION)", "sure * MEAN_ERROR_FRACTION"),
        ("(reliability - LOW) / (SOUND - LOW)", "reliability / SOUND"),
        ("logarithm(1.0 - evidence.position_agreement", "-logarithm(1.0 - evidence.position_agreement"),
        ("math.log(min(max(default if math.isnan(value) else value, low), high))", "math.log(max(value, 1e-9))"),
        ("a * evidence.disagreement**p", "a * evidence.disagreement"),
        ("if not evidence.assessed or math.isnan(evidence.correction)", "if math.isnan(evidence.correction)"),
    ),
    *mutants_of(
        "app/inference/correction/outliers.py",
        OUTLIERS,
        ("(1.0 if last else 0.5)", "1.0"),
        ("< 2.0 * RETURN * deviation", "< np.inf"),
        ("JUMP = 6.0", "JUMP = 80.0"),
        ("change > PENETRATION * deviation[rows]", "change > -1.0"),
        ("ONE_SIDED * least if last else least", "least"),
        ("if jumps.mean() <= MOST:", "if True:"),
        ("middle[rows] + np.nanmedian", "middle[rows] + 0.0 * np.nanmedian"),
        ("0.5 * (tracks.rotation[k - 1, rows] + later[rows])", "later[rows]"),
        ("step[known] - np.median(step[near], axis=1)", "step[known]"),
    ),
    *mutants_of(
        "solver/assessment/penalties.py",
        PENALTIES,
        ("if not each.counted:", "if each.counted:"),
        ("check.measured, 1.0 / COVERAGE_FACTOR)", "check.measured, 1.0)"),
        ("BEYOND_WALL_LOSS * beyond / max(evidence.grains, 1)", "BEYOND_WALL_LOSS * beyond / 100.0"),
        ("check.measured, 1.0 - frame.position_weight\n", "check.measured, 1.0\n"),
        ("if evidence.shear > COARSE_STEP else", "if True else"),
        ("kept * expected, kept * bound", "expected, kept * bound"),
    ),
    *mutants_of(
        "solver/assessment/mixture_trust.py",
        MIXTURE_TRUST,
        ("trust**2 / (1.0 - trust**2)", "trust / (1.0 - trust)"),
        ("motion *= weight", "posterior *= weight"),
        ("2.0 * one * two * both", "one * two * both"),
        ("common + motion_trust * (posterior_trust - common)", "posterior_trust"),
        ("min(claimed, common / max(motion_trust, 1e-6))", "min(claimed, common)"),
        ("np.clip(max(motion_trust, common), 0.0, MAX_TRUST)", "np.clip(motion_trust, 0.0, MAX_TRUST)"),
        ("- weight**2 * (1.0 - second)", "- weight * (1.0 - second)"),
        ("(1.0 - weight) * min(positions, greatest)", "(1.0 - weight) * greatest"),
        ("    if not scale_known:\n        return reliability\n", ""),
    ),
    *mutants_of(
        "solver/assessment/intervals/force_intervals.py",
        FORCE_INTERVALS,
        ("np.sqrt(unloaded + scale**2)", "np.sqrt(nothing + scale)"),
        ("size ** (1.0 + POWER", "size ** (1.0 - POWER"),
        ("(HIGH_FRICTION if measured < given else 1.0)", "(HIGH_FRICTION if measured > given else 1.0)"),
        ("np.hypot(frame.ft_sd, measured * tangent)", "np.hypot(frame.ft_sd, tangent)"),
        ("frame.trust / (1.0 - hidden)", "frame.trust"),
        ("fraction * abs(math.log(measured / given))", "abs(math.log(measured / given))"),
        ("group[frame.contacts.with_wall] = Group.WALL", "pass"),
        ("FACTOR[source][groups_of(frame)]", "FACTOR[source][groups_of(frame)][:, ::-1]"),
        ("MAX_PENALTY_BY_SOURCE = (0.1, MAX_PENALTY", "MAX_PENALTY_BY_SOURCE = (MAX_PENALTY, 0.1"),
        ("sd[formula == 0] = 0.0", "pass"),
    ),
    *mutants_of(
        "solver/assessment/fitted.toml",
        FORCE_INTERVALS,
        (
            "    [[0.54, 0.53], [0.52, 0.62], [0.48, 0.68],",
            "    [[0.54, 0.53], [0.48, 0.68], [0.52, 0.62],",
        ),
        (
            "[[5.37, 4.28], [0, 0], [0.04, 0.04], [0, 0]]",
            "[[0, 0], [5.37, 4.28], [0.04, 0.04], [0, 0]]",
        ),
        ("power = [[-0.09, -0.18]", "power = [[0.09, 0.18]"),
    ),
    *mutants_of(
        "solver/assessment/intervals/statistic_intervals.py",
        f"{TESTS}/test_statistic_intervals.py",
        ("float(np.sqrt(max(float(penalty_of(trust)), MIN_PENALTY)))", "max(float(penalty_of(trust)), MIN_PENALTY)"),
        ("if scale_is_known or name not in SIZED", "if True"),
        ("excess * error * size_of(name, float(getattr(statistics, name)))", "excess * error"),
        ("return abs(value) if name in RELATIVE else 1.0", "return abs(value)"),
        ("abs(math.log(measured / given)) if given > 0", "abs(measured - given) if given > 0"),
    ),
    *mutants_of(
        "solver/assessment/fitted.toml",
        f"{TESTS}/test_statistic_intervals.py",
        ("\npressure = [0.097, 0.15, 0.51]", "\npressure = [0.51, 0.15, 0.097]"),
        ("\nmean_fn = 0.23", "\nmean_fn = 0.023"),
    ),
    *mutants_of(
        "solver/assessment/motion_information.py",
        f"{TESTS}/test_motion_information.py",
        (
            "np.where(contacts.with_wall[bearing], 2.0, 8.0**0.5)",
            "np.where(contacts.with_wall[bearing], 8.0**0.5, 2.0)",
        ),
        ("np.mean(slide_sd**2) - 1.0", "np.mean(slide_sd**2)"),
        ("max(variance - expected, 0.0)", "variance"),
        ("after - motion.interval * moving.velocity", "after - moving.velocity"),
        ("(beside & (out > 0.0)).any(axis=1)", "(out > 0.0).any(axis=1)"),
        ("strong = fn > STRONG * fn[bearing].mean()", "strong = fn > STRONG * fn[bearing].mean() * 0.0"),
    ),
]
