"""The convex members and the friction that they show."""

from tests.mutation.mutant import mutants_of

PROGRAM = "tests/solver/convex/test_program.py"
TWIN = "tests/reference/test_convex_program.py"

SLIDING = "tests/solver/convex/test_sliding_model.py"

MUTANTS = [
    *mutants_of("solver/part_settings.py", PROGRAM, ("balance: float = 1e3", "balance: float = 1.0")),
    *mutants_of(
        "solver/convex/program.py",
        PROGRAM,
        ("* balance.friction * np.abs(slip)", "* np.abs(slip)"),
        ("np.minimum(ambiguity, 100.0), slip]", "np.minimum(ambiguity, 100.0), -slip]"),
        ("-np.log(2.0 * probability)", "-np.log(probability)"),
        ("np.abs(slip) - settings.slip_noise * sigma, 0.0) / scale", "np.abs(slip), 0.0) / scale"),
        (
            "weight[2 * n : 3 * n] /= lever",
            "weight[2 * n : 3 * n] *= lever",
        ),
        ("load = np.append(load, total / force_unit)", "load = np.append(load, total)"),
        ("np.tile(present, 3)", "np.tile(np.ones_like(present), 3)"),
    ),
    *mutants_of(
        "solver/convex/grain_blocks.py",
        (PROGRAM, TWIN),
        ("entries.col // contacts * PADDED_ROWS + component[entries.row]", "component[entries.row]"),
        ("for d in range(1, block_count.max(initial=1))]", "for d in range(1, min(2, block_count.max(initial=1)))]"),
        ("np.argsort(contact * count + pattern.place[node_of_block])", "np.arange(len(contact))"),
        ("by_node[pattern.place[node], component] = load", "by_node[node, component] = load"),
        ("grain_count + rest // ROWS", "grain_count + rest // ROWS * 0"),
    ),
    *mutants_of(
        "solver/convex/interior_point_kernels.py",
        TWIN,
        ("un = program.cost[c, 0] + program.proximal_weight", "un = program.cost[c, 0] - program.proximal_weight"),
        ("un - mu * ut - z0, un + mu * ut - z1", "un - mu * ut - z0, un - mu * ut - z1"),
        ("fn, ft = w0 + w1, mu * (w1 - w0)\n        un =", "fn, ft = w0 + w1, mu * (w0 - w1)\n        un ="),
        ("-grains.load[k] - current.velocity[k] * inverse", "grains.load[k] - current.velocity[k] * inverse"),
        (
            "if gap <= tolerance and residual <= RESIDUAL_TOLERANCE:",
            "if gap <= 1e4 * tolerance and residual <= RESIDUAL_TOLERANCE:",
        ),
        ("copy_matrix(current.edge_force, workspace.best)", "pass"),
        (
            "(4.0 * program.proximal_weight * square + d0 + d1) * inverse_determinant,",
            "(d0 + d1) * inverse_determinant,",
        ),
    ),
    *mutants_of(
        "solver/convex/contact_jacobian.py",
        "tests/solver/convex/test_contact_jacobian.py",
        ("nn * hn + nt * ht, nt * hn + tt * ht)", "nn * hn + nt * ht, nt * hn + nn * ht)"),
        ("for k, force in enumerate((fn, ft)):", "for k, force in enumerate((fn, fn)):"),
    ),
    *mutants_of(
        "solver/convex/interior_point.py",
        TWIN,
        ("elif gap <= USABLE_GAP and residual <= RESIDUAL_TOLERANCE:", "elif gap <= USABLE_GAP:"),
        ("Termination.UNFINISHED if code == STEP_LIMIT else Termination.BREAKDOWN", "Termination.UNFINISHED"),
        (
            "friction * np.clip(edge_force[:, 1] - edge_force[:, 0], -fn, fn)",
            "friction * (edge_force[:, 0] - edge_force[:, 1])",
        ),
    ),
    *mutants_of(
        "solver/convex/ensemble_members.py",
        "tests/solver/convex/test_ensemble_members.py",
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
        ("friction=scale * frame.balance.friction", "friction=frame.balance.friction"),
    ),
    *mutants_of(
        "solver/convex/sliding_model.py",
        SLIDING,
        ("wall_friction=self.wall_friction * value / self.friction", "wall_friction=value"),
        ("slip=-self.slip, drag=-self.drag", "slip=-self.slip"),
        ("np.where(wall, model.wall_friction, model.friction)", "np.where(wall, model.friction, model.friction)"),
        ("np.where(wall, 0.0, model.attraction * self.probability)", "np.where(wall, 0.0, model.attraction)"),
        ("np.where(wall, 0.0, model.attraction * self.probability)", "model.attraction * self.probability"),
        ("model.base_drag * self.drag", "self.drag"),
        (
            "return replace(given, matrix=matrix, load=load, grains=blocks, friction=friction)",
            "return replace(given, matrix=matrix, load=load, friction=friction)",
        ),
        ("power_gaps(each.under(model) for each in frames)", "power_gaps(frames)"),
        (
            "model, enclosed = model.with_value(name, value), enclosed and inside",
            "model, enclosed = model.with_value(name, value), True",
        ),
        ("ROUNDS = 3", "ROUNDS = 1"),
        ("best = min(near, key=gap)", "best = max(near, key=gap)"),
        ("if q == len(trial) - 1 or (q == 0", "if (q == 0"),
        ("x[0], x[2]))", "x[0], x[0]))"),
    ),
    *mutants_of(
        "solver/convex/friction_check.py",
        SLIDING,
        ("return gap < min(CLEAR * other, other - LEAST_GAP, MOST_GAP)", "return gap < min(CLEAR * other, MOST_GAP)"),
        (
            "return gap < min(CLEAR * other, other - LEAST_GAP, MOST_GAP)",
            "return gap < min(CLEAR * other, other - LEAST_GAP)",
        ),
    ),
    *mutants_of(
        "solver/convex/friction_check.py",
        ("tests/solver/convex/test_friction_check.py",),
        ("return completed if is_clearly_less(", "return completed if not is_clearly_less("),
        (
            "match_values(joined, contacts.key, probability) + match_values(joined, key, chance)",
            "match_values(joined, contacts.key, probability)",
        ),
        ("for _ in range(ROUNDS if completed else 0):", "for _ in range(0):"),
    ),
    *mutants_of(
        "solver/convex/resistance.py",
        SLIDING,
        ("backward = turned < min(REVERSED * before, before - LEAST_GAP)", "backward = True"),
        ("min(REVERSED * before, before - LEAST_GAP)", "REVERSED * before"),
        ("each.model.friction > ABSURD for", "each.model.friction > 9.0 for"),
        ("each.model.friction > ABSURD for", "each.model.friction > 0.0 for"),
        ('if name != "wall_friction" or walls >= LEAST_WALLS', "if True"),
        ('if best == "wall_friction" and walls_fit else best', "if False else best"),
        ("> MOST_FRICTION * given.friction:", "> 1e9 * given.friction:"),
        ("min(before, friction))", "before)"),
        ('if name not in (best, "friction")', "if name not in (best, *sound)"),
        ("if not before > QUIET or", "if"),
        ("< REVERSED * before:\n            break", "< 0.0:\n            break"),
        ("(np.delete(gap, best) * AHEAD < gap[best]).any()", "False"),
        ("each.gap if each.enclosed else before", "each.gap"),
        ("        del left[best]\n", "        break\n"),
        ("if each.enclosed}", "}"),
        ("* float(packing.grains.mass.mean()) / force_unit", "/ force_unit"),
        ("rows[2 * count : 3 * count] = TORQUE_WEIGHT", "pass"),
        ("drag=None, moment=None, moment_sd=None", "moment=None, moment_sd=None"),
        ("+ 4.0 * now.sigma**2", ""),
        (
            "relative_mass = packing.grains.mass / packing.grains.mass.mean()",
            "relative_mass = np.ones(packing.grains.count)",
        ),
        ("after.position - before.position", "before.position - after.position"),
        ("packing.material.friction <= 0.0 or packing.material.wall_friction <= 0.0", "False"),
    ),
    *mutants_of(
        "solver/convex/friction_check.py",
        "tests/solver/convex/test_friction_check.py",
        ("(snapshots[k - 1], snapshots[k + 1])", "(snapshots[k - 1], snapshots[k])"),
    ),
    *mutants_of(
        "solver/convex/friction_estimate.py",
        SLIDING,
        ("memory.recall(frame.contacts)", "0.0 * memory.recall(frame.contacts)"),
    ),
]
