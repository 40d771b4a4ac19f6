"""The convex members and the friction that they show."""

from tests.mutation.mutant import mutants_of

PROGRAM = "tests/solver/convex/test_program.py"
TWIN = "tests/reference/test_convex_program.py"

MUTANTS = [
    *mutants_of(
        "solver/convex/program.py",
        PROGRAM,
        ("balance.friction * np.abs(slip) + settings.doubt", "settings.doubt"),
        ("np.minimum(doubt, 100.0), slip]", "np.minimum(doubt, 100.0), -slip]"),
        ("-np.log(2.0 * probability)", "-np.log(probability)"),
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
        "solver/convex/grain_blocks.py",
        (PROGRAM, TWIN),
        ("entries.col // contacts * FILLED + component[entries.row]", "component[entries.row]"),
        ("for d in range(1, legs.max(initial=1))]", "for d in range(1, min(2, legs.max(initial=1)))]"),
        ("np.lexsort((pattern.place[of], contact))", "np.arange(len(of))"),
        ("by_node[pattern.place[node], component] = load", "by_node[node, component] = load"),
        ("grain_count + rest // ROWS", "grain_count + rest // ROWS * 0"),
    ),
    *mutants_of(
        "solver/convex/interior_point_kernels.py",
        TWIN,
        ("un = program.cost[c, 0] + program.pull", "un = program.cost[c, 0] - program.pull"),
        ("un - mu * ut - z0, un + mu * ut - z1", "un - mu * ut - z0, un - mu * ut - z1"),
        ("fn, ft = w0 + w1, mu * (w1 - w0)\n        un =", "fn, ft = w0 + w1, mu * (w0 - w1)\n        un ="),
        ("-grains.load[k] - at.velocity[k] * inverse", "grains.load[k] - at.velocity[k] * inverse"),
        ("if gap <= tolerance and residual <= RESIDUAL:", "if gap <= 1e4 * tolerance and residual <= RESIDUAL:"),
        ("room.best[:] = at.part", "pass"),
        ("nn, nt = (4.0 * program.pull * square + d0 + d1) * whole", "nn, nt = (d0 + d1) * whole"),
    ),
    *mutants_of(
        "solver/convex/legs.py",
        "tests/solver/convex/test_legs.py",
        ("nn * hn + nt * ht, nt * hn + tt * ht)", "nn * hn + nt * ht, nt * hn + nn * ht)"),
        ("for k, force in enumerate((fn, ft)):", "for k, force in enumerate((fn, fn)):"),
    ),
    *mutants_of(
        "solver/convex/interior_point.py",
        TWIN,
        ("elif gap <= USABLE and residual <= RESIDUAL:", "elif gap <= USABLE:"),
        ("Ending.UNFINISHED if code == ENOUGH else Ending.BROKEN", "Ending.UNFINISHED"),
        ("friction * np.clip(part[:, 1] - part[:, 0], -fn, fn)", "friction * (part[:, 0] - part[:, 1])"),
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
        (
            "least = first + np.argmin([finite.mean(axis=0), *_means_without_one(finite)], axis=1)",
            "least = first + np.argmin([finite.mean(axis=0)], axis=1)",
        ),
        (
            "np.column_stack([gaps_at(first), gap])",
            "np.column_stack([gap, gaps_at(first)])",
        ),
        ("friction=tried * frame.balance.friction", "friction=frame.balance.friction"),
    ),
]
