"""The nearest balanced forces after a local change."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/solver/redistribution"

MUTANTS = [
    *mutants_of(
        "solver/redistribution/contact_removal.py",
        TESTS,
        ("free[row] = False", "free[row] = True"),
        ("before = np.flatnonzero(free)\n", "before = np.flatnonzero(free & (np.arange(len(free)) != row))\n"),
        ("friction[rows], scale)", "friction[: len(rows)], scale)"),
    ),
    *mutants_of(
        "solver/redistribution/nearest_forces.py",
        TESTS,
        ("np.full(len(some), -1.0)", "np.full(len(some), sign)"),
        ("(contacts.i, -1.0), (contacts.j, 1.0)", "(contacts.i, 1.0), (contacts.j, 1.0)"),
        ("given.reshape(2, m).T) / unit", "0.0 * given.reshape(2, m).T) / unit"),
        ("EQUILIBRIUM_WEIGHT = 1e6", "EQUILIBRIUM_WEIGHT = 1e1"),
        ("inside & ~grains.boundary)", "inside)"),
    ),
    *mutants_of(
        "solver/redistribution/local_change.py",
        TESTS,
        ("contacts if moved is None else moved, free", "contacts, free"),
        ("friction[free], scale)", "2.0 * friction[free], scale)"),
        ("np.abs(ft[row]) - friction[row] * fn[row] > enough", "np.abs(ft[row]) > enough"),
    ),
]  # fmt: skip
