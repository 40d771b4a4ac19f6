"""results.h5, what is compared in it and what an interruption leaves."""

from tests.mutation.mutant import mutants_of

STORE = "tests/app/results"

MUTANTS = [
    *mutants_of(
        "app/results",
        STORE,
        ("counts = [f.contacts.count for f in frames]", "counts = [f.contacts.count - 1 for f in frames]"),
        ("every[number] = values", "every[: len(number)] = values"),
        ("rows = [getattr(h, key)[m] for h, m", "rows = [getattr(h, key)[: len(m)] for h, m"),
        ('store.attrs["friction"] = results.friction', 'store.attrs["friction"] = 0.0'),
        ('f"forces/{key}", np.concatenate([getattr(f, key) for f', 'f"forces/{key}", np.concatenate([f.fn for f'),
        ("if store.attrs.get(SCHEMA) != SCHEMA_VERSION:", "if store.attrs.get(SCHEMA) is None:"),
        ('store[path].attrs["unit"] = unit', 'store[path].attrs["unit"] = ""'),
        ("(first, -1 if stop is None else stop)", "(first, first if stop is None else stop)"),
        ("~np.isnan(rows).all(axis=0)", "~np.isnan(rows).any(axis=0)"),
    ),
    *mutants_of(
        "app/results",
        STORE,
        ("np.minimum(i, j)[known], np.maximum(i, j)[known]", "i[known], j[known]"),
        ("rows[a.tracks.id[rows] != b.tracks.id] = -1", "pass"),
        ("forces = b.frames[k - offset]", "forces = b.frames[k - first]"),
        ("CLOSE = 0.5  # of a radius: two", "CLOSE = 50.0  # of a radius: two"),
    ),
    *mutants_of(
        "app/results",
        STORE,
        ("mark.read_text() != fingerprint", "False"),
        ("while self._file(count).exists():", "while self._file(count + 1).exists():"),
    ),
    *mutants_of(
        "app/results",
        STORE,
        ('"forces/fn": "N"', '"forces/fn": "kN"'),
        ('"walls/pressure": "Pa"', '"walls/pressure": "kPa"'),
    ),
]
