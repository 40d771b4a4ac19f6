"""Motion-free baselines."""

from tests.mutation.mutant import mutants_of

MUTANTS = [
    *mutants_of(
        "solver/baselines/motion_free.py",
        "tests/solver/baselines",
        (
            "candidates.gap < touching + GAP_SIGMAS * np.sqrt(2.0) * noise",
            "candidates.gap < GAP_SIGMAS * np.sqrt(2.0) * noise",
        ),
        ("np.maximum(touching - _mean_gap(", "np.maximum(_mean_gap("),
        ("snapshots[max(0, k - AVERAGED) : k + AVERAGED + 1]", "snapshots[k : k + 1]"),
        ("count = min(round(ISOSTATIC * grains), len(gap))", "count = len(gap)"),
        ("scale_is_known else unit * int(contacts.gauge.sum())", "scale_is_known else unit"),
        ("ready.contacts, ready.candidates,", "ready.contacts, ready.contacts.key,"),
        ("return float((walls.load[walls.loaded] / walls.face[walls.loaded]).mean()) * diameter", "return 1.0"),
    ),
]
