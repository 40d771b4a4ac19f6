"""What a recording shows beside the frames that it shows it for."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "app/recording/files/row_batches.py",
        "tests/app/recording/files/test_row_batches.py",
        ("key = path, tuple(times), tuple(parts)", "key = path, tuple(times), ()"),
        ("if rows.size >= LARGEST:", "if False:"),
        ("rows.size += sum(", "rows.size = sum("),
        ("        self._points.clear()\n", ""),
        ("append((self._moment, values))", "append(((), values))"),
        ("columns.partition([len(values) for _, values in found])", "columns.partition([1] * len(found))"),
        (
            "rows, (path, timelines, components) = self._rows.pop(key), key",
            "rows, (path, timelines, components) = self._rows[key], key",
        ),
        ("rows.parts.append(list(parts.values()))", "rows.parts.insert(0, list(parts.values()))"),
        ("        if not points:\n            return\n", ""),
    ),
]
