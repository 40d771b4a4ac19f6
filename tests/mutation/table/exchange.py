"""Files of other programs: direction of y, readings of a contact by disc, side of a wall where rods lie."""

from tests.mutation.mutant import mutants_of

TABLE = "tests/app/exchange/foreign/test_table.py"
PEGS = "tests/app/exchange/foreign/test_pegs.py"
POSTERIOR = ("tests/solver/posterior/test_sequence_evidence.py", "tests/solver/posterior/test_frame_posterior.py")

MUTANTS = [
    *mutants_of(
        "app/exchange/foreign/observations.py",
        TABLE,
        ("        angle = -angle", "        angle = +angle"),
        ("floor - points[:, 1]]", "points[:, 1] - floor]"),
        ("smooth = np.unwrap(column[known])", "smooth = column[known]"),
    ),
    *mutants_of(
        "app/exchange/foreign/proposed_walls.py",
        TABLE,
        ("else left) < 0.0)", "else left) > 0.0)"),
        ("np.argsort(np.abs(left[between]))[:NEXT_TO_BAR]", "np.argsort(np.abs(left[between]))"),
    ),
    *mutants_of(
        "app/exchange/foreign/pegs.py",
        PEGS,
        ("both[int(disc != low)]", "both[int(disc == low)]"),
        ("float(mean[0]), -float(mean[1])", "float(mean[0]), float(mean[1])"),
    ),
    *mutants_of(
        "solver/posterior/sequence_evidence.py",
        POSTERIOR,
        ("& ~are_among(self.key, verdicts.forbidden)", ""),
    ),
]
