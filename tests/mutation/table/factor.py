"""Sparse factorisation."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "solver/factor/pattern.py",
        "tests/solver/factor/test_pattern.py",
        ('permc_spec="MMD_AT_PLUS_A"', 'permc_spec="NATURAL"'),
        ("if len(found) != len(wanted) or np.any(key[found] != wanted):", "if len(found) != len(wanted):"),
        ("row[free[k]] = i\n", "row[free[k]] = k\n"),
        ("left[q] = free[k]", "left[q] = free[i]"),
    ),
    *mutants_of(
        "solver/factor/cholesky.py",
        "tests/solver/factor/test_cholesky.py",
        ("elif total > 0.0:", "elif total != 0.0:"),
        ("blocks[t + U1] -= x * k2 + y * k3", "blocks[t + U1] += x * k2 + y * k3"),
        ("blocks[t + U2] -= x * k6 + y * k7 + z * k8", "blocks[t + U2] -= x * k6 + y * k7"),
        (
            "right[x + m] -= blocks[o + a * size + m] * right[y + a]",
            "right[x + m] -= blocks[o + a * size + m] * right[y + m]",
        ),
    ),
    *mutants_of(
        "solver/factor/inverse.py",
        "tests/solver/factor/test_inverse.py",
        ("_subtract_transposed_product(inverse, u, inverse, e * area, unit, t, size)", "pass"),
        ("for m in range(max(a, b), size):", "for m in range(size - 1, size):"),
        ("where[row[p]] = -1", "pass"),
    ),
]
