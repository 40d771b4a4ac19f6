"""The contact law, its sweeps and what is measured of them."""

from tests.mutation.mutant import mutants_of

SWEEPS = ("tests/reference/test_sweeps.py",)
CHAIN = ("tests/solver/nlgs/test_chain.py", "tests/golden/test_forces.py")
MEASURES = ("tests/reference/test_measures.py",)

MUTANTS = [
    *mutants_of(
        "solver/nlgs/sweeping/contact_law.py",
        (*SWEEPS, *MEASURES),
        ("fn = max(fn, 0.0)", "fn = abs(fn)"),
        ("limit = friction * fn", "limit = 0.5 * friction * fn"),
        ("min(max(ft, -limit), limit)", "min(max(ft, 0.0), limit)"),
        ("ft - ut * inverse_wtt, friction", "ft + ut * inverse_wtt, friction"),
    ),
    *mutants_of(
        "solver/nlgs/sweeping/kernels.py",
        (*SWEEPS, *MEASURES),
        ("THIRD = 1.0 / 3.0", "THIRD = 1.0 / 2.0"),
        ("        body[i, 2] -= ci * (2.0 * force[c, 1])", "        body[i, 2] -= ci * force[c, 1]"),
        ("        body[j, 0] += cj * fx", "        body[j, 0] += ci * fx"),
        ("plate[w, 1] * (wall[c, 6] * fn + wall[c, 7] * ft)", "plate[w, 1] * (wall[c, 6] * fn)"),
        ("    body[i + U2] -= ci * (2.0 * ft)", "    body[i + U2] += ci * (2.0 * ft)"),
        (
            "        un = dx * nx + dy * ny + pair[p + 3 * L + k]\n        ut = dy * nx - dx * ny - aw - bw",
            "        un = dx * nx + dy * ny\n        ut = dy * nx - dx * ny - aw - bw",
        ),
        ("- aw - bw\n        if rows == CELL_ROWS:", "- aw - bw\n        if rows > CELL_ROWS:"),
        ("c % L\n    p, e = (c // L) * rows", "c % L\n    p, e = (c // L) * ROWS"),
        ("ut = dy * nx - dx * ny - aw - bw", "ut = dy * nx - dx * ny - aw + bw"),
        ("work[4 * L + k] = bx + cj * fx", "work[4 * L + k] = bx + ci * fx"),
        ("work[6 * L + k] = bw - cj * torque", "work[6 * L + k] = bw + cj * torque"),
        (
            "_relax_group(pair, ids, flat, flat_force, work, block, ROWS, relaxation, mu)",
            "_relax_group(pair, ids, flat, flat_force, work, block, ROWS, relaxation, wall_mu)",
        ),
        (
            "    un = dx * nx + dy * ny + pair[p + 3 * L]\n    ut = dy * nx - dx * ny - body[i + U2] - body[j + U2]",
            "    un = dx * nx + dy * ny\n    ut = dy * nx - dx * ny - body[i + U2] - body[j + U2]",
        ),
        ("    body[j + U2] -= cj * torque", "    body[j + U2] -= ci * torque"),
        (
            "un = plate[w, 0] * wall[c, 6] - body[i] * nx - body[i + U1] * ny + wall[c, 4]",
            "un = plate[w, 0] * wall[c, 6] - body[i] * nx - body[i + U1] * ny",
        ),
        (
            "ut = plate[w, 0] * wall[c, 7] + body[i] * ny - body[i + U1] * nx - body[i + U2] + wall[c, 5]",
            "ut = plate[w, 0] * wall[c, 7] + body[i] * ny - body[i + U1] * nx - body[i + U2]",
        ),
        ("relaxation * wall[c, 3], mu)", "relaxation * wall[c, 2], mu)"),
        ("first + c, c, relaxation, wall_mu)", "first + c, c, relaxation, mu)"),
        (
            "for c in range(problem.grouped, first):\n                relax_pair(pair, ids, flat, flat_force, c, ROWS",
            "for c in range(first, first):\n                relax_pair(pair, ids, flat, flat_force, c, ROWS",
        ),
        ("work[2 * L + k] += 1.0 if fn > 0.0 else 0.0", "work[2 * L + k] += 1.0"),
        ("size = size if size > 0.0 else change", "size = max(size, 1.0)"),
        ("work[3 * L + k] += contact_residual(", "work[3 * L + k] = contact_residual("),
        ("- (body[i] * nx + body[i + U1] * ny) + wall[c, 4]", "- (body[i] * nx + body[i + U1] * ny)"),
        (
            "(body[i] * ny - body[i + U1] * nx) - body[i + U2] + wall[c, 5]",
            "(body[i] * ny - body[i + U1] * nx) - body[i + U2]",
        ),
        ("row + 1], un, ut, wall[c, 2], wall[c, 3], mu)", "row + 1], un, ut, wall[c, 2], wall[c, 2], mu)"),
        ("normal = min(wn * un, fn)", "normal = wn * un"),
        ("limit = mu * (fn - normal)", "limit = mu * fn"),
        ("x = external[at] + (current[row]", "x = (current[row]"),
        ("return worst, total / max(grains, 1.0)", "return worst, total / count"),
    ),
    *mutants_of(
        "solver/nlgs/sweeping/measured_sweeps.py",
        MEASURES,
        ("        copy_vector(flat, flat_previous)", "        copy_vector(flat_previous, flat_previous)"),
        ("        copy_matrix(plate, previous_plate)", "        copy_matrix(previous_plate, previous_plate)"),
        ("        work[RESIDUAL:SIZE] = 0.0", "        work[SQUARES:SIZE] = 0.0"),
        ("- work[DIFFERENCES + 2 * L + k]", "+ work[DIFFERENCES + 2 * L + k]"),
        (
            "work[RESIDUAL + k] += contact_residual(fn, ft, un, ut, inverse_wnn",
            "work[RESIDUAL + k] += contact_residual(fn, ft, un, ut, relaxation * inverse_wnn",
        ),
        ("1.0 / compliance if compliance > 0.0 else 0.0", "compliance"),
        ("greatest_force_residual(equilibrium, body) / mean", "greatest_force_residual(equilibrium, body)"),
        ("range(full * L, len(body))", "range(full * L, full * L)"),
    ),
    *mutants_of(
        "solver/nlgs/problem.py",
        SWEEPS,
        ("np.where(grains.free, 1.0 / impedance, 0.0)", "1.0 / impedance"),
        ('np.einsum("ij,ij->i", drift, contacts.tangent[rows_pair])', "np.zeros(len(rows_pair))"),
        ("PLATE_IMPEDANCE = 30.0", "PLATE_IMPEDANCE = 3.0"),
        ("body[:, 2] = motion.spin * grains.radius", "body[:, 2] = motion.spin"),
        ("-walls.load[walls.loaded] * plate_compliance", "walls.load[walls.loaded] * plate_compliance"),
        ("grains.mass / grains.mass.mean()", "grains.radius / grains.radius.mean()"),
        ("weight = grains.weight(material.gravity)", "weight = 0.0 * grains.weight(material.gravity)"),
        ("_inverse(3.0 * grain_w + along", "_inverse(grain_w + along"),
        ("problem.wall_body, wall[:, 6], wall[:, 7])", "problem.wall_body, wall[:, 7], wall[:, 6])"),
        ("_inverse(compliance[first] + compliance[second])", "pair[:, 2]"),
        ("contacts.normal[rows_wall]) + closing[rows_wall]", "contacts.normal[rows_wall])"),
        ('np.einsum("ij,ij->i", velocity, contacts.tangent[rows_wall])', "np.zeros(len(rows_wall))"),
        ("_inverse(pair_w), closing[rows_pair]]", "_inverse(pair_w), 0.0 * closing[rows_pair]]"),
        ("velocity_scale / (1.0 - formal_weight)", "velocity_scale"),
        (
            "return grains.mass / interval / (1.0 - formal_weight)",
            "return grains.mass / interval * (1.0 - formal_weight)",
        ),
        ("impedance[motion.present].mean()", "impedance.mean()"),
        ("weight[~moved] = 0.0", "weight[~motion.present] *= 1.0"),
    ),
    *mutants_of(
        "solver/nlgs/acceleration.py",
        ("tests/reference/test_measures.py", "tests/solver/nlgs/test_acceleration.py"),
        ("flat[k] -= weight * row[k]", "flat[k] += weight * row[k]"),
        ("friction[0 if c < pairs else 1]", "friction[0]"),
        ("if self._natural_map < kept_natural_map:", "if self._natural_map > 0.0:"),
    ),
    *mutants_of(
        "solver/nlgs/sweeping/ordering.py",
        ("tests/reference/test_measures.py", "tests/solver/nlgs/sweeping/test_ordering.py"),
        ("group_of[j[c]] = groups", "group_of[i[c]] = groups"),
        ("_spread(cell[:, 1]) << np.uint64(1)", "_spread(cell[:, 1]) << np.uint64(2)"),
    ),
    *mutants_of(
        "solver/nlgs/solve.py",
        ("tests/solver/nlgs", "tests/solver/statistics/test_balance.py"),
        ("force[:] = guess[problem.rows]", "force[:] = guess"),
        ("result[..., problem.rows, :] = force", "result[:] = force[..., problem.rows, :]"),
        ("sweep.natural_map <= settings.natural_map", "sweep.natural_map >= settings.natural_map"),
        ("(worst / mean, mean_size / mean) if mean > 0", "(worst / mean, worst / mean) if mean > 0"),
    ),
    *mutants_of(
        "solver/nlgs/interval.py",
        CHAIN,
        ("motion.velocity_rms * closing_distance", "0.0 * closing_distance"),
        ("if np.array_equal(known, impedance):", "if len(known) == len(impedance):"),
    ),
    *mutants_of(
        "solver/nlgs/chain.py",
        CHAIN,
        ("diameter = 2.0 * float(packing.grains.radius.mean())", "diameter = float(packing.grains.radius.mean())"),
        (
            "problem, contacts, _ = interval.at(step / steps, impedance)",
            "problem, contacts, _ = interval.at(1.0, impedance)",
        ),
        ("(settings.spin_up if cold_start else settings.substeps)", "settings.substeps"),
        ("memory=memory.renew(contacts, solution.force, motion.grains.present)", "memory=previous_force"),
        ("step = motion.interval / steps", "step = motion.interval"),
    ),
    *mutants_of(
        "solver/nlgs/sweep_record.py",
        "tests/solver/nlgs/test_sweep_record.py",
        ("yield kept + 1 - count", "yield kept - count"),
        ("find_rows(contacts.key, self.contacts.key[self.problem.rows])", "find_rows(contacts.key, self.contacts.key)"),
    ),
    *mutants_of(
        "solver/nlgs/force_memory.py",
        "tests/solver/nlgs",
        (
            "return ForceMemory(key[order], np.concatenate([self.force[absent], force])[order])",
            "return ForceMemory(key[order], np.concatenate([self.force[absent], force]))",
        ),
        (
            "absent = ~are_present(self.key, present, contacts.body_count)",
            "absent = are_present(self.key, present, contacts.body_count)",
        ),
    ),
]
