"""Constant errors of centres, radii, walls and scale."""

from tests.mutation.mutant import mutants_of

CALIBRATE = ("tests/solver/calibration/test_equations.py", "tests/solver/calibration/test_calibrate.py")
SCALE = "tests/solver/calibration/test_scale.py"

MUTANTS = [
    *mutants_of(
        "app/inference/radii.py",
        "tests/app/inference/test_radii.py",
        ("radius=tracks.radius + found.correction", "radius=tracks.radius - found.correction"),
        ("radius=then.radius + found.correction", "radius=then.radius"),
        ("first is None or not radii_scatter(", "first is None or radii_scatter("),
    ),
    *mutants_of(
        "solver/calibration/equations.py",
        CALIBRATE,
        ("np.stack([jx, jy, minus], axis=1)", "np.stack([-jx, jy, minus], axis=1)"),
        ("np.stack([-ix, -iy, minus], axis=1)", "np.stack([-ix, -iy, -minus], axis=1)"),
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
        (*CALIBRATE, SCALE),
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
        "solver/calibration/gap_noise.py",
        "tests/solver/calibration/test_gap_noise.py",
        ("error[c] += sigma[j]", "error[c] -= sigma[j]"),
        ("if j != i:", "if True:"),
    ),
    *mutants_of(
        "solver/calibration/priors.py",
        CALIBRATE,
        ("share = min(1.0, ratio)", "share = 1.0"),
        ("np.sqrt(first**2 + second**2 + finest**2)", "np.sqrt(first**2 + finest**2)"),
    ),
    *mutants_of(
        "solver/calibration/statistics.py",
        CALIBRATE,
        ("1.0 - after / before if before > 0.0 else 0.0", "1.0 - before / after if after > 0.0 else 0.0"),
        ("deep = gap + overlap < -IMPOSSIBLE * candidates.noise", "deep = gap + overlap < 0.0 * candidates.noise"),
    ),
    *mutants_of(
        "solver/calibration/calibrate.py",
        CALIBRATE,
        ("self.noise_factor * sigma, self.gap_sd / np.sqrt(2.0)", "self.noise_factor * sigma, 0.0"),
        ("LEAST_GAIN = 0.1", "LEAST_GAIN = -10.0"),
        ("MISJUDGED_NOISE = 2.0", "MISJUDGED_NOISE = 2000.0"),
    ),
    *mutants_of(
        "solver/calibration/scale.py",
        SCALE,
        ("target = -piles.excess", "target = piles.excess"),
        ("place + overlap, width / np.sqrt(pairs)", "place, width / np.sqrt(pairs)"),
        ("DECISIVE = 20.0", "DECISIVE = -20.0"),
    ),
]
