"""Who may touch whom, and how they move there."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/contacts"

MUTANTS = [
    *mutants_of(
        "solver/contacts/contacts.py",
        "tests/solver/bodies/test_wall_shapes.py",
        ("faces |= ends.touched & ", "faces |= False & "),
    ),
    *mutants_of(
        "solver/contacts/wall_kernels.py",
        ("tests/solver/bodies/test_wall_shapes.py", "tests/solver/contacts/test_wall_kernels.py"),
        ("return apart, away_x / apart, away_y / apart", "return distance, v, -u"),
        ("gap > -DEEPEST * radius[a]", "gap > -radius[a]"),
        ("beside = beside and 0.0 < along < length", "pass"),
    ),
    *mutants_of(
        "solver/contacts/contacts.py",
        TESTS,
        ("np.stack([-self.normal[:, 1], self.normal[:, 0]]", "np.stack([self.normal[:, 1], -self.normal[:, 0]]"),
        ("arm = radius[a] + 0.5 * gap[c]", "arm = radius[a]"),
        ("gap[c] = distance - radius[a] - radius[b]", "gap[c] = distance - 2.0 * radius[a]"),
        ("return i[faces], w[faces]", "return i, w"),
        ("move_freely(grains.boundary, i, j)", "move_freely(None, i, j)"),
        ("x += shift[c, 0]", "x -= shift[c, 0]"),
        (
            "find_disc_pairs(position[rows], radius[rows], threshold)",
            "find_disc_pairs(position[rows], radius[rows], 0.5 * threshold)",
        ),
        ("threshold if wall_threshold is None else wall_threshold", "threshold"),
    ),
    *mutants_of(
        "solver/contacts/kinematics.py",
        TESTS,
        ("rolling = -radius[i] * rotation[i]", "rolling = radius[i] * rotation[i]"),
        (
            "rolling[~wall] -= radius[j[~wall]] * rotation[j[~wall]]",
            "rolling[~wall] += radius[j[~wall]] * rotation[j[~wall]]",
        ),
        ("motion += walls.cell.drift(contacts.shift)", "motion -= walls.cell.drift(contacts.shift)"),
        ("motion[wall] += walls.velocity_at", "motion[wall] -= walls.velocity_at"),
        (
            "add(2 * n + j[pair], c + column[pair], -radius[j[pair]])",
            "add(2 * n + j[pair], c + column[pair], radius[j[pair]])",
        ),
        (
            "add(axis * n + j[pair], offset + column[pair], direction[pair, axis])",
            "add(axis * n + j[pair], offset + column[pair], -direction[pair, axis])",
        ),
        ("-weight[:, 1]", "mass * gravity[1]"),
        ('un = np.einsum("ij,ij->i", motion, contacts.normal)', 'un = -np.einsum("ij,ij->i", motion, contacts.normal)'),
    ),
    *mutants_of(
        "solver/contacts/connectivity.py",
        (TESTS, "tests/solver/statistics/test_stress.py"),
        ("(contacts_per_grain(contacts, bearing) < 2)", "(contacts_per_grain(contacts, bearing) < 1)"),
        ("np.bincount(i, minlength=n) + np.bincount(j[j < n], minlength=n)[:n]", "2 * np.bincount(i, minlength=n)"),
        ("counted = present & ~loose", "counted = present"),
        ("held[pair] &= ~loose[j]", "pass"),
        ("weight @ (held & counted[i]) +", "2.0 * weight @ (held & counted[i]) +"),
    ),
    *mutants_of(
        "solver/contacts/radius_tuning.py",
        TESTS,
        ("np.where(contacts.with_wall, contacts.gap, 0.5 * contacts.gap)", "0.5 * contacts.gap"),
        ("(mean[:-1] < wanted) & (mean[1:] >= wanted)", "mean[1:] >= wanted"),
        (".mean() >= wanted:", ".mean() > wanted + 0.5:"),
    ),
    *mutants_of(
        "solver/contacts/verdicts.py",
        TESTS,
        ("DETECTED = 0.5", "DETECTED = 0.0"),
        (
            "join_keys(contacts.key[~are_among(contacts.key, verdicts.forbidden)], forced)",
            "join_keys(contacts.key, forced)",
        ),
        ("verdicts.forced[are_present(verdicts.forced, present, contacts.body_count)]", "verdicts.forced"),
    ),
    *mutants_of(
        "solver/contacts/pairs.py",
        TESTS,
        ("return here[i] & here[j]", "return here[i] | here[j]"),
        ("return row, former[row] == key", "return row, former[row] >= key"),
        ("np.asarray(i).astype(np.int64) * bodies + j", "np.asarray(i).astype(np.int32) * np.int32(bodies) + j"),
        ("found[known] = value[row[known]]", "found[known] = value[: known.sum()]"),
        ("one[np.searchsorted(union, key)] = value", "one[: len(value)] = value"),
    ),
]
