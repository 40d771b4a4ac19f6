"""What a recording shows beside the frames that it shows it for."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "app/recording/files/row_batches.py",
        "tests/app/recording/files/test_row_batches.py",
        ("key = timelines, components, tuple(each.type for each in arrays)", "key = timelines, (), ()"),
        ("if self._size >= WAITING:", "if False:"),
        ("self._size += size", "self._size = size"),
        ("self._size -= self._sizes.pop(path, 0)", "self._sizes.pop(path, 0)"),
        ("max(self._sizes, key=self._sizes.__getitem__)", "min(self._sizes, key=self._sizes.__getitem__)"),
        ("            rows.columns = [[] for _ in rows.columns]\n", ""),
        ("if len(self.columns[0]) >= PIECES:", "if False:"),
        ("times.append(_whole(value))", "times.append(0)"),
        ("points.counts.append(len(values))", "points.counts.append(1)"),
        ("        self._points.clear()\n", ""),
    ),
    *mutants_of(
        "app/tracks.py",
        "tests/app/recording/packing_layers/test_force_units.py",
        ("self.loaded.any() or weight.any()", "self.loaded.any()"),
        ("self.loaded.any() or weight.any()", "weight.any()"),
    ),
    *mutants_of(
        "app/recording/packing_layers/film.py",
        "tests/app/recording/packing_layers/test_film.py",
        ("max(canvas.width, NAME_WIDTH[columns] * canvas.height)", "canvas.width"),
    ),
]
