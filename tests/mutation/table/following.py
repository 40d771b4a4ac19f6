"""Photographs that arrive during a test: which are used, when a test starts again, which alarms are raised."""

from tests.mutation.mutant import mutants_of

TESTS = "tests/app/following"

MUTANTS = [
    *mutants_of(
        "app/following/arrivals.py",
        f"{TESTS}/test_arrivals.py",
        ("if self.clock() - known[1] < self.steady_time:", "if False:"),
        ("if known is None or known[0] != stamp:", "if known is None:"),
        ("stamp = state.st_size, state.st_mtime_ns", "stamp = state.st_size, 0"),
        ("files[:first_incomplete]", "files"),
        ("if len(step) < 2 or min(step) <= 0:", "if False:"),
        ("if each > min(step)), None)", "if each > 1), None)"),
        ("            self._gap_since = None\n", ""),
        ("return files if self.clock() - self._gap_since > self.max_delay else files[:gap]", "return files[:gap]"),
    ),
    *mutants_of(
        "app/following/follow.py",
        f"{TESTS}/test_arriving_photographs.py",
        ("if len(ready) <= len(state.files) and ready", "if ready"),
        ("while idle is None or time.monotonic() - since < idle:", "while True:"),
        ("if ready[: len(state.files)] != state.files:", "if False:"),
        ("state.grains if ready[:1] == state.files[:1] else None", "state.grains"),
        ("            _forget(run)\n", ""),
        ("        since = time.monotonic()\n\n", "\n"),
        ("self._store.load(done - 1)", "self._store.load(done - 2)"),
        ("            self._store.checkpoint.drop(0)", "            pass"),
        ("and not lost_photograph:", "and True:"),
        ("sorted(lost - before)", "sorted(lost)"),
        ("photographs = set(experiment.photographs().files) - {first}", "photographs: set[Path] = set()"),
        ('experiment.config.model_dump(mode="json"), sums, program', "sums, program"),
    ),
]
