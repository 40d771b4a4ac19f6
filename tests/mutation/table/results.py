"""Mutants of results.h5, of comparisons and of checkpoints."""

from tests.mutation.mutant import mutants_of

STORE = "tests/app/results/test_store.py"
READER = (
    "tests/app/results/test_store.py", "tests/app/results/test_earlier_files.py",
    "tests/app/results/test_untrusted_files.py", "tests/app/results/test_frames_one_by_one.py",
)  # fmt: skip
COMPARISON = "tests/app/results/test_comparison.py"

MUTANTS = [
    *mutants_of(
        "app/results/truth.py",
        "tests/app/results/test_truth_names.py",
        ("bodies[k if 0 <= k < len(bodies) else 0]", "bodies[0]"),
        ("tracks.id if tracks.given_id is None else tracks.given_id", "tracks.id"),
        ("wall = {name: ids.shape[-1] + row", "wall = {name: len(ids) + row"),
    ),
    *mutants_of(
        "app/results/results.py",
        "tests/app/results/test_truth_names.py",
        ("keep = move_freely(boundary, self.i, self.j)", "keep = ~boundary[self.i]"),
    ),
    *mutants_of(
        "app/results/hdf5/frame_pieces.py",
        STORE,
        ("ends[path].append(ends[path][-1] + len(piece[counted]))", "ends[path].append(ends[path][-1] + 1)"),
        ("return value[measured]", "return value[: len(measured)]"),
        ("if seen[path] == count}", "if seen[path]}"),
        ("np.flatnonzero(~np.isnan(rows).all(axis=0))", "np.flatnonzero(~np.isnan(rows).any(axis=0))"),
    ),
    *mutants_of(
        "app/results/hdf5/writer.py",
        STORE,
        ("self._pending, self._count = [rows[count:].copy()], len(rows) - count", "self._pending, self._count = [], 0"),
        ("self._written += count", "self._written = count"),
        ("block[: len(rows) - start] = rows[start : start + size]", "block[: len(rows) - start] = rows[:size]"),
        ("shuffled = block.reshape(-1).view(np.uint8).reshape(-1, block.itemsize).T", "shuffled = block"),
        ('dataset.attrs["unit"] = dataset.attrs["units"] = quantity.unit', 'dataset.attrs["unit"] = ""'),
        (
            "member.name.lower(): member.value for member in quantity.names}",
            "member.name.lower(): 0 for member in quantity.names}",
        ),
        ("if len(shape) != len(each.dims) or shape != agreed:", "if len(shape) != len(each.dims):"),
    ),
    *mutants_of(
        "app/results/hdf5/reader.py",
        READER,
        ("every[number] = values", "every[: len(values)] = values"),
        ("slice(int(edges[k]), int(edges[k + 1]))", "slice(int(edges[k]), int(edges[k + 1]) - 1)"),
        ("if not isinstance(link, h5py.HardLink):", "if False:"),
        ("if dataset.external or dataset.is_virtual:", "if False:"),
        ("while len(self._kept) > CACHED_FRAMES:", "while False:"),
        ("np.cumsum(np.diff(kept) * np.diff(contact))", "np.cumsum(np.diff(kept) + np.diff(contact))"),
        ("converted[values == number] = own[named[number]]", "converted[values == number] = number"),
        ("if entry.quantity.essential:", "if False:"),
        ("if dataset.shape != shape:", "if len(dataset.shape) != len(shape):"),
        ("if values[0] != 0 or np.any(np.diff(values) < 0):", "if values[0] != 0:"),
        (
            "np.any(number >= np.repeat(count[k : k + BLOCK], np.diff(edges)))",
            "np.any(number > np.repeat(count[k : k + BLOCK], np.diff(edges)))",
        ),
    ),
    *mutants_of(
        "app/results/hdf5/store.py",
        READER,
        ("not 1 <= found <= SCHEMA_VERSION", "not 1 <= found"),
        ('store.attrs["friction"] = results.friction', 'store.attrs["friction"] = 0.0'),
        ("stop if stop >= 0 else None, *step", "stop, *step"),
    ),
    *mutants_of(
        "app/results/comparison.py",
        COMPARISON,
        ("np.minimum(i, j)[known], np.maximum(i, j)[known]", "i[known], j[known]"),
        ("rows[a.tracks.id[rows] != b.tracks.id] = -1", "pass"),
        ("forces = b.frames[k - offset]", "forces = b.frames[k - first]"),
        ("CLOSE = 0.5  # radii: two", "CLOSE = 50.0  # radii: two"),
    ),
    *mutants_of(
        "app/results/checkpoint.py",
        "tests/app/results/test_checkpoint.py",
        ("mark.read_bytes() != fingerprint.encode()", "False"),
        ("while self._file(count).exists():", "while self._file(count + 1).exists():"),
    ),
]
