"""Statistics of forces."""

from tests.mutation.mutant import mutants_of

STATISTICS = "tests/solver/statistics"

MUTANTS = [
    *mutants_of(
        "solver/statistics/balance.py",
        STATISTICS,
        ("np.subtract.at(sums, i, force.ravel())", "np.add.at(sums, i, force.ravel())"),
        ("sums = np.tile(weight[:, axis], len(start))", "sums = np.tile(0.0 * weight[:, axis], len(start))"),
        ("fn * normal[:, axis] + ft * tangent[:, axis]", "fn * normal[:, axis] - ft * tangent[:, axis]"),
        ("resultant_norms(contacts, fn, ft, weight)[present]", "resultant_norms(contacts, fn, ft, weight)"),
        ("residual @ residual / (2.0 * (fn @ fn))", "residual @ residual / (fn @ fn)"),
    ),
    *mutants_of(
        "solver/statistics/packing_area.py",
        "tests/solver/statistics/test_packing_area.py",
        ("if (apart > PARALLEL).all():", "if (apart > 0.0).all():"),
        ("sides > 4.0 * WIDEST_PORE * apart * area", "sides > 0.0"),
        ("None if boundary is None else boundary[present]", "boundary"),
    ),
    *mutants_of(
        "solver/statistics/stress.py",
        STATISTICS,
        ("/ (area * length)", "/ area"),
        ("end[pair] = contacts.second_centre(position)[pair]", "end[pair] = contacts.point[pair]"),
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
        ("2.0 * weighted_mean(cosine, weight), 2.0", "weighted_mean(cosine, weight), 2.0"),
        ("(design.T * weight) @ value / total", "design.T @ value / total"),
        ("(normal.T * weight) @ normal / total", "normal.T @ normal / total"),
        ("np.stack([-sine, cosine], axis=1), ft", "np.stack([sine, -cosine], axis=1), ft"),
    ),
    *mutants_of(
        "solver/statistics/force_statistics.py",
        STATISTICS,
        ("strong = fn > weighted_mean(fn, weight)", "strong = fn > np.median(fn)"),
        ("FORCE_EDGES, weights=weight)", "FORCE_EDGES)"),
        ("counts[-1] += weight @ sliding", "pass"),
        ("return Estimate(1.0 / scale,", "return Estimate(scale,"),
        ("force[weak] < 0.5 * mean", "force[weak] < 0.6 * mean"),
        ("np.abs(ft) / np.where(held, limit, 1.0), 1.0)", "np.abs(ft) / np.where(held, limit, 1.0), 0.0)"),
    ),
    *mutants_of(
        "solver/statistics/force_chains.py",
        STATISTICS,
        ("(major > major[present].mean())", "(major > major.mean())"),
        ("np.deg2rad(45.0)", "np.deg2rad(60.0)"),
        ("on_chain = links.min(axis=1) > 0", "on_chain = links.max(axis=1) > 0"),
        ("-force[pair], contacts.point[pair] - centre", "force[pair], contacts.point[pair] - centre"),
    ),
    *mutants_of(
        "solver/statistics/frame_statistics.py",
        STATISTICS,
        ("bearing = fn > 0\n    normal", "bearing = fn >= 0\n    normal"),
        ("pressure=0.5 * float(np.trace(stress))", "pressure=float(np.trace(stress))"),
        ("sliding_fraction=weighted_mean(sliding, weight)", "sliding_fraction=float(sliding.mean())"),
        ("probably_bearing, counted, weight=probabilities.bearing)", "probably_bearing, counted)"),
        (
            "contact_fabric(contacts.normal[between], probabilities.bearing[between])",
            "contact_fabric(contacts.normal[bearing])",
        ),
        ("between = bearing & ~contacts.with_wall", "between = bearing"),
        ("mean_fn=weighted_mean(normal, weight)", "mean_fn=float(normal.mean())"),
    ),
    *mutants_of(
        "solver/statistics/bearing.py",
        STATISTICS,
        ("LEAST_TOUCH, 1.0)", "1.0, 1.0)"),
        (
            "np.where(bearing, logistic(np.where(np.isnan(touch), without_touch, with_touch)), 0.0)",
            "logistic(with_touch)",
        ),
    ),
    *mutants_of(
        "solver/statistics/sliding.py",
        STATISTICS,
        ("(np.abs(ft) >= ON_CONE", "(ft >= ON_CONE"),
        ("[on[convex], on[~convex]]", "[on, on]"),
        ("used = np.minimum(mobilised, 1.0)", "used = mobilised"),
        ("slip = np.maximum(evidence.slip, 0.0)", "slip = evidence.slip"),
        ("slides_far * _saturating(slip, LARGE_SLIDING_SD)", "0.0 * _saturating(slip, LARGE_SLIDING_SD)"),
        ("mean * evidence.mobilised_friction + weight)", "mean * evidence.mobilised_friction)"),
        ("odds + weight +", "odds +"),
        ("np.where(sliding > EVEN,", "np.where(sliding > 0.0,"),
        ("* (given / friction) **", "* (friction / given) **"),
        ("(of_soft if evidence.soft else of_hard)", "of_hard"),
    ),
    *mutants_of(
        "solver/statistics/agreement.py",
        STATISTICS,
        ("hit / len(key) if len(key)", "hit / len(bearing) if len(key)"),
        (
            "float(np.linalg.norm(inferred - true)) / size",
            "float(np.linalg.norm(inferred - true)) / np.linalg.norm(inferred)",
        ),
        ("float(inferred[:, 0].sum()) / total", "total / float(inferred[:, 0].sum())"),
    ),
]
