"""The convex members and the friction that they show."""

from tests.mutation.mutant import mutants_of

PROGRAM = "tests/solver/convex/test_program.py"

MUTANTS = [
    *mutants_of(
        "solver/convex/program.py",
        PROGRAM,
        ("balance.friction * np.abs(slip) + settings.doubt", "settings.doubt"),
        ("np.minimum(doubt, 100.0), slip]", "np.minimum(doubt, 100.0), -slip]"),
        ("-np.log(2.0 * probability)", "-np.log(probability)"),
        ("cost - pull * centre", "cost + pull * centre"),
        ("[[-mu, one], [-mu, -one]]", "[[-mu, one], [-mu, one]]"),
        ("np.abs(slip) - settings.slip_noise * sigma, 0.0) / scale", "np.abs(slip), 0.0) / scale"),
        (
            "weight[2 * n : 3 * n] /= grains.radius[present].mean()",
            "weight[2 * n : 3 * n] *= grains.radius[present].mean()",
        ),
        ("balance: float = 1e3", "balance: float = 1.0"),
        ("wall_normal_total / force_unit", "wall_normal_total"),
        ("np.tile(present, 3)", "np.tile(np.ones_like(present), 3)"),
    ),
    *mutants_of(
        "solver/convex/members.py",
        "tests/solver/convex/test_members.py",
        ("same = before.value * after.value > 0.0", "same = before.value * after.value < 0.0"),
        (
            "np.minimum(np.abs(before.value), np.abs(after.value))",
            "np.maximum(np.abs(before.value), np.abs(after.value))",
        ),
        ("scale**2 / (scale**2 + noise)", "1.0"),
    ),
    *mutants_of(
        "solver/convex/friction_estimate.py",
        "tests/solver/convex/test_friction_estimate.py",
        ("1.0 + float(np.sum(ft * slip)) / possible", "1.0 - float(np.sum(ft * slip)) / possible"),
        ("0.5 * (x[0] + x[1]) - 0.5 * left / curvature", "x[1]"),
        ("friction=factor * frame.balance.friction", "friction=frame.balance.friction"),
    ),
]
