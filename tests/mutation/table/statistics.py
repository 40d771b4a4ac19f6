"""What forces say, whoever found them."""

from tests.mutation.mutant import mutants_of

STATISTICS = "tests/solver/statistics"

MUTANTS = [
    *mutants_of(
        "solver/statistics/balance.py",
        STATISTICS,
        ("np.subtract.at(sums, i, force.ravel())", "np.add.at(sums, i, force.ravel())"),
        ("sums = np.tile(weight[:, axis], len(start))", "sums = np.tile(0.0 * weight[:, axis], len(start))"),
        ("fn * normal[:, axis] + ft * tangent[:, axis]", "fn * normal[:, axis] - ft * tangent[:, axis]"),
        ("unbalances(contacts, fn, ft, weight)[present].max", "unbalances(contacts, fn, ft, weight).max"),
    ),
    *mutants_of(
        "solver/statistics/stress.py",
        STATISTICS,
        ("/ (area * length)", "/ area"),
        ("end[pair] = position[contacts.j[pair]]", "end[pair] = contacts.point[pair]"),
        ("float(np.arcsin(np.clip((major - minor)", "float(np.arctan(np.clip((major - minor)"),
        ("return float(values[1]), float(values[0]), angle", "return float(values[0]), float(values[1]), angle"),
        ("np.arctan2(abs(tangential), normal)", "np.arcsin(min(abs(tangential) / normal, 1.0))"),
        ("fn[:, None] * contacts.normal + ft[:, None] * contacts.tangent", "fn[:, None] * contacts.normal"),
    ),
    *mutants_of(
        "solver/statistics/fabric.py",
        STATISTICS,
        ("return float(2.0 * (major - minor))", "return float(major - minor)"),
        ("return 0.5 * total / (1.0 + 0.5 * products)", "return 0.5 * total"),
        ("2.0 * float(cosine.mean()), 2.0 * float(sine.mean())", "float(cosine.mean()), float(sine.mean())"),
        ("np.stack([-sine, cosine], axis=1), ft", "np.stack([sine, -cosine], axis=1), ft"),
    ),
    *mutants_of(
        "solver/statistics/force_statistics.py",
        STATISTICS,
        ("strong = fn > fn.mean()", "strong = fn > np.median(fn)"),
        ("return Estimate(1.0 / scale,", "return Estimate(scale,"),
        ("np.mean(weak < 0.5 * mean)", "np.mean(weak < 0.6 * mean)"),
        ("np.abs(ft) / np.where(held, limit, 1.0), 1.0)", "np.abs(ft) / np.where(held, limit, 1.0), 0.0)"),
    ),
    *mutants_of(
        "solver/statistics/force_chains.py",
        STATISTICS,
        ("(major > major[present].mean())", "(major > major.mean())"),
        ("np.deg2rad(45.0)", "np.deg2rad(60.0)"),
        ("passed = links.min(axis=1) > 0", "passed = links.max(axis=1) > 0"),
        ("-force[pair], contacts.point[pair] - position[j]", "force[pair], contacts.point[pair] - position[j]"),
    ),
    *mutants_of(
        "solver/statistics/frame_statistics.py",
        STATISTICS,
        ("bearing = fn > 0\n", "bearing = fn >= 0\n"),
        ("pressure=0.5 * float(np.trace(stress))", "pressure=float(np.trace(stress))"),
        ("np.mean(state[bearing] == ContactState.SLIDING)", "np.mean(state == ContactState.SLIDING)"),
        ("between = bearing & ~contacts.with_wall", "between = bearing"),
        ("mean_fn=float(carried.mean())", "mean_fn=float(fn.mean())"),
    ),
    *mutants_of(
        "solver/statistics/agreement.py",
        STATISTICS,
        ("hit / len(key) if len(key)", "hit / len(bearing) if len(key)"),
        ("float(np.linalg.norm(ours - true)) / size", "float(np.linalg.norm(ours - true)) / np.linalg.norm(ours)"),
        ("float(ours[:, 0].sum()) / total", "total / float(ours[:, 0].sum())"),
    ),
]
