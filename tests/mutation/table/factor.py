"""Sparse factorisation."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "solver/factor/pattern.py",
        "tests/solver/factor/test_pattern.py",
        ('permc_spec="MMD_AT_PLUS_A"', 'permc_spec="NATURAL"'),
        ("if low == end or row[low] != wanted:", "if low == end:"),
        ("row[free[k]] = i\n", "row[free[k]] = k\n"),
        ("left[q] = free[k]", "left[q] = free[i]"),
    ),
    *mutants_of(
        "solver/factor/cholesky.py",
        "tests/solver/factor/test_cholesky.py",
        ("elif total > 0.0:", "elif total != 0.0:"),
        ("blocks[d + a * lanes + b] = 0.0", "pass"),
        ("total += blocks[d + a * lanes + m] * rhs[x + m]", "total += blocks[d + m * lanes + a] * rhs[x + m]"),
    ),
    *mutants_of(
        "solver/factor/blocks.py",
        "tests/solver/factor/test_blocks.py",
        (
            "column = subtract_product(builder, column, of_row[m], of_column[m][b])",
            "column = subtract_product(builder, column, of_row[b], of_column[m][m])",
        ),
        ("for m in range(1, b + 1):", "for m in range(1, b):"),
        ("vector = subtract_product(builder, vector,", "vector = add_product(builder, vector,"),
        ("builder.fsub(builder.load(place), total(", "builder.fadd(builder.load(place), total("),
    ),
    *mutants_of(
        "solver/vectors.py",
        "tests/solver/factor/test_blocks.py",
        ("for k in range(0, len(parts), 2)]", "for k in range(0, 2, 2)]"),
    ),
    *mutants_of(
        "solver/factor/inverse.py",
        "tests/solver/factor/test_inverse.py",
        ("_subtract_transposed_product(inverse, u, inverse, e * area, unit, t, block)", "pass"),
        ("for m in range(max(a, b), size):", "for m in range(size - 1, size):"),
        ("row_offset[row[p]] = -1", "pass"),
    ),
]
