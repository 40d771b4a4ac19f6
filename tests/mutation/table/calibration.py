"""Constant errors of centres, radii, walls and scale."""

from tests.mutation.mutant import mutants_of

CALIBRATE = ("tests/solver/calibration/test_equations.py", "tests/solver/calibration/test_calibrate.py")
SCALE = "tests/solver/calibration/test_scale.py"

MUTANTS = [
    *mutants_of(
        "solver/calibration/equations.py",
        CALIBRATE,
        ("other[c, 0] = cosine", "other[c, 0] = -cosine"),
        ("own[c, 2] = -1.0", "own[c, 2] = 1.0"),
        ("        if j != i:\n            other[c, 0]", "        if True:\n            other[c, 0]"),
        ("self._cosine[k], self._sine[k]", "self._cosine[: len(k)], self._sine[: len(k)]"),
        ("-geometry.along[wall]", "geometry.along[wall]"),
        (
            "[c * offset[:, 0] - s * offset[:, 1], s * offset[:, 0]",
            "[c * offset[:, 0] + s * offset[:, 1], s * offset[:, 0]",
        ),
        ("np.sum(place**2, axis=2, keepdims=True) * place", "place"),
        ("np.stack([outward + half, outward - half], axis=-1)", "np.stack([outward - half, outward + half], axis=-1)"),
    ),
    *mutants_of(
        "solver/calibration/gaps.py",
        ("tests/solver/calibration/test_gaps.py", *CALIBRATE, SCALE),
        ("gap[c] = distance - radius[i] - radius[j]", "gap[c] = distance - radius[i]"),
        ("endpoints[kw, w].mean(axis=1)", "endpoints[kw, w, 0]"),
    ),
    *mutants_of(
        "solver/calibration/normal_equations.py",
        "tests/solver/calibration/test_normal_equations.py",
        ("x * other[c, b] if i > j else y * own[c, b]", "x * other[c, b]"),
        ("corner - solved @ border", "corner + solved @ border"),
        ("shared - self._solved @ flat", "shared"),
    ),
    *mutants_of(
        "solver/calibration/gap_error_draws.py",
        "tests/solver/calibration/test_gap_error_draws.py",
        ("error[c] += sigma[j]", "error[c] -= sigma[j]"),
        ("if j != i:", "if True:"),
    ),
    *mutants_of(
        "solver/calibration/priors.py",
        CALIBRATE,
        ("fraction = min(1.0, ratio)", "fraction = 1.0"),
        ("np.sqrt(first**2 + second**2 + finest**2)", "np.sqrt(first**2 + finest**2)"),
    ),
    *mutants_of(
        "solver/calibration/gap_statistics.py",
        CALIBRATE,
        ("1.0 - after / before if before > 0.0 else 0.0", "1.0 - before / after if after > 0.0 else 0.0"),
        ("deep = gap + overlap < -IMPOSSIBLE * candidates.noise", "deep = gap + overlap < 0.0 * candidates.noise"),
    ),
    *mutants_of(
        "solver/calibration/calibrate.py",
        CALIBRATE,
        ("self.noise_factor * sigma, self.gap_sd / np.sqrt(2.0)", "self.noise_factor * sigma, 0.0"),
        ("MIN_GAIN = 0.1", "MIN_GAIN = -10.0"),
        ("MISJUDGED_NOISE = 2.0", "MISJUDGED_NOISE = 2000.0"),
    ),
    *mutants_of(
        "solver/calibration/scale.py",
        SCALE,
        ("target = -peaks.excess", "target = peaks.excess"),
        ("place + overlap, width / np.sqrt(pairs)", "place, width / np.sqrt(pairs)"),
        ("MIN_LIKELIHOOD_GAIN = 20.0", "MIN_LIKELIHOOD_GAIN = -20.0"),
    ),
    *mutants_of(
        "solver/calibration/scale.py",
        SCALE,
        ("matrix[:, 1] = -2.0", "matrix[:, 1] = -1.0"),
        ("matrix[:, 0] = peaks.distance", "matrix[:, 0] = -peaks.distance"),
        ("return follow < stay", "return follow > stay"),
        ("* radius + self.radius_offset + of_class", "* radius - self.radius_offset + of_class"),
        ("limit * np.maximum(np.abs(errors), NEGLIGIBLE * limit)", "limit**2"),
    ),
    *mutants_of(
        "solver/calibration/fit.py",
        "tests/solver/calibration/test_calibrate.py",
        ("self._matrix.times(unknowns) - residual", "self._matrix.times(unknowns) + residual"),
        ("penalty = self._prior_sd**-2.0", "penalty = self._prior_sd**-1.0"),
        ("self._shift = weighting_bias(", "self._shift = -weighting_bias("),
        ("annealed = number / ANNEALING_ROUNDS", "annealed = 1.0"),
    ),
    *mutants_of(
        "solver/calibration/priors.py",
        "tests/solver/calibration/test_calibrate.py",
        ("+ np.mean(drawn**2)", ""),
        ("np.repeat(_centre_prior(equations.sequence, priors), 2)", "priors.centre"),
        ("near = gap < REACH * start + REACH_OF_NOISE * noise", "near = gap < 0.0"),
        ("WIDEST_CENTRE = 0.1", "WIDEST_CENTRE = 0.0"),
        ("max(1.0, excess / stated)", "1.0"),
    ),
    *mutants_of(
        "solver/calibration/weights.py",
        "tests/solver/calibration/test_weights.py",
        ("return -sigma * np.interp", "return sigma * np.interp"),
        ("np.median(depth)) / NORMAL_MEDIAN", "np.median(depth)) * NORMAL_MEDIAN"),
        ("** -2.0\n", "** -1.0\n"),
    ),
    *mutants_of(
        "solver/calibration/grain_errors.py",
        "tests/solver/calibration/test_grain_errors.py",
        ("value=force[:, None] / unit", "value=-force[:, None] / unit"),
        ("float(step.found[-1]) / unit", "float(step.found[-1])"),
        ("self.matrix.transposed_times(self.precision * each) + root", "root"),
        ("np.hypot(sequence.sigma[rows.frame, rows.i], second)", "second"),
    ),
    *mutants_of(
        "solver/calibration/equations.py",
        CALIBRATE,
        ("column[wall, 2], value[wall, 2] = met, 1.0", "column[wall, 2], value[wall, 2] = met, -1.0"),
        ("end - self._distortion[k, rows.i]", "end + self._distortion[k, rows.i]"),
        ("geometry.normal, end - position[k, rows.i]", "geometry.normal, position[k, rows.i] - end"),
        (
            "column[:, 0], column[:, 2] = of_class[i], of_class[grain]",
            "column[:, 0], column[:, 2] = of_class[grain], of_class[grain]",
        ),
    ),
    *mutants_of(
        "solver/boundary/exchanged_sizes.py",
        "tests/solver/boundary/test_exchanged_sizes.py",
        ("trial < trial.max(axis=0) - ALIKE", "trial < trial.max(axis=0) - 9.0"),
        ("np.abs(sizes[:, None] - radius))\n        best", "0.0 * trial)\n        best"),
        ("change |= (gain > -ALIKE)", "change |= (gain > 9.0)"),
        (">= KNOWN * np.maximum(count, 1.0)", ">= 0.0 * count"),
        ("pairs = pairs.select(pairs.other < len(radius))", "pass"),
        ("touch = TOUCHING * float(np.diff(np.sort(sizes)).min())", "touch = float(np.diff(np.sort(sizes)).min())"),
        ("change &= gain >= rival", "pass"),
        ("if exchanged.mean() > MOST or not usual < HARD * touch:", "if exchanged.mean() > MOST:"),
        ("if exchanged.mean() > MOST or not usual < HARD * touch:", "if not usual < HARD * touch:"),
    ),
]
